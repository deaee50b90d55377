"""Signed distance from a convex polygon, positive inside; and how it changes as the polygon moves.

Outside and beyond a corner it is the distance from the nearer edge's line, which is less than the true one.
"""

from typing import NamedTuple

import numpy as np


class Edges(NamedTuple):
    """The edges of a convex polygon, edge i from corner i to the next; corners in the sense from x to y."""

    along: np.ndarray    #: unit vectors, (n, 2)
    outward: np.ndarray  #: unit normals, (n, 2)
    length: np.ndarray   #: (n, 1)
    offset: np.ndarray   #: of the edge's line from the origin along its normal, (n, 1)


def edges_of(corners: np.ndarray) -> Edges:
    """Return the edges between ``corners``, (n, 2)."""
    edge = corners[_following(corners)] - corners
    length = np.sqrt((edge**2).sum(1, keepdims=True))
    along = edge / length
    outward = along[:, ::-1] * (1.0, -1.0)
    return Edges(along, outward, length, (outward * corners).sum(1, keepdims=True))


def depth_inside(corners: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the signed distance of the points ``x``, ``y`` (any shape, the same) from the polygon's edges.

    >>> square = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    >>> depth_inside(square, np.array([1.0, 5.0]), np.array([2.0, 2.0])).tolist()
    [1.0, -1.0]
    """
    edges = edges_of(corners)
    depths = [offset - (outward[0] * x + outward[1] * y) for outward, (offset,) in zip(edges.outward, edges.offset)]
    nearest: np.ndarray = np.minimum.reduce(depths)
    return nearest


def moving_depth(corners: np.ndarray, motions: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the signed distance of ``places``, (2, m), and its derivatives; shapes (m,) and (p, m).

    ``motions``: (p, n, 2), d corners / d parameter.
    """
    edges = edges_of(corners)
    depth = edges.offset - edges.outward @ places
    nearest = depth.argmin(0)
    each = np.arange(len(nearest))
    start = (edges.along * corners).sum(1, keepdims=True)
    t = ((edges.along @ places - start) / edges.length)[nearest, each]
    at_start = (motions * edges.outward).sum(-1)[:, nearest]
    at_stop = (motions[:, _following(corners)] * edges.outward).sum(-1)[:, nearest]
    return depth[nearest, each], at_start + (at_stop - at_start) * t


def _following(corners: np.ndarray) -> np.ndarray:
    return np.arange(1, len(corners) + 1) % len(corners)
