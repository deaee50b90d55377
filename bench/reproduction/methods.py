"""What is compared: ways to recognise, at each size, beside the published figures, and where they go wrong."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from bench.recognition.figures import rate_of
from tactile_node.learning.teach import Rate
from tactile_node.shape.volf import ANSWERS, VolfClassifier
from training.curve_fitting import COLUMNS, READINGS, Samples, answers, fit_classifier

SIZES = (15, 20, 25, 30, 35, 50, 75, 100)  #: N [taxels] at which recognition is measured
PLANE_OF = np.array([1, 1, 2, 3, 3])  #: the plane whose curve decides for each of ANSWERS
NEIGHBOURS = (5, 11, 21, 41)
PUBLISHED = {20: 'about 70 %', 35: 'more than 90 %', 100: 'about 99.9 %'}


class Method(NamedTuple):
    """A way to recognise, and what it reached at each of SIZES."""

    name: str
    rates: dict[int, Rate]


def published_share(size: int) -> float:
    """Return the figure of PUBLISHED as a share: 'more than 90 %' is 0.9."""
    return float(PUBLISHED[size].rstrip(' %').split()[-1]) / 100


def best_fit(training: Samples) -> VolfClassifier:
    """Fit both readings of the third plane; return the one that is better in training."""
    fits = [fit_classifier(training, third) for third in READINGS.values()]
    return max(fits, key=lambda fit: np.mean(answers(fit.planes, training) == training.labels))


def measured(name: str, classifier: VolfClassifier, evaluation: Mapping[int, Samples]) -> Method:
    """Return what the curves of ``classifier`` reach on fresh patterns by size."""
    return Method(name, {size: rate_of(answers(classifier.planes, samples) == samples.labels)
                         for size, samples in evaluation.items()})


def lost_in_plane(answer: np.ndarray, labels: np.ndarray) -> dict[int, float]:
    """Share of all patterns that each of the planes 1, 2, 3 is the first to send the wrong way."""
    first = PLANE_OF[np.minimum(answer, labels)]
    return {plane: float(np.mean((answer != labels) & (first == plane))) for plane in (1, 2, 3)}


def confusion(answer: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Share of each class (row) that gets each answer (column), shape (5, 5), in the order of ANSWERS."""
    counts = np.zeros((len(ANSWERS), len(ANSWERS)))
    np.add.at(counts, (labels, answer), 1)
    return counts / np.maximum(counts.sum(1, keepdims=True), 1)


class NearestNeighbours:
    """A learner on the same six features, to separate what they hold from what three planes make of it.

    Majority of the nearest training patterns; logarithms of the features, each of unit variance.
    """

    def __init__(self, training: Samples, validation: Samples):
        raw = _logarithms(training)
        self._middle, self._spread = raw.mean(0), raw.std(0)
        self._tree, self._labels = cKDTree((raw - self._middle) / self._spread), training.labels
        self.number = max(NEIGHBOURS, key=lambda number: np.mean(
            self.answers(validation, number) == validation.labels))

    def answers(self, samples: Samples, number: int | None = None) -> np.ndarray:
        """Index into ANSWERS of each pattern, shape (n,)."""
        _, nearest = self._tree.query((_logarithms(samples) - self._middle) / self._spread, number or self.number)
        votes = np.zeros((len(nearest), len(ANSWERS)))
        np.add.at(votes, (np.arange(len(nearest))[:, np.newaxis], self._labels[nearest]), 1)
        return votes.argmax(1)


def _logarithms(samples: Samples) -> np.ndarray:
    return np.log(0.05 + np.column_stack([samples.of(column) for column in COLUMNS]))
