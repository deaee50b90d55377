"""Distance of points from a convex polygon, and how much of each taxel it covers."""

import numpy as np


def distance_inside(vertices: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Signed distance of points from the edges of a convex polygon, positive inside.

    ``vertices``: (n, 2), in the sense from x to y. Outside and beyond a corner it is the distance from
    the nearer edge's line, which is less than the true one.
    """
    edge = np.roll(vertices, -1, axis=0) - vertices
    normal = np.column_stack((-edge[:, 1], edge[:, 0])) / np.hypot(*edge.T)[:, np.newaxis]  # inwards
    offset = (normal * vertices).sum(1)
    return (normal[:, 0, None, None] * x + normal[:, 1, None, None] * y - offset[:, None, None]).min(0)
