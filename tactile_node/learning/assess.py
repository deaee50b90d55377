"""Assess how reliable recognition is on a skin, from touches of known objects, and adapt the recogniser if that helps.

The adaptation consists of a temperature, plus a bias and weights for each class (shape/adaptation.py). The adaptation
is fitted to the touches and to background contacts of many other objects. The background contacts should be answered as
before. Without them, an adaptation to a few objects would learn to answer every contact with the name of one of these
objects. To judge the adaptation, the recogniser applies all its rules to held-out touches, with an adaptation that was
fitted without these touches. The adaptation is kept only if it improves the Brier score of the held-out touches.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import minimize

from tactile_node.contact.pattern import ContactPattern
from tactile_node.errors import InputError
from tactile_node.learning.background import FOREIGN, Background, load_background, seen_by
from tactile_node.learning.teach import Rate
from tactile_node.shape.adaptation import Adaptation, logits_of
from tactile_node.shape.methods import VisibilityGuard
from tactile_node.shape.patch import joined, make_patch
from tactile_node.shape.recogniser import FEWEST_TAXELS, KINDS, ShapeRecogniser
from tactile_node.shape.recognition import Recognition, Shape, ShapeClass
from tactile_node.shape.support import has_sure_name
from tactile_node.taxel_frame import read_only

FOLDS = 8           #: Number of parts into which the touches are divided. Each part is held out once.
LEAST_TOUCHES = 8   #: Smallest total number of touches to which an adaptation is fitted.
#: Smallest number of touches of unknown objects with which an adaptation may make a name sure. On computed skins, an
#: adaptation without such touches made unknown objects sure, with however many other names.
UNKNOWN_TOUCHES = 8
#: Number of touches that all background contacts together count as. With 1000, the adaptation hardly improved the
#: Tekscan array. With 30, more objects without a touch were named wrongly on the ViTac and Weiss arrays.
BACKGROUND_TOUCHES = 100.0
#: Smallest improvement of the mean Brier score for which an adaptation is kept. If the recogniser is nearly always
#: right, an adaptation improves the score by less than this, even if the improvement is certain.
LEAST_IMPROVEMENT = 0.01
#: Prior standard deviation of the logarithm of the temperature.
TEMPERATURE_SPREAD = 0.5
#: Prior standard deviation of a bias. On simulated skins with gains of up to 6:1 and blur, values of 1 to 4 led to
#: similar results, and 0.5 to worse results.
BIAS_SPREAD = 2.0
#: Prior standard deviation of a weight. On the same simulated skins, smaller values improved the score less. Larger
#: values made the recognition worse for unknown objects that had not been touched.
WEIGHT_SPREAD = 0.18
#: Relative change of the loss at which a fit ends. A smaller change alters the probabilities by less than 0.01.
FITTED = 1e-6
CONFIDENCE_LIMITS = 0.0, 0.5, 0.7, 0.9, 1.0  #: Limits between the groups of recognitions with similar confidence.
NAMELESS = Shape.UNKNOWN, Shape.NONE


class LabelledTouch(NamedTuple):
    """One frame of a touch, with the class of the object."""

    label: ShapeClass        #: class of the object; UNKNOWN if it is none of the recogniser's other classes
    pattern: ContactPattern  #: contact pattern of the frame


class Counts(NamedTuple):
    """Counts of recognitions over some touches."""

    total: int           #: all recognitions
    right: int           #: recognitions whose most probable class is the label
    no_name: int         #: recognitions as UNKNOWN or NONE for an object of a known class
    sure: int            #: recognitions as a known class with a confidence of SURE or more
    sure_and_wrong: int  #: recognitions as a wrong class with a confidence of SURE or more


class ConfidenceGroup(NamedTuple):
    """A group of recognitions with similar confidence."""

    confidence: float  #: mean confidence; NaN for an empty group
    right: Rate        #: share of correct recognitions


class Improvement(NamedTuple):
    """Improvement of the Brier score over some touches."""

    mean: float   #: mean improvement
    error: float  #: standard error of the mean
    touches: int  #: number of touches

    @classmethod
    def of(cls, before: 'Answers', after: 'Answers') -> 'Improvement':
        """Return the improvement of ``after`` over ``before``, which are answers to the same touches."""
        gained = before.scores() - after.scores()
        return cls(float(gained.mean()), float(gained.std(ddof=1) / np.sqrt(len(gained))), len(gained))

    @property
    def is_worth_it(self) -> bool:
        """True if the mean improvement is at least LEAST_IMPROVEMENT and at least the standard error."""
        return self.mean >= max(LEAST_IMPROVEMENT, self.error)

    @property
    def interval(self) -> tuple[float, float]:
        """Lower and upper end of the 95 % interval of the mean, by Student's t-distribution."""
        from scipy.stats import t  # slow to import

        reach = float(t.ppf(0.975, self.touches - 1)) * self.error
        return self.mean - reach, self.mean + reach

    def __str__(self) -> str:
        return '{:.3f} ({:.3f} to {:.3f})'.format(self.mean, *self.interval)


