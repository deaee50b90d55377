"""Touches of known objects -> how reliable recognition is on this skin, and an adaptation if it helps.

The adaptation is a temperature, and a bias and weights for each class that was touched (shape/adaptation.py). Held-out
touches are answered by the whole recogniser with its rules. The adaptation is kept only if their Brier score improves.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import minimize

from tactile_node.contact.pattern import ContactPattern
from tactile_node.errors import InputError
from tactile_node.learning.teach import Rate
from tactile_node.shape.adaptation import LEAST_PROBABILITY, Adaptation
from tactile_node.shape.methods import VisibilityGuard
from tactile_node.shape.patch import joined, make_patch
from tactile_node.shape.recogniser import FEWEST_TAXELS, KINDS, ShapeRecogniser
from tactile_node.shape.recognition import Recognition, Shape, ShapeClass
from tactile_node.shape.support import SURE
from tactile_node.taxel_frame import read_only

FOLDS = 8           #: parts of the touches, each of which is held out once
LEAST_TOUCHES = 24  #: fewest touches in all, for an adaptation
LEAST_CLASSES = 2   #: from touches of one class, an adaptation would learn to answer nothing else
LEAST_GAIN = 0.01   #: of the mean Brier score; a recogniser that is nearly always right gains less, but for certain
#: Standard deviations that the logarithm of the temperature, a bias and a weight have beforehand. On computed skins
#: with gains of up to 6:1 and blur, biases of 1 to 4 were alike, and better than 0.5; smaller weights gained less, and
#: larger ones were worse for unknown objects that had not been touched.
TEMPERATURE_SPREAD = 0.5
BIAS_SPREAD = 2.0
WEIGHT_SPREAD = 0.18
CONFIDENCE_LIMITS = 0.0, 0.5, 0.7, 0.9, 1.0  #: limits of the groups by which confidence is judged
NAMELESS = Shape.UNKNOWN, Shape.NONE


class LabelledTouch(NamedTuple):
    """One frame of a touch, and the object that touched."""

    label: ShapeClass        #: class of the recogniser; UNKNOWN for an object that is none of the others
    pattern: ContactPattern


class Counts(NamedTuple):
    """Counts of the answers to some touches."""

    total: int
    right: int          #: the likeliest class is the label
    no_name: int        #: UNKNOWN or NONE, for an object that has a name
    sure: int           #: a name with a confidence of SURE or more
    sure_and_wrong: int


class Group(NamedTuple):
    """Answers of similar confidence."""

    confidence: float  #: mean confidence
    right: Rate


class Gain(NamedTuple):
    """Improvement of the Brier score, over some touches."""

    mean: float
    error: float  #: standard error of the mean
    touches: int

    @property
    def is_worth_it(self) -> bool:
        """True if the gain is large enough, and larger than its error."""
        return self.mean >= max(LEAST_GAIN, self.error)

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval by Student's t."""
        from scipy.stats import t  # slow to import

        reach = float(t.ppf(0.975, self.touches - 1)) * self.error
        return self.mean - reach, self.mean + reach

    def __str__(self) -> str:
        return '{:.3f} ({:.3f} to {:.3f})'.format(self.mean, *self.interval)


