"""The noise and the rest of each taxel, learned frame by frame while nothing presses it."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from tactile_node.contact.neighbours import grown, sum_around
from tactile_node.taxel_frame import read_only

FEWEST_TAXELS = 8       #: taxels that show a level
RESTING_SHARE = 0.25   #: part of the visible taxels that has to rest; an object may cover the others
TAKEN_SPREADS = 2.5    #: standard deviations of those taken within which a taxel is taken, too: a light contact is near
#: of normal values this leaves out the upper 1 %: the mean of the others is so many of their standard
CLIPPED_SHIFT = 0.023
CLIPPED_WIDTH = 0.972  #: deviations too low, and these are by this factor too small
FAR_DISTANCES = 10.0  #: distances of the lowest quarter from the lowest eighth below that; of normal values 5 at most
MANY_VALUES = 64         #: values whose eighth and quarter show a distance
MOST_ROUNDS = 12      #: in practice 3 to 6


class Resting(NamedTuple):
    """``level`` and ``deviation`` (standard deviation over the taxels), in the unit of the values; NaN: not known."""

    level: float
    deviation: float

    @property
    def is_known(self) -> bool:
        return self.level == self.level


UNKNOWN_REST = Resting(float('nan'), float('nan'))


def resting_of(values: np.ndarray) -> Resting:
    """Return level and noise of the taxels at rest among the visible ``values``, finite, of any shape.

    The lowest quarter is taken to rest, then all that is no farther above the mean of those taken than 2.5 standard
    deviations, until nothing changes (sigma clipping from below; both are then corrected as for normal values). Of
    noise below the resolution the deviation is 0. Of 64 values or more, up to an eighth may lie far below the others,
    as of taxels that lost their offset: they are left out. Values in whole steps are taken up to one step farther, for
    there are none between. UNKNOWN_REST for fewer than 8 values.

    >>> resting_of(np.array([4.0, 5.0, 6.0] * 20 + [50.0] * 20)).level
    4.0
    """
    count = values.size
    if count < FEWEST_TAXELS:
        return UNKNOWN_REST
    ordered = values.flatten()
    ordered.sort()
    ordered = ordered[_far_below(ordered):]
    count = ordered.size
    origin = float(ordered[0])
    offset = ordered - origin  # sums of squares of small numbers
    sums, squares = offset.cumsum(), (offset * offset).cumsum()
    taken = max(int(RESTING_SHARE * count), 1)
    step = _step(offset[:taken])
    for _ in range(MOST_ROUNDS):
        mean = sums.item(taken - 1) / taken
        deviation = sqrt(max(squares.item(taken - 1) / taken - mean * mean, 0.0))
        reach = int(offset.searchsorted(mean + TAKEN_SPREADS * deviation + step, 'right'))
        if reach <= taken:
            break
        taken = reach
    deviation /= CLIPPED_WIDTH
    return Resting(origin + mean + CLIPPED_SHIFT * deviation, deviation)


def _far_below(ordered: np.ndarray) -> int:
    """Return how many of the values, sorted, lie far below all others; of equal ones the next step is the distance."""
    if ordered.size < MANY_VALUES:
        return 0
    eighth = ordered.item(ordered.size // 8)
    distance = ordered.item(ordered.size // 4) - eighth
    if distance == 0:
        next_one = int(ordered.searchsorted(eighth, 'right'))
        distance = ordered.item(next_one) - eighth if next_one < ordered.size else 0.0
    lowest = eighth - FAR_DISTANCES * distance
    return int(ordered.searchsorted(lowest)) if ordered.item(0) < lowest else 0


def _step(ordered: np.ndarray) -> float:
    """Return the resolution of values, sorted, of which at most a quarter differ; 0 of others, and where none do."""
    gaps = ordered[1:] - ordered[:-1]
    gaps = gaps[gaps > 0]
    return float(gaps.min()) if 0 < 4 * len(gaps) < len(ordered) else 0.0


LEARNED_FRAMES = 25    #: frames at rest from which on a taxel's own noise counts
REMEMBERED_FRAMES = 500      #: frames at rest that it is the mean of, 10 s at 50 Hz
LOUDEST_RATIO = 4.0         #: x the noise of the pad: what reads more is a contact or a fault, not noise
OUTLYING_SPREADS = 2.0        #: standard deviations that one frame counts at most
TOGETHER_SPREADS = 9.0        #: standard deviations by which 3x3 taxels rise together where a contact grows slowly
FOLLOWED_RISE = 0.1        #: standard deviations that the level at rest rises in a frame
LOUDER_RATIO = 2.0          #: x the noise before something pressed
COVERED_SCATTER = 0.5         #: share of the noise: the level of resting taxels varies less, that of a covered pad more


class NoiseFloor:
    """Level and noise at rest of the taxels of one pad, from frame to frame; values are of any one unit.

    A taxel's noise is the root mean square of its readings about the level at rest, its own offset included, and at
    least the noise over the resting taxels of the frame. It is not learned where taxels rise together: a contact that
    grows slowly must not become noise. Until a taxel has rested for LEARNED_FRAMES frames, the frame's noise counts, as
    with an object that is held from the start.

    The level rises slowly and falls at once: where an object comes to cover the whole pad, the lowest taxels are
    pressed. While something presses, the noise of the frame counts for at most LOUDER_RATIO times that before: a held
    object must not drown in the noise of a motor. ``highest``: of values that were tared, the level that no pad at rest
    reaches.
    """

    def __init__(self, highest: float = np.inf):
        self._highest = highest
        self.of_frame = UNKNOWN_REST  #: level and deviation at rest, by the latest frame alone
        self._last = Resting(0.0, 0.0)
        self._is_first = True
        self._quiet = np.inf  # noise of the pad while something presses it, before it became louder
        self._is_loud = False
        self._squares = self._frames = np.zeros((0, 0))

    @property
    def is_new(self) -> bool:
        """True until a frame has shown what taxels read at rest."""
        return self._is_first

    def measure(self, values: np.ndarray, valid: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the level at rest and the noise of each taxel, float (rows, cols), of a frame, ``valid`` where seen.

        Both are 0 where nothing is known yet.
        """
        self.of_frame = resting_of(values[valid])
        self._last = self._followed(self.of_frame)
        if self._frames.shape != values.shape:
            self._squares, self._frames = np.zeros((2, *values.shape))
        deviation = self._last.deviation
        own = np.where(self._frames >= LEARNED_FRAMES, np.sqrt(self._squares), 0.0)
        return self._last.level, read_only(np.minimum(np.maximum(own, deviation), LOUDEST_RATIO * deviation))

    def learn(self, values: np.ndarray, noise: np.ndarray, at_rest: np.ndarray,
              is_touched: bool = False) -> None:
        """Learn from the taxels ``at_rest``, bool, of the frame measured last, whose ``noise`` was returned.

        ``is_touched``: whether something presses the pad, as far as noise that has become louder does not decide.
        """
        if not self._is_loud:
            self._quiet = min(self._quiet, self._last.deviation) if is_touched else np.inf
        off = np.where(at_rest, values - self._last.level, 0.0)
        together = np.abs(sum_around(off)) > TOGETHER_SPREADS * np.maximum(noise, self._last.deviation)
        quiet = at_rest & ~grown(together)
        self._frames += quiet
        news = np.minimum(off * off, (OUTLYING_SPREADS * noise) ** 2) - self._squares
        self._squares += np.where(quiet, news / np.minimum(np.maximum(self._frames, 1), REMEMBERED_FRAMES), 0.0)

    def _followed(self, found: Resting) -> Resting:
        """Return what is at rest, if anything is."""
        level, deviation = self._last
        limit = self._highest
        if not self._is_first:
            limit = min(limit, level + max(TAKEN_SPREADS * deviation, COVERED_SCATTER * found.deviation))
        if not found.is_known or found.level > limit:  # covered whole, or nearly so
            return self._last
        rise = np.inf if self._is_first else FOLLOWED_RISE * found.deviation
        self._is_first = False
        most = LOUDER_RATIO * self._quiet if self._quiet > 0 else np.inf  # noise below the resolution is not known
        self._is_loud = found.deviation > most
        return Resting(min(found.level, level + rise), min(found.deviation, most))
