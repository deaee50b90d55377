"""Shares with their confidence, and where the tree of planes goes wrong."""

from typing import NamedTuple

import numpy as np

from tactile_node.shape.volf import ANSWERS

Z95 = 1.959963984540054  #: normal quantile of a two-sided 95 % interval
PLANE_OF = np.array([1, 1, 2, 3, 3])  #: the plane whose curve decides for each of ANSWERS


class Rate(NamedTuple):
    """A share of patterns with its Wilson 95 % interval."""

    share: float
    low: float
    high: float
    patterns: int


def rate(right: np.ndarray) -> Rate:
    """Return the share of True in ``right``, bool, shape (n,), n > 0.

    Interval: E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209.
    """
    n, share = len(right), float(np.mean(right))
    middle = (share + Z95 ** 2 / (2 * n)) / (1 + Z95 ** 2 / n)
    half = Z95 / (1 + Z95 ** 2 / n) * np.sqrt(share * (1 - share) / n + Z95 ** 2 / (4 * n * n))
    return Rate(share, float(middle - half), float(middle + half), n)


def lost_in_plane(answer: np.ndarray, labels: np.ndarray) -> dict[int, float]:
    """Share of all patterns that each of the planes 1, 2, 3 is the first to send the wrong way."""
    first = PLANE_OF[np.minimum(answer, labels)]
    return {plane: float(np.mean((answer != labels) & (first == plane))) for plane in (1, 2, 3)}


def confusion(answer: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Share of each class (row) that gets each answer (column), shape (5, 5), in the order of ANSWERS."""
    counts = np.zeros((len(ANSWERS), len(ANSWERS)))
    np.add.at(counts, (labels, answer), 1)
    return counts / np.maximum(counts.sum(1, keepdims=True), 1)
