"""Chain the poses of coordinate frames, as tf does."""

import math
from typing import NamedTuple

import numpy as np


class Transform(NamedTuple):
    """Pose of one frame in another frame."""

    rotation: np.ndarray     #: axes of the frame as columns, (3, 3)
    translation: np.ndarray  #: origin of the frame, (3,) [m]

    def __matmul__(self, inner: 'Transform') -> 'Transform':
        return Transform(self.rotation @ inner.rotation, self.rotation @ inner.translation + self.translation)

    @property
    def inverse(self) -> 'Transform':
        return Transform(self.rotation.T, -self.rotation.T @ self.translation)


IDENTITY_TRANSFORM = Transform(np.eye(3), np.zeros(3))


class Placement(NamedTuple):
    """Pose of one frame in another frame, with the time of the measurement."""

    transform: Transform
    #: steady-clock time at which the oldest transform between the frames was measured [s]; inf if all transforms are
    #: static
    measured: float


class FrameTree:
    """The latest transform from each frame to its parent."""

    def __init__(self) -> None:
        self._edges: dict[str, tuple[str, Placement]] = {}  # parent of each frame, and the frame's pose in the parent

    def set(self, frame: str, parent: str, transform: Transform, measured: float = math.inf) -> None:
        """Store the pose of ``frame`` in ``parent``.

        ``measured`` is the steady-clock time of the measurement [s], or inf for a static transform.
        """
        self._edges[frame] = parent, Placement(transform, measured)

    def __len__(self) -> int:
        return len(self._edges)

    def find(self, frame: str, reference: str) -> Placement | None:
        """Return the pose of ``frame`` in ``reference``, or None if no chain of transforms connects them."""
        of_frame, of_reference = self._ancestors(frame), self._ancestors(reference)
        common = next((name for name in of_frame if name in of_reference), None)
        if common is None:
            return None
        outer, inner = of_reference[common], of_frame[common]
        return Placement(outer.transform.inverse @ inner.transform, min(outer.measured, inner.measured))

    def _ancestors(self, frame: str) -> dict[str, Placement]:
        """Return the pose of the frame in itself and in each ancestor up to the root.

        The result is empty if the transforms form a loop.
        """
        found: dict[str, Placement] = {}
        name, place = frame, Placement(IDENTITY_TRANSFORM, math.inf)
        while name not in found:
            found[name] = place
            if name not in self._edges:
                return found
            name, edge = self._edges[name]
            place = Placement(edge.transform @ place.transform, min(edge.measured, place.measured))
        return {}
