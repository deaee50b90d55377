"""Fit a head to examples of taught shapes, and count its correct results for held-out touches and contacts.

Whole touches are held out, never single frames or variants of a touch. A taught shape is reported only if its evidence
exceeds the larger of two thresholds. With the first threshold, the shape takes at most MOST_TAKEN of the five shapes'
contacts. The second threshold is half of the evidence that nearly all of the shape's own contacts reach. The second
threshold rejects foreign contacts without losing touches.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tactile_node.errors import InputError
from tactile_node.learning.background import FOREIGN, Background, Seen, seen_by
from tactile_node.learning.head_fit import fit_head
from tactile_node.learning.taught_file import Examples
from tactile_node.shape.recogniser import OUTPUTS, ShapeRecogniser
from tactile_node.shape.taught import Head, join
from tactile_node.taxel_frame import read_only

FOLDS = 5
STAGES = FOLDS + 2  #: Number of progress reports that `teach` makes.
LEAST_TOUCHES = 10
MOST_TAKEN = 0.0015  #: Largest share of the five shapes' contacts that a taught shape may take.

#: Share of a shape's own examples, those with the least evidence, that the second threshold ignores.
OWN_QUANTILE = 0.02
OWN_SHARE = 0.5      #: Second threshold, as a share of the smallest evidence among the examples not ignored.

#: Share of the held-out touches of each shape that a useful head must recognise. One touch in 30 may be wrong.
LEAST_RIGHT = 0.95
MOST_LOST = 0.003    #: Largest share of the five shapes' contacts that a useful head may lose.


class Rate(NamedTuple):
    """The share of ``right`` cases among ``total``, with its 95 % interval."""

    right: int
    total: int

    @property
    def value(self) -> float:
        """The share, or NaN if there are no cases."""
        return self.right / self.total if self.total else float('nan')

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval by Wilson (Journal of the American Statistical Association 22, 1927).

        >>> [round(end, 3) for end in Rate(29, 30).interval]
        [0.833, 0.994]
        """
        from scipy.stats import binomtest  # slow to import

        if not self.total:
            return 0.0, 1.0
        low, high = binomtest(self.right, self.total).proportion_ci(method='wilson')
        return float(low), float(high)

    def __str__(self) -> str:
        low, high = self.interval
        return f'{100 * self.value:.1f} % ({100 * low:.1f}-{100 * high:.1f})'


class HeldOut(NamedTuple):
    """Counts of a head's results for held-out contacts of the taught sizes.

    Each row is a true class, and each column is a recognised class. The classes are OUTPUTS, followed by the taught
    shapes.
    """

    before: np.ndarray  #: (6, 6), counts without the head, for the five shapes and FOREIGN
    after: np.ndarray   #: (6 + N, 6 + N), counts with the head, also for the touches of the taught shapes

    @property
    def taught(self) -> list[Rate]:
        """Recognised touches of each taught shape."""
        return [Rate(int(self.after[k, k]), int(self.after[k].sum())) for k in range(len(OUTPUTS), len(self.after))]

    @property
    def five(self) -> tuple[Rate, Rate]:
        """Recognised contacts of the five shapes, without and with the head."""
        before, after = (Rate(int(np.trace(each[:FOREIGN, :FOREIGN])), int(each[:FOREIGN].sum()))
                         for each in (self.before, self.after))
        return before, after

    @property
    def foreign(self) -> tuple[Rate, Rate]:
        """Foreign contacts recognised as a shape, without and with the head."""
        before, after = (Rate(int(each[FOREIGN].sum() - each[FOREIGN, FOREIGN]), int(each[FOREIGN].sum()))
                         for each in (self.before, self.after))
        return before, after

    @property
    def is_good(self) -> bool:
        """True if the head is useful.

        A useful head recognises LEAST_RIGHT of each shape's touches, and the five shapes lose at most MOST_LOST of
        their contacts.
        """
        before, after = self.five
        lost = (before.right - after.right) / max(before.total, 1)
        return all(rate.value >= LEAST_RIGHT for rate in self.taught if rate.total) and lost <= MOST_LOST


class Taught(NamedTuple):
    """The head for one kind of frame."""

    head: Head
    held_out: HeldOut


def teach(recogniser: ShapeRecogniser, background: Background, shapes: Sequence[Examples],
          progress: Callable[[], None] = lambda: None) -> Taught:
    """Return the head for the taught shapes, and counts of its results.

    Parameters
    ----------
    recogniser : ShapeRecogniser
        Recogniser that supplies the networks. The recogniser's own taught shapes are not used.
    background : Background
        Background contacts.
    shapes : sequence of Examples
        Examples of each shape, all for the same kind of frame. A shape without examples is never reported.
    progress : callable
        Function called STAGES times to report progress.

    Raises
    ------
    InputError
        Raised if a shape has fewer than LEAST_TOUCHES touches.
    """
    for each in shapes:
        if 0 < each.touches < LEAST_TOUCHES:
            raise InputError('touches of a shape', expected=f'{LEAST_TOUCHES} or more, better 30',
                             got=str(each.touches), remedy='Record more touches, each at a different angle and place.')
    rest, seen = seen_by(recogniser, background.patches), [seen_by(recogniser, each.patches) for each in shapes]
    progress()
    evidence = _held_out_evidence(rest, background.labels, shapes, seen, progress)
    raised = np.array([max(_raised(rest, background.labels, evidence[0][:, k]), _of_own(own[:, k]))
                       for k, own in enumerate(evidence[1:])])
    head = fit_head(rest, background.labels, seen)
    progress()
    head = head._replace(biases=read_only((head.biases - raised).astype(np.float32)))
    return Taught(head, _counted(rest, background.labels, shapes, seen, [each - raised for each in evidence]))


