"""Simulated gripper with two tactile pads and an object between them.

The object stays still. Each object is a prism whose outline belongs to one of the five classes, or a rod with two ball
ends. Each skin is an elastic foundation: the pressure is proportional to the object's depth in the skin. An oblique
face therefore presses more on one side and lifts off on the other. Each pad closes until it presses with the force of a
light grasp. The gripper's frame follows the defaults of the grasp node: the left pad lies at z = -gap/2 and faces along
z. The right pad faces the left pad, and its y axis is reversed.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import ndimage
from scipy.spatial.transform import Rotation

from tactile_node.simulator.world import Contact, random_contact

ROWS = 16      #: Number of rows and of columns, as in sim16x16.yaml.
PITCH = 0.002  #: [m]
SPAN = (ROWS - 1) * PITCH
FULL_SCALE = 100e3  #: [Pa]
STIFFNESS = 25e6    #: Stiffness of 4 mm of silicone with E* = 0.1 MPa [Pa/m].
FORCE = 6.0    #: Force of a light grasp [N].
BLUR = 0.5     #: Standard deviation of the blur [pitches].
NOISE = 0.005  #: Standard deviation of the noise [fraction of full scale].
FINE = 6       #: Sampling points per taxel in each direction.
AIM = (SPAN / 2, SPAN / 2)
NO_TURN = Rotation.identity()
REACH = 6.4  #: Largest distance from the centre to the edge of a face [pitches].


@dataclass(frozen=True)
class Thing:
    """An object between the pads, with its face in pitches and its length along the closing direction in metres."""

    face: Contact                       #: centred on the origin
    length: float
    ball: float = 0.0                   #: radius of ball ends [m]; 0 for flat faces


@dataclass(frozen=True)
class Placed:
    """An object at a place in the gripper's frame."""

    thing: Thing
    centre: np.ndarray                  #: [m]
    turn: Rotation                      #: rotation of the object's frame, whose z axis lies along the object's length
    ends: tuple[bool, bool] = (True, True)  #: True for each face that a pad can reach

    def moved(self, shift=(0.0, 0.0), about=(0.0, 0.0, 0.0), by: Rotation = NO_TURN) -> 'Placed':
        """Return the place after the gripper has shifted by ``shift`` [m] and then turned ``by`` about a point."""
        centre = self.centre - np.array((*shift, 0.0))
        return replace(self, centre=about + by.inv().apply(centre - about), turn=by.inv() * self.turn)

    def end(self, side: int) -> np.ndarray:
        """Return the middle of the face that the left (0) or the right (1) pad touches [m]."""
        return self.centre + self.turn.apply((0.0, 0.0, (side - 0.5) * self.thing.length))

    def touched(self, side: int) -> np.ndarray:
        """Return the middle of the face, or the top of the ball, that the left (0) or right (1) pad touches [m]."""
        reach = 1 if side else -1
        inward = self.turn.apply((0.0, 0.0, -reach * self.thing.ball))
        return self.end(side) + inward + (0.0, 0.0, reach * self.thing.ball)

    @property
    def truth(self) -> 'Truth':
        left, right = self.touched(0), self.touched(1)
        x, y, z = right - left
        return Truth(float(np.hypot(x, y)), float(np.arctan2(np.hypot(x, y), z)),
                     float(np.hypot(*(left[:2] - AIM))))


class Truth(NamedTuple):
    """The errors that a planner tries to reduce to 0."""

    offset: float        #: [m]
    misalignment: float  #: [rad]
    off_aim: float       #: distance of the left contact from its goal [m]


class Closed(NamedTuple):
    """Both pads after closing, with their taxel values [Pa] and the ``gap`` [m]."""

    values: tuple[np.ndarray, np.ndarray]
    gap: float
    placed: Placed       #: place of the object relative to the gripper's middle


def close(placed: Placed) -> Closed:
    """Close both pads until each presses with FORCE or finds no object."""
    pressed = [_pressed(placed, side) for side in (0, 1)]
    levels = [level for _, level in pressed]
    middle = np.array((0.0, 0.0, sum(levels) / 2))
    return Closed((pressed[0][0], pressed[1][0][::-1]), levels[1] - levels[0],
                  replace(placed, centre=placed.centre - middle))


