"""Whether the centre of a contact rests, though its measurement is noisy and follows the contact in steps.

A straight line is fitted to the centres since the hold began, at most to the last `WINDOW_TIMES` resolution times (the
time in which a creep of ``max_creep`` moves by the resolution). Its slope is the speed; its error is at most
`SPEED_CERTAINTY` standard deviations of the noise, which the scatter around the line shows, plus 1.5 resolution /
length: no error within ± resolution / 2 tilts a line by more. So a speed is a range, and two speeds decide:

- A centre rests once the whole range is below ``max_creep``: a steady creep of ``max_creep`` never does.
- It rests no longer once the whole range is above `KEPT_CREEP` x ``max_creep``: a creep of a tenth never gets there.
- A sudden move ends the rest at once: farther from the line than the tolerance, or than noise and resolution explain.

What it costs is time: 1.5 resolution / max_creep at least. A fit rests after 0.7 s on pads of 2 mm pitch and 1.7 s on
pads of 5 mm, or 1.4 s and 2.7 s with a noise of 0.05 pitch; on/off taxels need 7 s and 17 s.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError

SPEED_CERTAINTY = 5.0    #: standard deviations, of a speed
SLIP_CERTAINTY = 6.0  #: deviations of one centre: there are thousands
SYSTEMATIC_SLOPE = 1.5   #: largest slope x length of an error within ±1/2: half of the window low, half of it high
KEPT_CREEP = 0.4         #: share of max_creep
#: resolution times; then a creep of max_creep exceeds `KEPT_CREEP` whatever the error within resolution
WINDOW_TIMES = 9.0
SHORTEST_WINDOW = 3.0     #: s, window for centres of any resolution: noise needs time too
FEWEST_CENTRES = 8         #: centres that show their noise
BACK_STEP = 0.02        #: s by which a time may go back: the least delay of a path was found to be smaller

#: Resolutions: what a moving contact's centre is wrong by beside its noise, peak to peak [pitches]. Measured on
#: synthetic contacts of all classes (test/test_steadiness.py): a fit is wrong by up to 0.1, the centre of pressure by
#: 0.5 as taxels join and leave the contact, the centre of on/off taxels along the lattice by a whole pitch.
FIT_RESOLUTION, PRESSURE_RESOLUTION, PATTERN_RESOLUTION = 0.1, 0.5, 1.0


@dataclass(frozen=True)
class SteadinessSettings:
    """What counts as resting."""

    max_creep: float = 0.0005  #: speed from which on a centre never rests; a tenth of it always may [m/s]
    slip: float = 0.001        #: distance of a sudden move that ends the rest [m]

    def __post_init__(self) -> None:
        if not (0 < self.max_creep < np.inf and 0 < self.slip < np.inf):
            raise ConfigurationError('steadiness of a grasp', expected='max_creep and slip > 0', got=str(self),
                                     remedy='Give metres per second and metres.')


class Speed(NamedTuple):
    """Speed of the centres, by a line through them."""

    value: float   #: [m/s]
    error: float   #: it may be wrong by this much [m/s]
    noise: float   #: standard deviation of a centre around the line, one axis [m]
    resolution: float  #: mean of the centres' [m]
    end: np.ndarray  #: (2,), where the line is at the time of the last centre [m]


class Steadiness:
    """Steadiness of one side; takes its centres in the order of their times.

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
        self._samples = np.empty((0, 4))  # time, x, y, resolution of each in the window
        self._resting = False
        self.since = np.inf  #: time of the first centre of this hold [s]
        self.speed: Speed | None = None  #: None: too few centres

    def update(self, time: float, centre: tuple[float, float], resolution: float) -> bool:
        """Take the ``centre`` [m] of ``time`` [s] and return whether it rests.

        ``resolution`` [m]: peak to peak, what a moving contact's centre is wrong by beside its noise.
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
        """Whether ``centre`` is farther from the others than the tolerance, or than noise and resolution explain."""
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
        self._samples = np.vstack((self._samples, (time, *centre, resolution)))
        resolution = self.speed.resolution if self.speed else resolution
        length = max(SHORTEST_WINDOW, WINDOW_TIMES * resolution / self._settings.max_creep)
        old = self._samples[:-FEWEST_CENTRES, 0]
        self._samples = self._samples[np.searchsorted(old, time - length):]

    def _fitted(self) -> Speed | None:
        """The line through the centres of the window; None while there are too few."""
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