class Answers(NamedTuple):
    """The answers to labelled touches, in the same order."""

    labels: Sequence[ShapeClass]
    found: Sequence[Recognition]

    def counts(self, label: ShapeClass | None = None) -> Counts:
        """Return the counts for the touches of ``label``, or for all if it is None."""
        some = [(truth, each) for truth, each in zip(*self) if label in (None, truth)]
        is_right = [each.shape == truth for truth, each in some]
        is_sure = [each.shape not in NAMELESS and each.confidence >= SURE for _, each in some]
        return Counts(len(some), sum(is_right),
                      sum(each.shape in NAMELESS and truth not in NAMELESS for truth, each in some),
                      sum(is_sure), sum(sure and not right for sure, right in zip(is_sure, is_right)))

    def groups(self) -> list[Group]:
        """Return the answers between each two of CONFIDENCE_LIMITS."""
        confidences = np.array([each.confidence for each in self.found])
        right = np.array([each.shape == truth for truth, each in zip(*self)])
        of = np.digitize(confidences, CONFIDENCE_LIMITS[1:-1])
        return [Group(float(confidences[of == k].mean()) if (of == k).any() else float('nan'),
                      Rate(int(right[of == k].sum()), int((of == k).sum()))) for k in range(len(CONFIDENCE_LIMITS) - 1)]

    def scores(self) -> np.ndarray:
        """Return the Brier score of each answer: the squared error of its probabilities, summed, 0 to 2."""
        return np.array([sum((p - (shape == truth)) ** 2 for shape, p in each.probabilities.items())
                         for truth, each in zip(*self)])


class Assessment(NamedTuple):
    """How reliable recognition is on one skin, and the adaptation to it."""

    before: Answers
    after: Answers | None = None          #: by adaptations, each fitted without the touch that it answers
    gain: Gain | None = None              #: from ``before`` to ``after``
    kind: str = ''                        #: kind of the frames
    adaptation: Adaptation | None = None  #: None if there are too few touches, or the gain is too small


def assess(recogniser: ShapeRecogniser, touches: Sequence[LabelledTouch]) -> Assessment:
    """Return how reliable ``recogniser`` is on the skin of ``touches``, and an adaptation if that helps.

    Raises InputError if some touches are of pressures and some of on/off taxels.
    """
    labels = [touch.label for touch in touches]
    before = Answers(labels, _answers(recogniser, touches))
    examples = _Examples.of(recogniser.adapted({}), touches)
    if len(examples.truth) < LEAST_TOUCHES or len(np.unique(examples.truth)) < LEAST_CLASSES:
        return Assessment(before)
    folds = np.array([labels[:k].count(label) % FOLDS for k, label in enumerate(labels)])
    found = list(before.found)
    for fold in range(FOLDS):
        held_out = np.flatnonzero(folds == fold).tolist()
        adapted = recogniser.adapted({examples.kind: examples.without(held_out).fitted()})
        for k, answer in zip(held_out, _answers(adapted, [touches[k] for k in held_out])):
            found[k] = answer
    after = Answers(labels, found)
    gained = before.scores() - after.scores()
    gain = Gain(float(gained.mean()), float(gained.std(ddof=1) / np.sqrt(len(gained))), len(gained))
    return Assessment(before, after, gain, examples.kind, examples.fitted() if gain.is_worth_it else None)


def _answers(recogniser: ShapeRecogniser, touches: Sequence[LabelledTouch]) -> list[Recognition]:
    guard = VisibilityGuard(recogniser)
    return [guard.recognise(touch.pattern) for touch in touches]