def _held_out_evidence(rest: Seen, labels: np.ndarray, shapes: Sequence[Examples], seen: Sequence[Seen],
                       progress: Callable[[], None]) -> list[np.ndarray]:
    """Return the evidence for the background and for each shape's examples.

    Each value comes from a head that was fitted without the contact's fold.
    """
    folds = [np.arange(len(labels)) % FOLDS, *(each.touch % FOLDS for each in shapes)]
    evidence = [np.full((len(fold), len(shapes)), -np.inf) for fold in folds]
    for left_out in range(FOLDS):
        head = fit_head(rest.chosen(folds[0] != left_out), labels[folds[0] != left_out],
                        [each.chosen(fold != left_out) for each, fold in zip(seen, folds[1:])])
        for found, each, fold in zip(evidence, (rest, *seen), folds):
            if not len(fold):
                continue
            of_fold = each.chosen(fold == left_out)
            found[fold == left_out] = head.evidence(of_fold.embedding, of_fold.log_taxels)
        progress()
    return evidence


def _raised(rest: Seen, labels: np.ndarray, evidence: np.ndarray) -> float:
    """Return the first threshold, with which a shape takes at most MOST_TAKEN of the five shapes' contacts."""
    five = (labels != FOREIGN) & np.isfinite(evidence)
    ahead = np.sort(evidence[five] - np.log(rest.known[five].max(1)))[::-1]
    if not len(ahead):
        return 0.0
    return max(float(ahead[int(MOST_TAKEN * len(ahead))]) + 1e-3, 0.0)


def _of_own(evidence: np.ndarray) -> float:
    """Return the second threshold, OWN_SHARE of the evidence that nearly all of a shape's own examples have."""
    return OWN_SHARE * max(float(np.quantile(evidence, OWN_QUANTILE, method='lower')), 0.0) if len(evidence) else 0.0


def _counted(rest: Seen, labels: np.ndarray, shapes: Sequence[Examples], seen: Sequence[Seen],
             evidence: Sequence[np.ndarray]) -> HeldOut:
    of_size = np.isfinite(evidence[0]).any(1)
    outputs = len(OUTPUTS) + len(shapes)
    before, after = np.zeros((len(OUTPUTS), len(OUTPUTS)), int), np.zeros((outputs, outputs), int)
    np.add.at(before, (labels[of_size], rest.known[of_size].argmax(1)), 1)
    np.add.at(after, (labels[of_size], join(rest.known, evidence[0])[of_size].argmax(1)), 1)
    for number, (each, of_shape, found) in enumerate(zip(shapes, seen, evidence[1:]), len(OUTPUTS)):
        judged = each.is_recorded
        if not judged.any():
            continue
        np.add.at(after[number], join(of_shape.known, found)[judged].argmax(1), 1)
    return HeldOut(read_only(before), read_only(after))


if TYPE_CHECKING:
    from matplotlib.figure import Figure


def confusion_picture(held_out: HeldOut, names: Sequence[str]) -> 'Figure':
    """Draw one row for each true class, with the recognised classes as percentages of the row's contacts.

    Parameters
    ----------
    held_out : HeldOut
        Counts of the head's results.
    names : sequence of str
        Names of the taught shapes.
    """
    from matplotlib.figure import Figure  # matplotlib is optional and slow to import

    answers = [shape.value.replace('_', ' ') for shape in OUTPUTS] + [name.replace('_', ' ') for name in names]
    counts = held_out.after
    totals = counts.sum(1)
    shares = 100 * counts / np.maximum(totals, 1)[:, None]
    side = 0.72 * len(answers)
    figure = Figure(figsize=(side + 2.6, side + 1.7), layout='constrained')
    axes = figure.subplots()
    image = axes.imshow(shares, cmap='Blues', vmin=0, vmax=100)
    truths = [f'{name if name != "unknown" else "foreign"} ({total})' for name, total in zip(answers, totals)]
    axes.set_xticks(range(len(answers)), answers, rotation=40, ha='right')
    axes.set_yticks(range(len(answers)), truths)
    for row, col in zip(*counts.nonzero()):
        share = shares[row, col]
        axes.text(col, row, f'{share:.0f}' if share >= 10 else f'{share:.1f}', ha='center', va='center', fontsize=9,
                  color='white' if share > 50 else 'black')
    axes.set_xlabel('recognised as')
    axes.set_ylabel('true class (held-out contacts)')
    figure.colorbar(image, label='% of the row', shrink=0.7)
    axes.set_title('Recognised classes by true class', fontsize=11)
    return figure
