"""Decide whether a contact is at rest, from noisy measurements of its centre in discrete steps.

The module fits a straight line to the centres measured since the hold began, but at most to those of the last
`WINDOW_TIMES` resolution times. One resolution time is the time in which a creep at ``max_creep`` covers the
resolution. The slope of the line is the speed. The error of the speed is at most the sum of two parts. The first part
is `SPEED_CERTAINTY` standard deviations of the noise, which is estimated from the scatter around the line. The second
part is 1.5 resolution / length, because an error within ± resolution / 2 cannot tilt a line by more than this. The true
speed therefore lies within a range, which is compared with limits:

- A centre counts as resting once the whole range is below ``max_creep``. A centre that creeps steadily at ``max_creep``
  therefore never counts as resting.
- A centre no longer counts as resting once the whole range is above `KEPT_CREEP` x ``max_creep``. A creep at a tenth of
  ``max_creep`` therefore never ends a rest.
- A sudden move ends the rest immediately. A move is sudden if its distance from the line exceeds both the tolerance and
  the distance that noise and resolution explain.

The decision takes at least 1.5 resolution / max_creep. The centre of a fit counts as resting after 0.7 s on pads with a
pitch of 2 mm, and after 1.7 s with a pitch of 5 mm. With a noise of 0.05 pitch, the decision takes 1.4 s for a pitch of
2 mm and 2.7 s for 5 mm. With on/off taxels, the decision takes 7 s for a pitch of 2 mm and 17 s for 5 mm.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError

SPEED_CERTAINTY = 5.0  #: Largest error of a speed due to noise [standard deviations].

#: Largest error of a single centre [standard deviations]. The value is high because thousands of centres are tested.
SLIP_CERTAINTY = 6.0
#: Largest slope x length that an error within ±1/2 can cause. In this worst case, the error is -1/2 in one half of the
#: window and +1/2 in the other half.
SYSTEMATIC_SLOPE = 1.5
KEPT_CREEP = 0.4  #: Share of max_creep above which a centre no longer counts as resting.

#: Length of the window [resolution times]. The window is long enough for a creep at max_creep to exceed `KEPT_CREEP`,
#: whatever the error within the resolution.
WINDOW_TIMES = 9.0
SHORTEST_WINDOW = 3.0  #: Shortest window for any resolution [s], because averaging the noise also takes time.
FEWEST_CENTRES = 8     #: Smallest number of centres from which the noise is estimated.

#: Time by which a stamp may go backwards [s], for example because a smaller minimum delay was found.
BACK_STEP = 0.02

# The resolution is the peak-to-peak error of a moving contact's centre, apart from noise [pitches]. The resolutions
# were measured on synthetic contacts of all classes (test/test_steadiness.py).
FIT_RESOLUTION = 0.1       #: centre of a fit
PRESSURE_RESOLUTION = 0.5  #: centre of pressure, which jumps as taxels join and leave the contact
PATTERN_RESOLUTION = 1.0   #: centre of an on/off contact that moves along rows or columns


@dataclass(frozen=True)
class SteadinessSettings:
    """Limits within which a centre counts as resting."""

    #: speed at which a centre never counts as resting; a tenth of this speed never ends a rest [m/s]
    max_creep: float = 0.0005
    slip: float = 0.001        #: distance of a sudden move that ends the rest [m]

    def __post_init__(self) -> None:
        if not (0 < self.max_creep < np.inf and 0 < self.slip < np.inf):
            raise ConfigurationError('steadiness of a grasp', expected='max_creep and slip > 0', got=str(self),
                                     remedy='Give max_creep in metres per second and slip in metres.')


class Speed(NamedTuple):
    """Speed of the contact's centre, from a line through the measured centres."""

    value: float       #: [m/s]
    error: float       #: largest error of the speed [m/s]
    noise: float       #: standard deviation of the centres from the line, along one axis [m]
    resolution: float  #: mean resolution of the centres [m]
    end: np.ndarray    #: point on the line at the time of the latest centre, (2,) [m]


class Steadiness:
    """Decides whether the centre of one side rests, from measurements in chronological order.

    >>> rest = Steadiness()
    >>> for i in range(50):
    ...     resting = rest.update(0.02 * i, (0.01, 0.01), resolution=0.0002)
    >>> resting, rest.update(1.0, (0.0115, 0.01), resolution=0.0002)  # a slip of 1.5 mm
    (True, False)
    """

    def __init__(self, settings: SteadinessSettings = SteadinessSettings()):
        self._settings = settings
        self.restart()

    def restart(self) -> None:
        """Forget all centres."""
        self._samples = np.empty((0, 4))  # time, x, y, resolution of each centre in the window
        self._resting = False
        self.since = np.inf              #: time of the first centre of this hold [s]
        self.speed: Speed | None = None  #: latest speed, or None while there are too few centres

    def update(self, time: float, centre: tuple[float, float], resolution: float) -> bool:
        """Add a centre, and return True if the contact rests.

        Parameters
        ----------
        time : float
            Time of the centre [s].
        centre : tuple of float
            The centre [m].
        resolution : float
            Peak-to-peak error of a moving contact's centre, apart from noise [m].
        """
        if len(self._samples) and (time < self._samples[-1, 0] - BACK_STEP or self._has_slipped(centre)):
            self.restart()
        self._append(time, centre, resolution)
        self.speed = self._fitted()
        if self.speed is None:
            return False
        value, error, limit = self.speed.value, self.speed.error, self._settings.max_creep
        if self._resting and value - error > KEPT_CREEP * limit:
            self.restart()
            self._append(time, centre, resolution)
            return False
        self._resting = self._resting or value + error < limit
        return self._resting

    def _has_slipped(self, centre: tuple[float, float]) -> bool:
        """Return True if ``centre`` has suddenly moved away from the other centres.

        The distance must exceed both the tolerance and the distance that noise and resolution explain.
        """
        if self.speed is None:
            means = self._samples.mean(0)
            reference, explained = means[1:3], float(means[3])
        else:
            reference, explained = self.speed.end, self.speed.resolution + SLIP_CERTAINTY * self.speed.noise
        distance = math.hypot(*(centre - reference).tolist())
        return distance > max(self._settings.slip, explained)

    def _append(self, time: float, centre: tuple[float, float], resolution: float) -> None:
        if len(self._samples):
            time = max(time, float(self._samples[-1, 0]))
        else:
            self.since = time
        self._samples = np.concatenate((self._samples, [(time, *centre, resolution)]))
        resolution = self.speed.resolution if self.speed else resolution
        length = max(SHORTEST_WINDOW, WINDOW_TIMES * resolution / self._settings.max_creep)
        old = self._samples[:-FEWEST_CENTRES, 0]
        self._samples = self._samples[old.searchsorted(time - length):]

    def _fitted(self) -> Speed | None:
        """Return the speed from a line through the centres of the window, or None while there are too few centres."""
        samples = self._samples
        count = len(samples)
        length = float(samples[-1, 0] - samples[0, 0])
        if count < FEWEST_CENTRES or length <= 0:
            return None
        means = samples.sum(0) / count
        middle, resolution = means[1:3], float(means[3])
        times = samples[:, 0] - means[0]
        places = samples[:, 1:3] - middle
        spread = float(times @ times)
        slope = times @ places / spread
        scatter = (places - times[:, None] * slope).ravel()
        noise = math.sqrt(float(scatter @ scatter) / (2 * (count - 2)))
        error = SPEED_CERTAINTY * noise / math.sqrt(spread) + SYSTEMATIC_SLOPE * resolution / length
        return Speed(math.hypot(*slope.tolist()), error, noise, resolution, middle + times[-1] * slope)