class Answers(NamedTuple):
    """Recognitions of labelled touches."""

    labels: Sequence[ShapeClass]  #: class of each touched object
    found: Sequence[Recognition]  #: recognition of each touch, in the order of ``labels``

    def counts(self, label: ShapeClass | None = None) -> Counts:
        """Return the counts for the touches of ``label``, or for all touches if ``label`` is None."""
        some = [(truth, each) for truth, each in zip(*self) if label in (None, truth)]
        is_right = [each.shape == truth for truth, each in some]
        is_sure = [has_sure_name(each) for _, each in some]
        return Counts(len(some), sum(is_right),
                      sum(each.shape in NAMELESS and truth not in NAMELESS for truth, each in some),
                      sum(is_sure), sum(sure and not right for sure, right in zip(is_sure, is_right)))

    def groups(self) -> list[ConfidenceGroup]:
        """Return one group of recognitions for each interval between two CONFIDENCE_LIMITS."""
        confidences = np.array([each.confidence for each in self.found])
        right = np.array([each.shape == truth for truth, each in zip(*self)])
        of = np.digitize(confidences, CONFIDENCE_LIMITS[1:-1])
        return [ConfidenceGroup(float(confidences[of == k].mean()) if (of == k).any() else float('nan'),
                                Rate(int(right[of == k].sum()), int((of == k).sum())))
                for k in range(len(CONFIDENCE_LIMITS) - 1)]

    def scores(self) -> np.ndarray:
        """Return the Brier score of each recognition, (K,).

        The score is the squared error of the probabilities, summed over the classes. A certain and correct recognition
        scores 0. A certain and wrong recognition scores 2.
        """
        return np.array([sum((p - (shape == truth)) ** 2 for shape, p in each.probabilities.items())
                         for truth, each in zip(*self)])


class Assessment(NamedTuple):
    """Result of an assessment: the recognitions on one skin, and the adaptation to this skin.

    If there are too few touches for an adaptation, the fields with a default value keep this value.
    """

    before: Answers  #: recognitions by the assessed recogniser

    #: recognitions by adapted recognisers. Each touch is recognised with an adaptation that was fitted without this
    #: touch.
    after: Answers | None = None
    improvement: Improvement | None = None  #: improvement of ``after`` over ``before``
    kind: str = ''                           #: kind of frame, one of `recogniser.KINDS`
    adaptation: Adaptation | None = None     #: adaptation to the skin, or None if none is kept