class _Examples(NamedTuple):
    """K touches that an adaptation of N outputs is fitted to; those of too few taxels to be recognised are left out."""

    logits: np.ndarray     #: (K, N), logarithms of the probabilities without an adaptation
    embedding: np.ndarray  #: (K, F)
    truth: np.ndarray      #: (K,), index of the output that is the label
    touch: np.ndarray      #: (K,), index of the touch
    kind: str              #: kind of the frames

    @classmethod
    def of(cls, recogniser: ShapeRecogniser, touches: Sequence[LabelledTouch]) -> '_Examples':
        contacts = [(k, touch.pattern.values, joined(touch.pattern)) for k, touch in enumerate(touches)]
        patches = [(k, make_patch(values, mask), (values, mask)) for k, values, mask in contacts if mask.any()]
        if len({patch.graded for _, patch, _ in patches}) > 1:
            raise InputError('touches', expected='pressures, or on/off taxels', got='both',
                             remedy='Assess recognition from touches on one skin.')
        used = [each for each in patches if np.count_nonzero(each[2][1]) >= FEWEST_TAXELS[KINDS[each[1].graded]]]
        if not used:
            return cls(np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0, int), np.zeros(0, int), '')
        numbers, usable, shown = zip(*used)
        probabilities, embedding, _ = recogniser.probabilities(usable, shown)
        return cls(np.log(np.maximum(probabilities, LEAST_PROBABILITY)), embedding,
                   np.array([recogniser.outputs.index(touches[k].label) for k in numbers]), np.array(numbers),
                   KINDS[usable[0].graded])

    def without(self, touches: Sequence[int]) -> '_Examples':
        kept = ~np.isin(self.touch, touches)
        return _Examples(self.logits[kept], self.embedding[kept], self.truth[kept], self.touch[kept], self.kind)

    def fitted(self) -> Adaptation:
        """Return the likeliest adaptation.

        Only the classes that were touched have biases and weights, whose mean over these classes is 0. So no other
        class becomes likelier or less likely than these.
        """
        outputs = self.logits.shape[1]
        touched = np.unique(self.truth)
        is_truth = self.truth[:, None] == np.arange(outputs)
        inputs = np.column_stack((np.ones(len(self.truth)), self.embedding))
        spreads = np.full((inputs.shape[1], 1), WEIGHT_SPREAD)
        spreads[0] = BIAS_SPREAD

        def matrix_of(flat: np.ndarray) -> np.ndarray:
            matrix = np.zeros((inputs.shape[1], outputs))
            matrix[:, touched] = flat.reshape(-1, len(touched))
            return matrix

        def loss(parameters: np.ndarray) -> tuple[float, np.ndarray]:
            log_temperature, matrix = parameters[0], matrix_of(parameters[1:])
            cooled = self.logits * np.exp(-log_temperature)
            scaled = cooled + inputs @ matrix
            scaled -= scaled.max(1, keepdims=True)
            log_odds = scaled - np.log(np.exp(scaled).sum(1, keepdims=True))
            error = np.exp(log_odds) - is_truth
            slope = (inputs.T @ error + matrix / spreads ** 2)[:, touched]
            slope -= slope.mean(1, keepdims=True)  # so that the mean over the classes stays 0
            prior = (log_temperature / TEMPERATURE_SPREAD) ** 2 + ((matrix / spreads) ** 2).sum()
            return prior / 2 - log_odds[is_truth].sum(), np.append(
                log_temperature / TEMPERATURE_SPREAD ** 2 - (error * cooled).sum(), slope)

        best = minimize(loss, np.zeros(1 + inputs.shape[1] * len(touched)), jac=True, method='L-BFGS-B').x
        matrix = matrix_of(best[1:])
        return Adaptation(float(np.exp(best[0])), read_only(matrix[0]), read_only(matrix[1:]))


if TYPE_CHECKING:
    from matplotlib.figure import Figure


def reliability_picture(assessment: Assessment) -> 'Figure':
    """Draw how often answers of similar confidence are right, without and, if it was tried, with the adaptation."""
    from matplotlib.figure import Figure  # optional, and slow to import

    figure = Figure(figsize=(5, 4.6), layout='constrained')
    axes = figure.subplots()
    axes.plot((0, 1), (0, 1), color='grey', linestyle=':', label='as sure as it is right')
    for name, answers in (('as it is', assessment.before), ('adapted, held out', assessment.after)):
        groups = [group for group in answers.groups() if group.right.total] if answers else []
        if groups:
            right = np.array([group.right.value for group in groups])
            low, high = np.array([group.right.interval for group in groups]).T
            axes.errorbar([group.confidence for group in groups], right, (right - low, high - right), marker='o',
                          capsize=3, label=name)
    axes.set_xlabel('mean confidence')
    axes.set_ylabel('share of answers that are right, 95 % interval')
    axes.set_xlim(0, 1.02)
    axes.set_ylim(0, 1.02)
    axes.legend(loc='upper left')
    axes.set_title(f'Recognition on this skin, {len(assessment.before.labels)} touches', fontsize=11)
    return figure
