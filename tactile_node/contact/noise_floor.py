"""Learn the level and the noise of each taxel at rest, frame by frame while nothing presses the taxel."""

from math import sqrt
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from tactile_node.contact.neighbours import grown, sum_around
from tactile_node.taxel_frame import read_only

FEWEST_TAXELS = 8     #: Smallest number of taxels from which a level can be computed.
RESTING_SHARE = 0.25  #: Share of the visible taxels that must rest. An object may cover the other taxels.

#: A taxel counts as resting if it reads at most this many standard deviations above the mean of the resting taxels. The
#: limit is low because the readings of a light contact are only just above it.
TAKEN_SPREADS = 2.5
#: With the limit above, the upper 1 % of normally distributed values are missing. The mean of the remaining values is
#: too low by this many of their standard deviations.
CLIPPED_SHIFT = 0.023
CLIPPED_WIDTH = 0.972  #: Factor by which the clipping limit makes the standard deviation too small.

#: Let d be the distance between the first octile and the first quartile of the values. Values that lie more than this
#: many d below the octile count as far below the others. Normally distributed values lie at most 5 d below it.
FAR_DISTANCES = 10.0
MANY_VALUES = 64  #: Smallest number of values for which the octile and the quartile are reliable.
MOST_ROUNDS = 12  #: Largest number of rounds of the iteration. In practice, 3 to 6 rounds suffice.

#: Many skins read no values below their zero, so that much of the noise at rest reads exactly 0. This is the smallest
#: share of equal lowest values from which such a skin is recognised.
CUT_SHARE = 0.05
#: In a normal probability plot, noise is a straight line from the lowest value to the first third of the other values
#: and on to the second third. The slopes of the two parts differ at most by this factor.
STRAIGHT = 3.0
#: Largest correlation between neighbouring readings of noise, multiplied by the square root of the number of pairs.
INDEPENDENT = 4.0


class Resting(NamedTuple):
    """Level of the resting taxels, and the standard deviation over these taxels, in the unit of the values.

    Both fields are NaN if they are unknown.
    """

    level: float
    deviation: float

    @property
    def is_known(self) -> bool:
        """True if the level and the deviation are known."""
        return self.level == self.level


UNKNOWN_REST = Resting(float('nan'), float('nan'))