def assess(recogniser: ShapeRecogniser, touches: Sequence[LabelledTouch],
           background: Callable[[str], Background] = load_background) -> Assessment:
    """Assess a recogniser with touches on one skin, and fit an adaptation to all touches if that helps.

    Parameters
    ----------
    recogniser : ShapeRecogniser
        Recogniser to assess. The recogniser's own adaptation applies to the recognitions in ``before``. The new
        adaptation replaces the recogniser's own.
    touches : Sequence[LabelledTouch]
        Touches on one skin.
    background : callable
        Function that returns the background contacts for a kind of frame.

    Returns
    -------
    Assessment
        The recognitions and, if it is kept, the adaptation.

    Raises
    ------
    InputError
        Raised if some touches have pressures and others have on/off values.
    """
    labels = [touch.label for touch in touches]
    before = Answers(labels, _answers(recogniser, touches))
    examples = _Examples.of(recogniser.adapted({}), touches)
    if len(examples.touch) < LEAST_TOUCHES:
        return Assessment(before)
    makes_sure = bool(examples.targets[:, FOREIGN].sum() >= UNKNOWN_TOUCHES)
    examples = examples.joined(_Examples.of_background(recogniser, examples.kind, background(examples.kind)))
    folds = np.array([labels[:k].count(label) % FOLDS for k, label in enumerate(labels)])
    found = list(before.found)
    for fold in range(FOLDS):
        held_out = np.flatnonzero(folds == fold).tolist()
        adapted = recogniser.adapted({examples.kind: examples.without(held_out).fitted(makes_sure)})
        for k, answer in zip(held_out, _answers(adapted, [touches[k] for k in held_out])):
            found[k] = answer
    after = Answers(labels, found)
    improvement = Improvement.of(before, after)
    return Assessment(before, after, improvement, examples.kind,
                      examples.fitted(makes_sure) if improvement.is_worth_it else None)


def _answers(recogniser: ShapeRecogniser, touches: Sequence[LabelledTouch]) -> list[Recognition]:
    guard = VisibilityGuard(recogniser)
    return [guard.recognise(touch.pattern) for touch in touches]


