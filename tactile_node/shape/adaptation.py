"""An adaptation of the recogniser's probabilities to one skin, and the arrays that hold it in a model file.

`tactile assess` fits the adaptation to a few touches (tactile_node/learning/assess.py). A temperature divides the
logarithm of each probability; above 1 it makes the recogniser less sure. A linear function of the network's embedding
is added, because a skin may make one shape look like another. The networks and the heads of taught shapes stay as they
are.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from tactile_node.taxel_frame import read_only

ADAPTATION_VERSION = 1
ADAPTATION_MARK = '_skin_'  #: part of the names of these arrays in a file
LEAST_PROBABILITY = 1e-6    #: lower bound of a probability: no class is ruled out for ever
LARGEST_NUMBER = 100.0      #: upper bound of a temperature and of each magnitude, far more than touches show


class Adaptation(NamedTuple):
    """Adaptation of N outputs for one kind of frames, with embeddings of F numbers."""

    temperature: float
    biases: np.ndarray   #: (N,)
    weights: np.ndarray  #: (F, N)

    def applied(self, probabilities: np.ndarray, embedding: np.ndarray) -> np.ndarray:
        """Return the adapted probabilities, (K, N), of ``probabilities`` (K, N) and ``embedding`` (K, F).

        >>> Adaptation(2.0, np.zeros(2), np.zeros((1, 2))).applied(np.array([[0.9, 0.1]]), np.ones((1, 1))).round(4)
        array([[0.75, 0.25]])
        """
        logits = np.log(np.maximum(probabilities, LEAST_PROBABILITY)) / self.temperature
        logits += self.biases + embedding @ self.weights
        odds = np.exp(logits - logits.max(1, keepdims=True))
        adapted: np.ndarray = odds / odds.sum(1, keepdims=True)
        return adapted


def read_adaptations(data: Mapping[str, np.ndarray], outputs: int, widths: Mapping[str, int]) -> dict[str, Adaptation]:
    """Return the adaptations in the arrays of a model file by kind of frames, or none if the file has none.

    ``widths``: number of columns of the embedding of each kind. Raises ValueError or KeyError if the arrays are not
    those that `tactile assess` writes.
    """
    return {kind: _adaptation(data, kind, outputs, width) for kind, width in widths.items()
            if any(name.startswith(f'{kind}{ADAPTATION_MARK}') for name in data)}


def _adaptation(data: Mapping[str, np.ndarray], kind: str, outputs: int, width: int) -> Adaptation:
    version = data[f'{kind}{ADAPTATION_MARK}version']
    if version.shape != () or version.dtype.kind not in 'iu' or version != ADAPTATION_VERSION:
        raise ValueError(f'an adaptation to a skin of version {version}, not {ADAPTATION_VERSION}')
    arrays = [data[f'{kind}{ADAPTATION_MARK}{part}'] for part in Adaptation._fields]
    shapes = [array.shape for array in arrays]
    if shapes != [(), (outputs,), (width, outputs)] or any(array.dtype.kind != 'f' for array in arrays):
        raise ValueError(f'an adaptation to a skin that does not fit {outputs} outputs and {kind} frames')
    temperature, biases, weights = (read_only(array.astype(float)) for array in arrays)
    if temperature < 1 / LARGEST_NUMBER or any(np.abs(each).max() > LARGEST_NUMBER
                                               for each in (temperature, biases, weights)):
        raise ValueError('an adaptation to a skin with numbers out of their range')
    return Adaptation(float(temperature), biases, weights)


def arrays_of(kind: str, adaptation: Adaptation) -> dict[str, np.ndarray]:
    """Return the arrays that `read_adaptations` reads."""
    named = {'version': ADAPTATION_VERSION, **adaptation._asdict()}
    return {f'{kind}{ADAPTATION_MARK}{part}': np.asarray(value) for part, value in named.items()}


def is_of_skin(name: str) -> bool:
    """Return True if the array of this name is part of the adaptation to a skin."""
    return ADAPTATION_MARK in name
