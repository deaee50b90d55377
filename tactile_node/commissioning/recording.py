"""Hold what the gripper and the pads sent during one part of a commissioning step."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class PadGrid(NamedTuple):
    """Size of a pad."""

    rows: int
    cols: int
    pitch: float  #: distance between neighbouring taxels [m]


class PadFrames(NamedTuple):
    """Successive frames of one pad."""

    times: np.ndarray      #: acquisition time of each frame, (K,) [s]
    sequences: np.ndarray  #: number of each frame, (K,); a gap means lost frames
    forces: np.ndarray     #: force on each taxel, (K, rows, cols) [N]; NaN if unknown

    @property
    def rate(self) -> float:
        """Frames per second, including lost frames. There must be at least two frames."""
        return float((self.sequences[-1] - self.sequences[0]) / (self.times[-1] - self.times[0]))

    @property
    def mean(self) -> np.ndarray:
        """Mean of the known forces on each taxel, (rows, cols) [N]; NaN if a taxel has no value in any frame."""
        known = np.isfinite(self.forces).sum(0)
        return np.where(known > 0, np.nansum(self.forces, axis=0) / np.maximum(known, 1), np.nan)


class JointStates(NamedTuple):
    """Successive positions of the gripper's joint."""

    times: np.ndarray      #: acquisition times, (K,) [s]
    positions: np.ndarray  #: positions, (K,) [the unit of the joint]


class Recording(NamedTuple):
    """Everything that was received in one interval."""

    pads: tuple[PadFrames, PadFrames]  #: the two pads, in the order in which the driver names them
    joint: JointStates

    def after(self, time: float) -> 'Recording':
        """Return the part of the recording from ``time`` [s] on."""
        first, second = (PadFrames(*(each[pad.times >= time] for each in pad)) for pad in self.pads)
        return Recording((first, second), JointStates(*(each[self.joint.times >= time] for each in self.joint)))


def joined(recordings: Sequence[Recording]) -> Recording:
    """Return one recording from successive recordings, of which there is at least one."""
    first, second = (PadFrames(*map(np.concatenate, zip(*(each.pads[number] for each in recordings))))
                     for number in (0, 1))
    return Recording((first, second), JointStates(*map(np.concatenate, zip(*(each.joint for each in recordings)))))