class _Examples(NamedTuple):
    """K contacts of one kind of frame, to which an adaptation of N outputs is fitted."""

    logits: np.ndarray     #: (K, N), logarithms of the probabilities without an adaptation
    embedding: np.ndarray  #: (K, F), embedding of the contacts
    targets: np.ndarray    #: (K, N), probabilities that the adaptation should give
    weights: np.ndarray    #: (K,), number of touches that each contact counts as
    touch: np.ndarray      #: (K,), index of the touch, or -1 for a background contact
    kind: str              #: kind of frame, or '' if there are no touches

    @classmethod
    def of(cls, recogniser: ShapeRecogniser, touches: Sequence[LabelledTouch]) -> '_Examples':
        """Return the contacts of the touches. Touches with too few taxels are excluded."""
        contacts = [(k, touch.pattern.values, joined(touch.pattern)) for k, touch in enumerate(touches)]
        patches = [(k, make_patch(values, mask), (values, mask)) for k, values, mask in contacts if mask.any()]
        if len({patch.graded for _, patch, _ in patches}) > 1:
            raise InputError('touches', expected='pressures, or on/off taxels', got='both',
                             remedy='Assess recognition from touches on one skin.')
        used = [each for each in patches if np.count_nonzero(each[2][1]) >= FEWEST_TAXELS[KINDS[each[1].graded]]]
        if not used:
            empty = np.zeros((0, 0))
            return cls(empty, empty, empty, np.zeros(0), np.zeros(0, int), '')
        numbers, usable, shown = zip(*used)
        answers = recogniser.answers(usable, shown)
        truth = [recogniser.outputs.index(touches[k].label) for k in numbers]
        return cls(logits_of(answers.probabilities), answers.embedding, np.eye(len(recogniser.outputs))[truth],
                   np.ones(len(numbers)), np.array(numbers), KINDS[usable[0].graded])

    @classmethod
    def of_background(cls, recogniser: ShapeRecogniser, kind: str, background: Background) -> '_Examples':
        """Return the background contacts, which should be answered as without an adaptation."""
        seen = seen_by(recogniser, background.patches)
        found = recogniser.with_taught(kind, seen.known, seen.embedding, seen.log_taxels)
        count = len(found)
        return cls(logits_of(found), seen.embedding, found, np.full(count, BACKGROUND_TOUCHES / max(count, 1)),
                   np.full(count, -1), kind)

    def joined(self, others: '_Examples') -> '_Examples':
        return _Examples(np.vstack((self.logits, others.logits)), np.vstack((self.embedding, others.embedding)),
                         np.vstack((self.targets, others.targets)), np.append(self.weights, others.weights),
                         np.append(self.touch, others.touch), self.kind)

    def without(self, touches: Sequence[int]) -> '_Examples':
        kept = ~np.isin(self.touch, touches)
        return _Examples(self.logits[kept], self.embedding[kept], self.targets[kept], self.weights[kept],
                         self.touch[kept], self.kind)

    def fitted(self, makes_sure: bool) -> Adaptation:
        """Return the adaptation with the highest posterior probability."""
        outputs = self.logits.shape[1]
        inputs = np.column_stack((np.ones(len(self.logits)), self.embedding))
        weights = self.weights[:, None]
        spreads = np.full((inputs.shape[1], 1), WEIGHT_SPREAD)
        spreads[0] = BIAS_SPREAD

        def loss(parameters: np.ndarray) -> tuple[float, np.ndarray]:
            log_temperature, matrix = parameters[0], parameters[1:].reshape(-1, outputs)
            cooled = self.logits * np.exp(-log_temperature)
            scaled = cooled + inputs @ matrix
            scaled -= scaled.max(1, keepdims=True)
            log_odds = scaled - np.log(np.exp(scaled).sum(1, keepdims=True))
            error = weights * (np.exp(log_odds) - self.targets)
            slope = inputs.T @ error + matrix / spreads ** 2
            prior = (log_temperature / TEMPERATURE_SPREAD) ** 2 + ((matrix / spreads) ** 2).sum()
            return prior / 2 - (weights * self.targets * log_odds).sum(), np.append(
                log_temperature / TEMPERATURE_SPREAD ** 2 - (error * cooled).sum(), slope)

        best = minimize(loss, np.zeros(1 + inputs.shape[1] * outputs), jac=True, method='L-BFGS-B',
                        options={'ftol': FITTED}).x
        matrix = best[1:].reshape(-1, outputs)
        return Adaptation(float(np.exp(best[0])), read_only(matrix[0]), read_only(matrix[1:]), makes_sure)


if TYPE_CHECKING:
    from matplotlib.figure import Figure


def reliability_picture(assessment: Assessment) -> 'Figure':
    """Return a figure that shows how often recognitions of similar confidence are correct.

    The figure shows the recognitions without an adaptation. If an adaptation was fitted, the figure also shows the
    recognitions with the adaptation.
    """
    from matplotlib.figure import Figure  # matplotlib is optional and slow to import

    figure = Figure(figsize=(5, 4.6), layout='constrained')
    axes = figure.subplots()
    axes.plot((0, 1), (0, 1), color='grey', linestyle=':', label='perfect calibration')
    for name, answers in (('without adaptation', assessment.before), ('adapted, held out', assessment.after)):
        groups = [group for group in answers.groups() if group.right.total] if answers else []
        if groups:
            right = np.array([group.right.value for group in groups])
            low, high = np.array([group.right.interval for group in groups]).T
            axes.errorbar([group.confidence for group in groups], right, (right - low, high - right), marker='o',
                          capsize=3, label=name)
    axes.set_xlabel('mean confidence')
    axes.set_ylabel('share of right answers, 95 % interval')
    axes.set_xlim(0, 1.02)
    axes.set_ylim(0, 1.02)
    axes.legend(loc='upper left')
    axes.set_title(f'Recognition on this skin, {len(assessment.before.labels)} touches', fontsize=11)
    return figure
