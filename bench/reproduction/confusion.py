"""Where the tree of planes goes wrong."""

import numpy as np

from tactile_node.shape.volf import ANSWERS

PLANE_OF = np.array([1, 1, 2, 3, 3])  #: the plane whose curve decides for each of ANSWERS


def lost_in_plane(answer: np.ndarray, labels: np.ndarray) -> dict[int, float]:
    """Share of all patterns that each of the planes 1, 2, 3 is the first to send the wrong way."""
    first = PLANE_OF[np.minimum(answer, labels)]
    return {plane: float(np.mean((answer != labels) & (first == plane))) for plane in (1, 2, 3)}


def confusion(answer: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Share of each class (row) that gets each answer (column), shape (5, 5), in the order of ANSWERS."""
    counts = np.zeros((len(ANSWERS), len(ANSWERS)))
    np.add.at(counts, (labels, answer), 1)
    return counts / np.maximum(counts.sum(1, keepdims=True), 1)
