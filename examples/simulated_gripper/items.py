"""Items on the table: the five shapes as prisms, a ball, a bottle, a bar, a fragile block, a slippery block and gauge
blocks, and the disc for `tactile calibrate`."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import inf, pi
from types import MappingProxyType

import numpy as np

from tactile_node.errors import InputError
from tactile_node.grasp.frame_tree import Transform
from tactile_node.simulator.world import Contact

PAD_HEIGHT = 0.05  #: height of the pads' middle above the table while the hand is lowered [m]


@dataclass(frozen=True)
class Item:
    """A rigid item, either a prism between two equal faces at z = ±length/2 or a ball, in its own frame.

    The item lies with z along the closing direction and y down, or stands if ``upright``.
    """

    face: Contact                 #: face around the origin, or the silhouette of a ball [m]
    length: float = 0.05          #: length of the prism, or 0 for a ball [m]
    mass: float = 0.05            #: [kg]
    friction: float = 0.5         #: friction coefficient on the skin and on the table
    strength: float = inf         #: force of a pad at which the item breaks [N]
    upright: bool = False

    @cached_property
    def rest(self) -> Transform:
        """Initial pose in the world, with the centre between the pads of a lowered hand."""
        lying = np.array(((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)))
        return Transform(np.eye(3) if self.upright else lying, np.array((0.0, 0.0, PAD_HEIGHT)))

    @property
    def width(self) -> float:
        """Width along the closing direction [m]."""
        return 2 * self.face.reach if self.upright else self.length or 2 * self.face.reach

    @property
    def below(self) -> float:
        """Distance from the item's centre down to its lowest point, at rest [m]."""
        return self.length / 2 if self.upright else float(self.face.outline()[:, 1].max())

    @cached_property
    def planes(self) -> tuple[np.ndarray, np.ndarray]:
        """Outward normals (n, 3) of all planes of a prism, and the distances (n,) of the planes from the origin [m]."""
        corners = self.face.outline()
        edges = np.roll(corners, -1, 0) - corners
        outward = np.column_stack((edges[:, 1], -edges[:, 0])) / np.hypot(*edges.T)[:, np.newaxis]
        sides = np.column_stack((outward, np.zeros(len(outward))))
        return (np.vstack((sides, (0, 0, 1), (0, 0, -1))),
                np.append((outward * corners).sum(1), (self.length / 2, self.length / 2)))


def _lying(shape: str, *lengths: float) -> Contact:
    """Return the face of a lying item, with its base at the bottom."""
    return Contact(shape, lengths, x=0.0, y=0.0, angle=pi)


def _gauge_block(width: float, length: float) -> Item:
    """Return a gauge block for `tactile commission`, whose faces are 6 mm high [m]."""
    return Item(_lying('rectangle', length, 0.006), length=width)


_BLOCK = _lying('square', 0.016)

#: name -> item
ITEMS: Mapping[str, Item] = MappingProxyType({
    'circle': Item(_lying('circle', 0.0085)),
    'square': Item(_BLOCK),
    'rectangle': Item(_lying('rectangle', 0.024, 0.012)),
    'right_triangle': Item(_lying('right_triangle', 0.022, 0.013, 1.0)),
    'isosceles_triangle': Item(_lying('isosceles_triangle', 0.018, 0.020)),
    'ball': Item(_lying('circle', 0.018), length=0.0),
    'bottle': Item(_lying('circle', 0.020), length=0.1, mass=0.15, upright=True),
    'bar': Item(_lying('rectangle', 0.060, 0.014), length=0.04, mass=0.08),
    'fragile': Item(_BLOCK, strength=6.0),
    'slippery': Item(_BLOCK, friction=0.1),
    'disc': Item(_lying('circle', 0.0125)),
    'block_25': _gauge_block(0.025, 0.022), 'block_40': _gauge_block(0.040, 0.018),
    'block_55': _gauge_block(0.055, 0.014)})


def item_of(name: str) -> Item:
    """Return the item called ``name``. Raises InputError for an unknown name."""
    if name not in ITEMS:
        raise InputError('item', expected=f'one of {", ".join(ITEMS)}', got=repr(name), remedy='Name a listed item.')
    return ITEMS[name]
