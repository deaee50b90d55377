"""Convert a fitted contact to a solid for planners, as a primitive or as a triangle mesh."""

import numpy as np

from tactile_node.pose.fit import ShapeFit
from tactile_node.shape.recognition import Shape


def solid(fit: ShapeFit, height: float) -> tuple[str, tuple[float, ...]] | None:
    """Return the primitive that stands on the contact, or None for a triangle (use `prism`).

    Parameters
    ----------
    fit : ShapeFit
        Pose and size of the contact.
    height : float
        Height of the primitive [m].

    Returns
    -------
    tuple or None
        'box' with (x, y, z), or 'cylinder' with (height, radius), in the frame of the fit's pose. The lengths are in
        the order of shape_msgs/SolidPrimitive [m].
    """
    if fit.shape is Shape.CIRCLE:
        return 'cylinder', (height, fit.dimensions[0])
    if fit.shape in (Shape.SQUARE, Shape.RECTANGLE):
        return 'box', (fit.dimensions[0], fit.dimensions[-1], height)
    return None


def prism(fit: ShapeFit, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices and triangles of a closed mesh that stands on the contact.

    Parameters
    ----------
    fit : ShapeFit
        Pose and size of the contact.
    height : float
        Height of the mesh [m].

    Returns
    -------
    vertices : np.ndarray
        Coordinates of the vertices in the pad frame, (2n, 3) [m], with z from 0 to ``height``.
    triangles : np.ndarray
        Indices of the vertices of each triangle, (4n - 4, 3), counter-clockwise as seen from outside.
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

    The order is x, y, z, then the rotations about x, y and z. The contact lies in the pad's plane, so the variances of
    z and of the rotations about x and y are 0. The angle of a circle is undefined, so its variance is π²/3, as for a
    uniform distribution.
    """
    covariance = np.zeros((6, 6))
    kept = [0, 1, 5] if fit.symmetry else [0, 1]
    covariance[np.ix_(kept, kept)] = fit.covariance[:len(kept), :len(kept)]
    if not fit.symmetry:
        covariance[5, 5] = np.pi**2 / 3
    return covariance
