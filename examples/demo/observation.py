"""Compare the touches reported on the demo's topics with the true touches."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from tactile_node.shape.recognition import UnknownReason
from tactile_node.simulator.touches import SimulatedTouch

SIZE_TOLERANCE = 0.25  #: largest allowed error of a length [pitches]

#: The machine is too slow if more than 1 % of the simulated skin's CAN frames are later than this [s].
MOST_SKIN_LATE = 0.01
#: Limit for the total time that all threads of the nodes wait for a processor, as a share of the session. Above this
#: limit, the machine is too busy. The share was 0.37 on two idle cores, and 0.57 beside two processes that kept both
#: cores busy.
MOST_WAITED = 0.5


class Performance(NamedTuple):
    """Latency of the received shapes, and two measures of the machine's speed.

    The two measures are the lateness of the simulated skin and the time that the nodes wait for a processor. Both
    depend only on the machine, not on the speed of the nodes.
    """

    latency: Sequence[float]  #: times from SYNC to the arrival of each shape [s]
    frames: int               #: number of frames acquired by all pads during the script
    skin_late: float          #: 99th percentile of the lateness of the skin's CAN frames [s]
    waited: float = 0.0       #: total time that threads of the nodes waited for a processor, as a share of the session

    @property
    def answered(self) -> float:
        """Fraction of taxel frames for which a shape was received."""
        return min(len(self.latency) / max(self.frames, 1), 1.0)

    @property
    def is_machine_too_slow(self) -> bool:
        return self.skin_late > MOST_SKIN_LATE or self.waited > MOST_WAITED


class SeenFit(NamedTuple):
    """Pose and size from the shape topic, in the frame of the pad [m, rad]."""

    dimensions: Mapping[str, float]  #: lengths, keyed by the names in ContactShape.dimension_names
    centre: tuple[float, float]
    angle: float | None              #: angle of the shape, or None for a circle
    names: tuple[str, ...]           #: names of the rows of ``covariance``
    covariance: np.ndarray
    outline: np.ndarray              #: corners of the outline, (n, 2)

    def sd(self, name: str) -> float:
        """Return the standard deviation of the parameter ``name``."""
        place = self.names.index(name)
        return float(np.sqrt(self.covariance[place, place]))

    @property
    def lengths(self) -> str:
        """The dimensions in millimetres, preceded by the name if there is only one."""
        name = f'{next(iter(self.dimensions))} ' if len(self.dimensions) == 1 else ''
        return name + ' x '.join(f'{1000 * length:.1f}' for length in self.dimensions.values())

    @property
    def size(self) -> str:
        """The dimensions and their largest standard deviation, in millimetres."""
        return f'{self.lengths} ± {1000 * max(map(self.sd, self.dimensions)):.2f} mm'

    @property
    def place(self) -> str:
        """The centre and the larger standard deviation of its coordinates, in millimetres."""
        x, y = self.centre
        return f'{1000 * x:.1f}, {1000 * y:.1f} ± {1000 * max(self.sd("x"), self.sd("y")):.2f} mm'

    @property
    def turn(self) -> str:
        """The angle and its standard deviation in degrees, or an empty string for a circle."""
        return '' if self.angle is None else f'{np.degrees(self.angle):.1f} ± {np.degrees(self.sd("angle")):.1f}°'


class SeenFrame(NamedTuple):
    """One recognised frame, with its time in the script [s], probabilities by shape, and taxels (rows, cols) [Pa]."""

    time: float
    probabilities: Mapping[str, float]
    taxels: np.ndarray
    fit: SeenFit | None = None
    reason: UnknownReason = UnknownReason.NOT_UNKNOWN

    @property
    def name(self) -> str:
        """The most probable shape."""
        return max(self.probabilities, key=self.probabilities.__getitem__)


class TouchVerdict(NamedTuple):
    """One touch of one pad, with the recognition result over all frames in which the touch was steady."""

    pad: str
    touch: SimulatedTouch
    recognised: str
    confidence: float  #: mean probability of the recognised shape over the frames
    frames: int
    taxels: np.ndarray  #: taxels in the middle frame [Pa]
    fit: SeenFit | None  #: fit in the middle frame
    pitch: float  #: distance between neighbouring taxels [m]

    @property
    def is_right_shape(self) -> bool:
        return self.recognised == self.touch.contact.shape

    @property
    def true_lengths(self) -> tuple[float, ...]:
        """Dimensions of the true contact, in the same order as the dimensions of a fit [m]."""
        # a third value would be the handedness
        return tuple(self.pitch * length for length in self.touch.contact.dimensions[:2])

    @property
    def size_error(self) -> float:
        """Largest error of a dimension [m], or NaN without a fit of the right shape."""
        if self.fit is None or len(self.fit.dimensions) != len(self.true_lengths) or not self.is_right_shape:
            return np.nan
        return max(abs(found - true) for found, true in zip(self.fit.dimensions.values(), self.true_lengths))

    @property
    def is_right_size(self) -> bool:
        return self.size_error <= SIZE_TOLERANCE * self.pitch


def verdicts_of(pad: str, touches: tuple[SimulatedTouch, ...], seen: list[SeenFrame],
                pitch: float) -> list[TouchVerdict]:
    """Return a verdict for each touch with at least one frame. ``pitch`` is the distance between taxels [m]."""
    held = ((touch, [frame for frame in seen if touch.is_steady(frame.time)]) for touch in touches)
    return [_verdict(pad, touch, frames, pitch) for touch, frames in held if frames]


def _verdict(pad: str, touch: SimulatedTouch, frames: list[SeenFrame], pitch: float) -> TouchVerdict:
    means = {name: float(np.mean([frame.probabilities[name] for frame in frames]))
             for name in frames[0].probabilities}
    recognised = max(means, key=means.__getitem__)
    middle = frames[len(frames) // 2]
    return TouchVerdict(pad=pad, touch=touch, recognised=recognised, confidence=means[recognised], frames=len(frames),
                        taxels=middle.taxels, fit=middle.fit, pitch=pitch)