def noisy(values: np.ndarray, random: np.random.Generator) -> np.ndarray:
    return np.clip(values + FULL_SCALE * NOISE * random.standard_normal(values.shape), 0, FULL_SCALE)


def random_thing(random: np.random.Generator, kind: str) -> Thing:
    """Return a random prism of class ``kind``, or a rod with ball ends if ``kind`` is 'ball'.

    At any angle, at least one taxel between the face and the edge of the pad stays free.
    """
    while True:
        face = random_contact(random, 'circle' if kind == 'ball' else kind, random.uniform(25, 45))
        if face.reach <= REACH:
            break
    return Thing(replace(face, x=0.0, y=0.0, angle=0.0), length=random.uniform(0.03, 0.05),
                 ball=0.012 if kind == 'ball' else 0.0)


def random_place(random: np.random.Generator, thing: Thing, shift: float = 0.006, tilt: float = 0.14) -> Placed:
    """Place ``thing`` at random, up to ``shift`` [m] off centre in x and y, and tilted by up to ``tilt`` [rad]."""
    size, way = tilt * np.sqrt(random.random()), random.uniform(0, 2 * np.pi)
    turn = (Rotation.from_rotvec((size * np.cos(way), size * np.sin(way), 0.0))
            * Rotation.from_euler('z', random.uniform(0, 2 * np.pi)))
    return Placed(thing, np.array((*(AIM + random.uniform(-shift, shift, 2)), 0.0)), turn)


def _pressed(placed: Placed, side: int) -> tuple[np.ndarray, float]:
    """Return the taxel pressures along the gripper's x and y [Pa], and the z coordinate where the pad stopped [m]."""
    reach = 1 if side else -1           # direction from the object to the pad along z
    steps = (np.arange(ROWS * FINE) + 0.5) / FINE - 0.5
    x, y = np.meshgrid(steps * PITCH, steps * PITCH)
    height = reach * _face(placed, side, x, y)  # height towards the pad, or -inf beside the object
    if not placed.ends[side] or not np.isfinite(height).any():
        return np.zeros((ROWS, ROWS)), reach * placed.thing.length / 2
    taxels, level = foundation(height, FORCE)
    return taxels, reach * level


def foundation(height: np.ndarray, force: float) -> tuple[np.ndarray, float]:
    """Return the taxel pressures [Pa], and the height at which the skin carries ``force`` [N].

    ``height`` is the height of the object towards the skin [m], at FINE points per taxel in each direction. Points
    beside the object have the height -inf.
    """
    area = (PITCH / FINE)**2
    high = height[np.isfinite(height)].max()
    low = high - 0.02
    for _ in range(40):
        middle = (low + high) / 2
        carried = STIFFNESS * area * np.maximum(height - middle, 0).sum()
        low, high = (middle, high) if carried > force else (low, middle)
    pressure = STIFFNESS * np.maximum(height - high, 0)
    taxels = pressure.reshape(ROWS, FINE, ROWS, FINE).mean((1, 3))
    return np.clip(ndimage.gaussian_filter(taxels, BLUR, mode='constant'), 0, FULL_SCALE), high


def _face(placed: Placed, side: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the z coordinate of the face at x, y [m]. Points beside the object are infinitely far from the pad."""
    reach, end, away = (1 if side else -1), placed.end(side), -np.inf if side else np.inf
    if placed.thing.ball:
        radius = placed.thing.ball
        middle = end - reach * placed.turn.apply((0.0, 0.0, radius))
        square = radius**2 - (x - middle[0])**2 - (y - middle[1])**2
        return np.where(square > 0, middle[2] + reach * np.sqrt(np.maximum(square, 0)), away)
    axes = placed.turn.as_matrix()
    along = np.linalg.solve(axes[:2, :2], np.stack(((x - end[0]).ravel(), (y - end[1]).ravel())))
    inside = placed.thing.face.depth(*(along / PITCH)) >= 0
    return np.where(inside, end[2] + axes[2, :2] @ along, away).reshape(x.shape)