def resting_of(values: np.ndarray) -> Resting:
    """Return the level and the noise of the taxels at rest.

    The function clips high outliers (one-sided sigma clipping). The calculation begins with the lowest quarter of the
    values. Each round adds all values up to 2.5 standard deviations above the mean of the accepted values. The rounds
    end when no value is new. The level and the deviation are corrected for the clipping, assuming normally distributed
    values.

    Parameters
    ----------
    values : np.ndarray
        Values of the visible taxels, finite, of any shape.

    Returns
    -------
    Resting
        Level and standard deviation in the unit of ``values``; UNKNOWN_REST for fewer than 8 values. The deviation is 0
        if the noise is below the resolution of the values.

    Notes
    -----
    If there are 64 values or more, up to an eighth of them may lie far below the others, for example because taxels
    have lost their offset. Values far below the others are ignored. If the values come in steps, the limit is one step
    higher, because no values lie in between.

    Examples
    --------
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
    offset = ordered - origin  # small numbers keep the sums of squares precise
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
    """Return the number of sorted values that lie far below all others.

    If the first octile and the first quartile are equal, the distance to the next larger value is used instead.
    """
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
    """Return the smallest gap between sorted values that come in steps, or 0 if the values do not come in steps.

    Values come in steps if some neighbours in sorted order differ, but fewer than a quarter of them.
    """
    gaps = ordered[1:] - ordered[:-1]
    gaps = gaps[gaps > 0]
    return float(gaps.min()) if 0 < 4 * len(gaps) < len(ordered) else 0.0


def are_cut_off(values: np.ndarray) -> bool:
    """Return True if CUT_SHARE of the ``values`` or more equal the lowest value.

    >>> are_cut_off(np.array([0.0, 0.0, 0.3, 1.2])), are_cut_off(np.linspace(-2, 2, 30))
    (True, False)
    """
    return bool(np.count_nonzero(values == values.min(initial=np.inf)) >= CUT_SHARE * max(values.size, 1))


def resting_cut_off(values: np.ndarray, valid: np.ndarray) -> Resting:
    """Return the level and the noise at rest for a skin that cuts off its lowest readings.

    The readings above the lowest one show the upper part of the noise. The result is known only if these readings
    cannot come from a contact: neighbouring readings are independent, and their distribution is normal.

    Parameters
    ----------
    values : np.ndarray
        Taxel values, float (rows, cols).
    valid : np.ndarray
        Taxels with a valid value, bool (rows, cols). Some of their values equal the lowest value (`are_cut_off`).

    Returns
    -------
    Resting
        Level and standard deviation in the unit of ``values``; UNKNOWN_REST if something may press the pad. The
        deviation is 0 if fewer than FEWEST_TAXELS taxels differ from the lowest value.
    """
    seen = values[valid]
    readings, counts = np.unique(seen, return_counts=True)
    lowest = readings.item(0)
    above = seen.size - counts.item(0)
    if above < FEWEST_TAXELS:
        return Resting(lowest, 0.0)
    reached = counts.cumsum()
    places = [0, *reached[:-1].searchsorted((seen.size - 2 / 3 * above, seen.size - above / 3))]
    if not 0 < places[1] < places[2] < readings.size - 1:
        return UNKNOWN_REST
    # A value stands for all readings that round to it, up to halfway to the next value.
    heights = [(readings.item(place) + readings.item(place + 1)) / 2 - lowest for place in places]
    spreads = [float(ndtri(reached.item(place) / seen.size)) for place in places]
    slope, next_slope = ((heights[k + 1] - heights[k]) / (spreads[k + 1] - spreads[k]) for k in (0, 1))
    if not slope < STRAIGHT * next_slope < STRAIGHT**2 * slope or not _are_independent(values, valid):
        return UNKNOWN_REST
    deviation = (heights[2] - heights[0]) / (spreads[2] - spreads[0])
    return Resting(lowest + max(heights[0] - spreads[0] * deviation, 0.0), deviation)


def _are_independent(values: np.ndarray, valid: np.ndarray) -> bool:
    """Return True if the readings of neighbours along rows, columns and both diagonals are not correlated."""
    off = np.where(valid, values - values[valid].mean(), 0.0)
    pairs = ((off[:, 1:], off[:, :-1]), (off[1:], off[:-1]), (off[1:, 1:], off[:-1, :-1]), (off[1:, :-1], off[:-1, 1:]))
    variance = (off * off).sum() / np.count_nonzero(valid)
    return all(abs((one * other).sum()) <= INDEPENDENT * variance * sqrt(one.size) for one, other in pairs)


LEARNED_FRAMES = 25      #: Number of frames at rest after which a taxel's own noise is used.
REMEMBERED_FRAMES = 500  #: Number of frames at rest over which the noise is averaged (10 s at 50 Hz).

#: Highest noise of a taxel, relative to the noise of the pad. Higher values come from a contact or a fault, not from
#: noise.
LOUDEST_RATIO = 4.0
#: A reading counts as at most this many standard deviations away from the level, so that a single outlier has little
#: effect.
OUTLYING_SPREADS = 2.0
#: If the sum of 3x3 taxels rises by more than this many standard deviations, the taxels rise together, as under a
#: slowly growing contact.
TOGETHER_SPREADS = 9.0
FOLLOWED_RISE = 0.1  #: Largest rise of the level at rest in one frame [standard deviations].
LOUDER_RATIO = 2.0   #: Highest noise during a touch, relative to the noise before the touch.

#: Share of the frame's deviation by which the level at rest may rise from frame to frame. If an object covers the pad,
#: the level rises by more.
COVERED_SCATTER = 0.5


class NoiseFloor:
    """Level and noise of one pad's taxels at rest, tracked from frame to frame, in the unit of the values.

    The noise of a taxel is the root mean square of its readings about the level at rest. The noise includes the taxel's
    own offset and is at least the noise over the resting taxels of the frame. Where taxels rise together, no noise is
    learned, because a slowly growing contact must not be learned as noise. Until a taxel has rested for LEARNED_FRAMES
    frames, the noise of the frame replaces the noise of the taxel. Taxels under an object that is held from the start
    therefore use the noise of the frame.

    The level at rest rises slowly and falls immediately. When an object covers the whole pad, even the lowest
    taxels are pressed, and the level must not rise to their readings. While something presses the pad, the noise is
    limited to LOUDER_RATIO times the noise before the touch. The limit prevents a held object from disappearing in the
    noise of a motor.

    Parameters
    ----------
    highest : float
        Upper limit of the level at rest for tared values; infinite for values that were not tared.
    """

    def __init__(self, highest: float = np.inf):
        self._highest = highest
        self.of_frame = UNKNOWN_REST  #: level and deviation at rest, from the latest frame alone
        #: False if the resting taxels of the latest frame have risen by more than a level at rest can rise in one frame
        self.is_followed = True
        self._last = Resting(0.0, 0.0)
        self._is_first = True
        self._quiet = np.inf  # noise of the pad when the present touch began; infinite if there is no touch
        self._is_loud = False
        self._squares = self._frames = np.zeros((0, 0))

    def measure(self, values: np.ndarray, valid: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the level at rest and the noise of each taxel for a new frame.

        Parameters
        ----------
        values : np.ndarray
            Taxel values, float (rows, cols).
        valid : np.ndarray
            Taxels with a valid value, bool (rows, cols).

        Returns
        -------
        level : float
            Level at rest; 0 while it is unknown.
        noise : np.ndarray
            Standard deviation of each taxel at rest, float (rows, cols), read-only; 0 while it is unknown.
        """
        seen = values[valid]
        self.of_frame = found = resting_of(seen)
        if found.is_known and are_cut_off(seen):
            found = resting_cut_off(values, valid)
            if found.is_known:
                self.of_frame = found
            elif self._is_first:
                found = self.of_frame
        self._last = self._followed(found)
        if self._frames.shape != values.shape:
            self._squares, self._frames = np.zeros((2, *values.shape))
        deviation = self._last.deviation
        own = np.where(self._frames >= LEARNED_FRAMES, np.sqrt(self._squares), 0.0)
        return self._last.level, read_only(np.minimum(np.maximum(own, deviation), LOUDEST_RATIO * deviation))

    def learn(self, values: np.ndarray, noise: np.ndarray, at_rest: np.ndarray,
              is_touched: bool = False) -> None:
        """Learn the noise from the resting taxels of the frame that `measure` saw last.

        Parameters
        ----------
        values : np.ndarray
            Taxel values of the last frame, float (rows, cols).
        noise : np.ndarray
            Noise that `measure` returned for the last frame, float (rows, cols).
        at_rest : np.ndarray
            Taxels at rest, bool (rows, cols).
        is_touched : bool
            True if something presses the pad. A ``False`` is ignored while the noise is above its limit, because the
            noise may then hide a contact.
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
        """Return the new level and deviation at rest, or the previous ones if no taxel rests in this frame."""
        level, deviation = self._last
        limit = self._highest
        if not self._is_first:
            limit = min(limit, level + max(TAKEN_SPREADS * deviation, COVERED_SCATTER * found.deviation))
        # An object covers the whole pad or nearly all of it, or it presses a skin that cuts off its lowest readings.
        self.is_followed = not found.level > limit
        if not found.is_known or not self.is_followed:
            return self._last
        rise = np.inf if self._is_first else FOLLOWED_RISE * found.deviation
        self._is_first = False
        # If the noise before the touch was below the resolution, it is unknown and sets no limit.
        most = LOUDER_RATIO * self._quiet if self._quiet > 0 else np.inf
        self._is_loud = found.deviation > most
        return Resting(min(found.level, level + rise), min(found.deviation, most))
