"""What taxels read that nothing presses, by one frame: their level and its noise."""

from math import sqrt
from typing import NamedTuple

import numpy as np

FEWEST = 8       #: taxels that show a level
RESTING = 0.25   #: part of the visible taxels that has to rest; an object may cover the others
SPREADS = 2.5    #: standard deviations of those taken within which a taxel is taken, too: a light contact is near
LEFT_OUT = 0.023  #: of normal values this leaves out the upper 4 %: the mean of the others is so many of their standard
NARROWER = 0.972  #: deviations too low, and these are by this factor too small
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

    The lowest quarter is taken to rest, then all that is no farther above the mean of those taken than two standard
    deviations, until nothing changes (sigma clipping from below; both are then corrected as for normal values). Of
    noise below the resolution the deviation is 0. UNKNOWN for fewer than 8 values.

    >>> resting_of(np.array([4.0, 5.0, 6.0] * 20 + [50.0] * 20)).level
    4.0
    """
    count = values.size
    if count < FEWEST:
        return UNKNOWN
    ordered = values.flatten()
    ordered.sort()
    origin = float(ordered[0])
    offset = ordered - origin  # sums of squares of small numbers
    sums, squares = offset.cumsum(), (offset * offset).cumsum()
    taken = max(int(RESTING * count), 1)
    for _ in range(ROUNDS):
        mean = sums.item(taken - 1) / taken
        deviation = sqrt(max(squares.item(taken - 1) / taken - mean * mean, 0.0))
        reach = int(offset.searchsorted(mean + SPREADS * deviation, 'right'))
        if reach <= taken:
            break
        taken = reach
    deviation /= NARROWER
    return Resting(origin + mean + LEFT_OUT * deviation, deviation)
