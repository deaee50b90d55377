"""A fitted contact as a solid that planners take: a primitive, or a triangle mesh."""

import numpy as np

from tactile_node.pose.fit import ShapeFit
from tactile_node.shape.recognition import Shape


def solid(fit: ShapeFit, height: float) -> tuple[str, tuple[float, ...]] | None:
    """Return the primitive that stands ``height`` [m] high; None for triangles (use `prism`).

    'box' (x, y, z) or 'cylinder' (height, radius), in the frame of the fit's pose; lengths in the order of
    shape_msgs/SolidPrimitive [m].
    """
    if fit.shape is Shape.CIRCLE:
        return 'cylinder', (height, fit.dimensions[0])
    if fit.shape in (Shape.SQUARE, Shape.RECTANGLE):
        return 'box', (fit.dimensions[0], fit.dimensions[-1], height)
    return None


def prism(fit: ShapeFit, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (2n, 3) and triangles (4n - 4, 3) of a closed mesh.

    Vertices in the pad's frame [m], z from 0 to ``height``; the triangles' corners run counter-clockwise seen
    from outside.
    """
    count = len(fit.outline)
    base = np.column_stack((fit.outline, np.zeros(count)))
    fan = np.array([(0, i, i + 1) for i in range(1, count - 1)])
    i = np.arange(count)
    j = (i + 1) % count
    sides = np.concatenate((np.column_stack((i, j, j + count)), np.column_stack((i, j + count, i + count))))
    return np.concatenate((base, base + (0, 0, height))), np.concatenate((fan[:, ::-1], fan + count, sides))


def pose_covariance(fit: ShapeFit) -> np.ndarray:
    """Return the covariance of the fit's pose, (6, 6), in the order of geometry_msgs/PoseWithCovariance.

    Place x, y, z, then rotations about x, y, z: the contact lies in the pad's plane, so those of z and of the
    rotations about x and y are 0. The angle of a circle is undefined: it has the variance π²/3 of a uniform one.
    """
    covariance = np.zeros((6, 6))
    kept = [0, 1, 5] if fit.symmetry else [0, 1]
    covariance[np.ix_(kept, kept)] = fit.covariance[:len(kept), :len(kept)]
    if not fit.symmetry:
        covariance[5, 5] = np.pi**2 / 3
    return covariance
