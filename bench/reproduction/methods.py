"""Methods that are compared with the published rates at each size, and measures of their errors."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from bench.recognition.figures import rate_of
from tactile_node.learning.teach import Rate
from tactile_node.shape.volf import ANSWERS, VolfClassifier
from training.curve_fitting import COLUMNS, READINGS, Samples, answers, fit_classifier

SIZES = (15, 20, 25, 30, 35, 50, 75, 100)  #: values of N at which recognition is measured [taxels]
PLANE_OF = np.array([1, 1, 2, 3, 3])  #: plane that decides on each of ANSWERS
NEIGHBOURS = (5, 11, 21, 41)
PUBLISHED = {20: 'about 70 %', 35: 'more than 90 %', 100: 'about 99.9 %'}


class Method(NamedTuple):
    """A method with its recognition rate at each of SIZES."""

    name: str
    rates: dict[int, Rate]


def published_share(size: int) -> float:
    """Return the published rate as a number, for example 0.9 for 'more than 90 %'."""
    return float(PUBLISHED[size].rstrip(' %').split()[-1]) / 100


def best_fit(training: Samples) -> VolfClassifier:
    """Fit both interpretations of the third plane, and return the classifier that is better in training."""
    fits = [fit_classifier(training, third) for third in READINGS.values()]
    return max(fits, key=lambda fit: np.mean(answers(fit.planes, training) == training.labels))


def measured(name: str, classifier: VolfClassifier, evaluation: Mapping[int, Samples]) -> Method:
    """Return the recognition rates of ``classifier`` on new patterns of each size."""
    return Method(name, {size: rate_of(answers(classifier.planes, samples) == samples.labels)
                         for size, samples in evaluation.items()})


def lost_in_plane(answer: np.ndarray, labels: np.ndarray) -> dict[int, float]:
    """For planes 1 to 3, return the share of all patterns in which the plane makes the first wrong decision."""
    first = PLANE_OF[np.minimum(answer, labels)]
    return {plane: float(np.mean((answer != labels) & (first == plane))) for plane in (1, 2, 3)}


def confusion(answer: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Return the share of each class (row) that gets each answer (column), in the order of ANSWERS."""
    counts = np.zeros((len(ANSWERS), len(ANSWERS)))
    np.add.at(counts, (labels, answer), 1)
    return counts / np.maximum(counts.sum(1, keepdims=True), 1)


class NearestNeighbours:
    """A learner on the same six features, which shows how much information the three planes leave unused.

    The learner gives the majority label of the nearest training patterns. Distances are measured between the logarithms
    of the features, each scaled to unit variance.
    """

    def __init__(self, training: Samples, validation: Samples):
        raw = _logarithms(training)
        self._middle, self._spread = raw.mean(0), raw.std(0)
        self._tree, self._labels = cKDTree((raw - self._middle) / self._spread), training.labels
        self.number = max(NEIGHBOURS, key=lambda number: np.mean(
            self.answers(validation, number) == validation.labels))

    def answers(self, samples: Samples, number: int | None = None) -> np.ndarray:
        """Return an index into ANSWERS for each pattern."""
        _, nearest = self._tree.query((_logarithms(samples) - self._middle) / self._spread, number or self.number)
        votes = np.zeros((len(nearest), len(ANSWERS)))
        np.add.at(votes, (np.arange(len(nearest))[:, np.newaxis], self._labels[nearest]), 1)
        return votes.argmax(1)


def _logarithms(samples: Samples) -> np.ndarray:
    return np.log(0.05 + np.column_stack([samples.of(column) for column in COLUMNS]))
