"""Draw contacts that differ slightly from the five shapes, because they are hollow or have rounded corners.

Like `world.Contact`, each object has a centre ``x``, ``y``, a ``reach`` and a function ``depth(x, y)``. No point of the
object is farther from the centre than ``reach``. The depth is positive inside the object and changes by at most 1 per
pitch. A taxel whose centre is deeper than half of the taxel's diagonal is therefore covered completely.
"""

from dataclasses import dataclass

import numpy as np

from tactile_node.simulator.figures import Touching
from tactile_node.simulator.world import Contact


@dataclass(frozen=True)
class Rounded:
    """A ``contact`` (not a circle) with rounded corners.

    The ``radius`` of the corners [pitches] is below the inscribed radius of the contact.
    """

    contact: Contact
    radius: float

    @property
    def x(self) -> float:
        return self.contact.x

    @property
    def y(self) -> float:
        return self.contact.y

    @property
    def reach(self) -> float:
        return self.contact.reach

    def depth(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the exact depth.

        The object consists of all points within ``radius`` of an inner outline, which is the outline shrunk by
        ``radius``.
        """
        corners = _shrunk(self.contact.outline(), self.radius)
        following = np.roll(corners, -1, axis=0) - corners
        across = np.stack((x, y), -1)[..., np.newaxis, :] - corners
        along = np.clip((across * following).sum(-1) / (following ** 2).sum(-1), 0, 1)[..., np.newaxis]
        distance = np.sqrt(((across - along * following) ** 2).sum(-1)).min(-1)
        outside = (across[..., 1] * following[:, 0] - across[..., 0] * following[:, 1] < 0).any(-1)
        return self.radius + np.where(outside, -distance, distance)


@dataclass(frozen=True)
class Hollow:
    """The rim of ``solid``, ``wall`` pitches wide."""

    solid: Touching
    wall: float

    @property
    def x(self) -> float:
        return self.solid.x

    @property
    def y(self) -> float:
        return self.solid.y

    @property
    def reach(self) -> float:
        return self.solid.reach

    def depth(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        depth = self.solid.depth(x, y)
        return np.minimum(depth, self.wall - depth)


def _shrunk(corners: np.ndarray, by: float) -> np.ndarray:
    """Move every edge of a convex polygon inwards."""
    edge = np.roll(corners, -1, axis=0) - corners
    normal = np.column_stack((-edge[:, 1], edge[:, 0])) / np.hypot(*edge.T)[:, np.newaxis]
    before = np.roll(normal, 1, axis=0)
    return corners + by * (normal + before) / (1 + (normal * before).sum(1))[:, np.newaxis]
