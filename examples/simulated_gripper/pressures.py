"""Compute the taxel pressures under a pressed item, with an elastic foundation as in bench/planner_world.py.

MuJoCo computes the force and the pose of the item, and this module distributes the force over the taxels according to
the geometry. In MuJoCo, an oblique face presses only with its edge, whereas the centre of the pressures computed here
lies some millimetres farther inside. The pad frame has its origin at the centre of taxel (0, 0), x along the columns, y
along the rows, and z out of the skin.

A load along the pad, for example the weight of a lifted item, shears the skin. The item then moves with the surface of
the skin. The load also acts at the height of the skin above the taxels, so its moment moves the pressure on the taxels
farther towards the load. In MuJoCo, the skin does not yield along the pad. bench/stuck_contact.py computes the pressure
under a sheared skin exactly.
"""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from bench.planner_world import FINE, PITCH, ROWS, foundation
from examples.simulated_gripper.items import Item
from tactile_node.grasp.frame_tree import Transform

THICKNESS = 0.004      #: thickness of the skin [m], see STIFFNESS in bench/planner_world.py
SHEAR_MODULUS = 25e3   #: shear modulus of the skin [Pa], for incompressible silicone with E* = 0.1 MPa
NO_LOAD = (0.0, 0.0)


def pressures(item: Item, pose: Transform, force: float, load: Sequence[float] = NO_LOAD) -> np.ndarray:
    """Return the taxel values under an item.

    Parameters
    ----------
    item
        Item.
    pose
        Pose of the item in the frame of the pad.
    force
        Force normal to the pad [N].
    load
        Force along x and y with which the item pulls the skin [N].

    Returns
    -------
    numpy.ndarray
        Values (rows, cols) [Pa], which are all 0 without a force or if the item is not in front of the pad.
    """
    depth = -surface(item, pose)
    if not (force > 0 and np.isfinite(depth).any()):
        return np.zeros((ROWS, ROWS))
    values, lowest = foundation(depth, force)
    area = (depth > lowest).sum() * (PITCH / FINE)**2
    shift = THICKNESS * np.array(load) * (1 / force + 1 / (SHEAR_MODULUS * area))
    return ndimage.shift(values, shift[::-1] / PITCH, order=1, mode='nearest') if np.any(load) else values


def surface(item: Item, pose: Transform) -> np.ndarray:
    """Return z of the item's near side at FINE points per taxel in each direction [m], or inf beside the item."""
    steps = ((np.arange(ROWS * FINE) + 0.5) / FINE - 0.5) * PITCH
    x, y = np.meshgrid(steps, steps)
    return _ball(item, pose, x, y) if not item.length else _prism(item, pose, x, y)


def _ball(item: Item, pose: Transform, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    (across, down, away), radius = pose.translation, item.face.reach
    square = radius**2 - (x - across)**2 - (y - down)**2
    return np.where(square > 0, away - np.sqrt(np.maximum(square, 0)), np.inf)


def _prism(item: Item, pose: Transform, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return z [m] where lines along z enter the prism, which is where they cross the last plane that faces the pad."""
    normals, distances = item.planes
    normals = normals @ pose.rotation.T
    distances = distances + normals @ pose.translation
    enter, leave = np.full(x.shape, -np.inf), np.full(x.shape, np.inf)
    for (a, b, c), distance in zip(normals, distances):
        room = distance - a * x - b * y
        if abs(c) < 1e-9:
            leave[room < 0] = -np.inf
        elif c < 0:
            np.maximum(enter, room / c, out=enter)
        else:
            np.minimum(leave, room / c, out=leave)
    return np.where(enter < leave, enter, np.inf)
