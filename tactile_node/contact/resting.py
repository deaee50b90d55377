"""What taxels read that nothing presses, by one frame: their level and its noise."""

from math import sqrt
from typing import NamedTuple

import numpy as np

FEWEST = 8       #: taxels that show a level
RESTING = 0.25   #: part of the visible taxels that has to rest; an object may cover the others
SPREADS = 2.5    #: standard deviations of those taken within which a taxel is taken, too: a light contact is near
LEFT_OUT = 0.023  #: of normal values this leaves out the upper 1 %: the mean of the others is so many of their standard
NARROWER = 0.972  #: deviations too low, and these are by this factor too small
FAR_BELOW = 10.0  #: distances of the lowest quarter from the lowest eighth below that; of normal values 5 at most
MANY = 64         #: values whose eighth and quarter show a distance
ROUNDS = 12      #: in practice 3 to 6


class Resting(NamedTuple):
    """``level`` and ``deviation`` (standard deviation over the taxels), in the unit of the values; NaN: not known."""

    level: float
    deviation: float

    @property
    def is_known(self) -> bool:
        return self.level == self.level


UNKNOWN = Resting(float('nan'), float('nan'))


def resting_of(values: np.ndarray) -> Resting:
    """Return level and noise of the taxels at rest among the visible ``values``, finite, of any shape.

    The lowest quarter is taken to rest, then all that is no farther above the mean of those taken than 2.5 standard
    deviations, until nothing changes (sigma clipping from below; both are then corrected as for normal values). Of
    noise below the resolution the deviation is 0. Of 64 values or more, up to an eighth may lie far below the others,
    as of taxels that lost their offset: they are left out. Values in whole steps are taken up to one step farther, for
    there are none between. UNKNOWN for fewer than 8 values.

    >>> resting_of(np.array([4.0, 5.0, 6.0] * 20 + [50.0] * 20)).level
    4.0
    """
    count = values.size
    if count < FEWEST:
        return UNKNOWN
    ordered = values.flatten()
    ordered.sort()
    ordered = ordered[_far_below(ordered):]
    count = ordered.size
    origin = float(ordered[0])
    offset = ordered - origin  # sums of squares of small numbers
    sums, squares = offset.cumsum(), (offset * offset).cumsum()
    taken = max(int(RESTING * count), 1)
    step = _step(offset[:taken])
    for _ in range(ROUNDS):
        mean = sums.item(taken - 1) / taken
        deviation = sqrt(max(squares.item(taken - 1) / taken - mean * mean, 0.0))
        reach = int(offset.searchsorted(mean + SPREADS * deviation + step, 'right'))
        if reach <= taken:
            break
        taken = reach
    deviation /= NARROWER
    return Resting(origin + mean + LEFT_OUT * deviation, deviation)


def _far_below(ordered: np.ndarray) -> int:
    """Return how many of the values, sorted, lie far below all others; of equal ones the next step is the distance."""
    if ordered.size < MANY:
        return 0
    eighth = ordered.item(ordered.size // 8)
    distance = ordered.item(ordered.size // 4) - eighth
    if distance == 0:
        next_one = int(ordered.searchsorted(eighth, 'right'))
        distance = ordered.item(next_one) - eighth if next_one < ordered.size else 0.0
    lowest = eighth - FAR_BELOW * distance
    return int(ordered.searchsorted(lowest)) if ordered.item(0) < lowest else 0


def _step(ordered: np.ndarray) -> float:
    """Return the resolution of values, sorted, of which at most a quarter differ; 0 of others, and where none do."""
    gaps = ordered[1:] - ordered[:-1]
    gaps = gaps[gaps > 0]
    return float(gaps.min()) if 0 < 4 * len(gaps) < len(ordered) else 0.0
