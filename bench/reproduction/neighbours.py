"""A learner on the same six features, to separate what they hold from what three planes make of it."""

import numpy as np
from scipy.spatial import cKDTree

from tactile_node.shape.volf import ANSWERS
from tactile_node.teaching.curve_fitting import COLUMNS, Samples

NUMBERS = (5, 11, 21, 41)


class NearestNeighbours:
    """Majority of the nearest training patterns; logarithms of the features, each of unit variance."""

    def __init__(self, training: Samples, validation: Samples):
        raw = _logarithms(training)
        self._middle, self._spread = raw.mean(0), raw.std(0)
        self._tree, self._labels = cKDTree((raw - self._middle) / self._spread), training.labels
        self.number = max(NUMBERS, key=lambda number: np.mean(
            self.answers(validation, number) == validation.labels))

    def answers(self, samples: Samples, number: int | None = None) -> np.ndarray:
        """Index into ANSWERS of each pattern, shape (n,)."""
        _, nearest = self._tree.query((_logarithms(samples) - self._middle) / self._spread, number or self.number)
        votes = np.zeros((len(nearest), len(ANSWERS)))
        np.add.at(votes, (np.arange(len(nearest))[:, np.newaxis], self._labels[nearest]), 1)
        return votes.argmax(1)


def _logarithms(samples: Samples) -> np.ndarray:
    return np.log(0.05 + np.column_stack([samples.of(column) for column in COLUMNS]))
