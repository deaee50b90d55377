"""The noise of each taxel at rest, learned frame by frame while nothing presses it."""

import numpy as np

from tactile_node.contact.neighbours import grown, sum_around
from tactile_node.contact.resting import SPREADS, Resting, resting_of
from tactile_node.read_only import read_only

LEARNED_AFTER = 25    #: frames at rest from which on a taxel's own noise counts
REMEMBERED = 500      #: frames at rest that it is the mean of, 10 s at 50 Hz
LOUDEST = 4.0         #: x the noise of the pad: what reads more is a contact or a fault, not noise
OUTLYING = 2.0        #: standard deviations that one frame counts at most
TOGETHER = 9.0        #: standard deviations by which 3x3 taxels rise together where a contact grows slowly
FOLLOWED = 0.1        #: standard deviations that the level at rest rises in a frame
LOUDER = 2.0          #: x the noise before something pressed
SCATTER = 0.5         #: of the noise: the level of resting taxels varies less, that of a covered pad more


class NoiseFloor:
    """Level and noise at rest of the taxels of one pad, from frame to frame; values are of any one unit.

    A taxel's noise is the root mean square of its readings about the level at rest, its own offset included, and at
    least the noise over the resting taxels of the frame. It is not learned where taxels rise together: a contact that
    grows slowly must not become noise. Until a taxel has rested for LEARNED_AFTER frames, the frame's noise counts, as
    with an object that is held from the start.

    The level rises slowly and falls at once: where an object comes to cover the whole pad, the lowest taxels are
    pressed. While something presses, the noise of the frame counts for at most LOUDER times that before: a held object
    must not drown in the noise of a motor. ``highest``: of values that were tared, the level that no pad at rest
    reaches.
    """

    def __init__(self, highest: float = np.inf):
        self._highest = highest
        self._last = Resting(0.0, 0.0)
        self._is_first = True
        self._quiet = np.inf  # noise of the pad while something presses it, before it became louder
        self._is_loud = False
        self._squares = self._frames = np.zeros((0, 0))

    def measure(self, values: np.ndarray, valid: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the level at rest and the noise of each taxel, float (rows, cols), of a frame, ``valid`` where seen.

        Both are 0 where nothing is known yet.
        """
        self._last = self._followed(resting_of(values[valid]))
        if self._frames.shape != values.shape:
            self._squares, self._frames = np.zeros((2, *values.shape))
        deviation = self._last.deviation
        own = np.where(self._frames >= LEARNED_AFTER, np.sqrt(self._squares), 0.0)
        return self._last.level, read_only(np.minimum(np.maximum(own, deviation), LOUDEST * deviation))

    def learn(self, values: np.ndarray, noise: np.ndarray, at_rest: np.ndarray,
              is_touched: bool = False) -> None:
        """Learn from the taxels ``at_rest``, bool, of the frame measured last, whose ``noise`` was returned.

        ``is_touched``: whether something presses the pad, as far as noise that has become louder does not decide.
        """
        if not self._is_loud:
            self._quiet = min(self._quiet, self._last.deviation) if is_touched else np.inf
        off = np.where(at_rest, values - self._last.level, 0.0)
        together = np.abs(sum_around(off)) > TOGETHER * np.maximum(noise, self._last.deviation)
        quiet = at_rest & ~grown(together)
        self._frames += quiet
        news = np.minimum(off * off, (OUTLYING * noise) ** 2) - self._squares
        self._squares += np.where(quiet, news / np.minimum(np.maximum(self._frames, 1), REMEMBERED), 0.0)

    def _followed(self, found: Resting) -> Resting:
        """Return what is at rest, if anything is."""
        level, deviation = self._last
        limit = self._highest
        if not self._is_first:
            limit = min(limit, level + max(SPREADS * deviation, SCATTER * found.deviation))
        if not found.is_known or found.level > limit:  # covered whole, or nearly so
            return self._last
        rise = np.inf if self._is_first else FOLLOWED * found.deviation
        self._is_first = False
        most = LOUDER * self._quiet if self._quiet > 0 else np.inf  # noise below the resolution is not known
        self._is_loud = found.deviation > most
        return Resting(min(found.level, level + rise), min(found.deviation, most))
