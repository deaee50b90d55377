"""The frames of a robot as tf transports them: where one is in another, and how old that is.

tf2's buffer serves another purpose: it interpolates in a history of stamps. What is needed here is the latest of each
transform and its age on a steady clock, which tf2 does not know; and tf2 discards what comes after its clock was set
back, so that the transforms from before would stay the latest.
"""

import math
from typing import NamedTuple

import numpy as np


class Transform(NamedTuple):
    """Of a frame in another one."""

    rotation: np.ndarray     #: (3, 3), columns are the frame's axes
    translation: np.ndarray  #: (3,), the frame's origin [m]

    def __matmul__(self, inner: 'Transform') -> 'Transform':
        return Transform(self.rotation @ inner.rotation, self.rotation @ inner.translation + self.translation)

    @property
    def inverse(self) -> 'Transform':
        return Transform(self.rotation.T, -self.rotation.T @ self.translation)


IDENTITY = Transform(np.eye(3), np.zeros(3))


class Placement(NamedTuple):
    """Where a frame is in another one, and since when that is known."""

    transform: Transform
    measured: float  #: when the oldest of the transforms between them was measured, steady [s]; inf: all are static


class _Edge(NamedTuple):
    parent: str
    transform: Transform
    measured: float


class FrameTree:
    """The latest transform of each frame in its parent."""

    def __init__(self) -> None:
        self._edges: dict[str, _Edge] = {}

    def set(self, frame: str, parent: str, transform: Transform, measured: float = math.inf) -> None:
        """Take the place of ``frame`` in ``parent``, ``measured`` at a steady time [s]; inf: it is static."""
        self._edges[frame] = _Edge(parent, transform, measured)

    def __len__(self) -> int:
        return len(self._edges)

    def find(self, frame: str, reference: str) -> Placement | None:
        """Return where ``frame`` is in ``reference``; None while no chain of transforms joins them."""
        of_frame, of_reference = self._ancestors(frame), self._ancestors(reference)
        common = next((name for name in of_frame if name in of_reference), None)
        if common is None:
            return None
        outer, inner = self._place(of_reference, common), self._place(of_frame, common)
        return Placement(outer.transform.inverse @ inner.transform, min(outer.measured, inner.measured))

    def _ancestors(self, frame: str) -> dict[str, _Edge | None]:
        """The frame and its ancestors up to the root, each with its edge; none where transforms form a circle."""
        found: dict[str, _Edge | None] = {}
        name = frame
        while name not in found:
            edge = self._edges.get(name)
            found[name] = edge
            if edge is None:
                return found
            name = edge.parent
        return {}

    def _place(self, ancestors: dict[str, _Edge | None], ancestor: str) -> Placement:
        """Return where the first of ``ancestors`` is in ``ancestor``."""
        transform, measured = IDENTITY, math.inf
        for name, edge in ancestors.items():
            if name == ancestor or edge is None:
                break
            transform, measured = edge.transform @ transform, min(edge.measured, measured)
        return Placement(transform, measured)


def rotation_matrix(x: float, y: float, z: float, w: float) -> np.ndarray:
    """Return the rotation (3, 3) of a quaternion, whose length need not be 1 but not 0."""
    x, y, z, w = np.array((x, y, z, w)) / math.hypot(x, y, z, w)
    return np.array(((1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
                     (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
                     (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y))))
