"""How the probabilities of the recogniser change for one skin, and how that is read from a model file.

`tactile assess` finds it from a few touches (tactile_node/learning/assess.py). The logarithm of each probability is
divided by a temperature, which is larger than 1 if the recogniser is too sure on this skin. Then it is raised by a
linear function of the network's embedding, which corrects what the skin makes look like something else. The networks
and the heads of taught shapes stay as they are.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from tactile_node.taxel_frame import read_only

ADAPTATION_VERSION = 1
ADAPTATION_MARK = '_skin_'      #: in the names of the arrays in a file
LEAST_PROBABILITY = 1e-6        #: a lower probability counts as this one: a class is never ruled out for ever
OUTLIER_LIMIT = 3.0             #: standard numbers beyond are outliers: no touch has shown what they mean
LARGEST_NUMBER = 100.0          #: of a temperature, a bias and a weight, far more than touches show


class Adaptation(NamedTuple):
    """Adaptation of N outputs for one kind of frames, with embeddings of F numbers."""

    temperature: np.ndarray  #: ()
    biases: np.ndarray       #: (N,)
    weights: np.ndarray      #: (F, N)
    middle: np.ndarray       #: (F,) and
    spread: np.ndarray       #: (F,): the embedding is used as (embedding - middle) / spread

    def applied(self, probabilities: np.ndarray, embedding: np.ndarray) -> np.ndarray:
        """Return the adapted probabilities, (K, N).

        >>> nothing = np.zeros((0, 2)), np.zeros(0), np.ones(0)
        >>> Adaptation(np.array(2.0), np.zeros(2), *nothing).applied(np.array([[0.9, 0.1]]), np.zeros((1, 0))).round(4)
        array([[0.75, 0.25]])
        """
        logits = np.log(np.maximum(probabilities, LEAST_PROBABILITY)) / self.temperature
        logits += self.biases + self.standard(embedding) @ self.weights
        odds = np.exp(logits - logits.max(1, keepdims=True))
        adapted: np.ndarray = odds / odds.sum(1, keepdims=True)
        return adapted

    def standard(self, embedding: np.ndarray) -> np.ndarray:
        """Return (embedding - middle) / spread, (K, F), outliers within OUTLIER_LIMIT."""
        return np.clip((embedding - self.middle) / self.spread, -OUTLIER_LIMIT, OUTLIER_LIMIT)


def read_adaptations(data: Mapping[str, np.ndarray], outputs: int, widths: Mapping[str, int]) -> dict[str, Adaptation]:
    """Return the adaptations in the arrays of a model file by kind of frames, none of a file without.

    ``widths``: of the embedding of each kind. Raises ValueError or KeyError where the arrays are not those that
    `tactile assess` writes.
    """
    return {kind: _adaptation(data, kind, outputs, width) for kind, width in widths.items()
            if any(name.startswith(f'{kind}{ADAPTATION_MARK}') for name in data)}


def _adaptation(data: Mapping[str, np.ndarray], kind: str, outputs: int, width: int) -> Adaptation:
    version = data[f'{kind}{ADAPTATION_MARK}version']
    if version.shape != () or version.dtype.kind not in 'iu' or version != ADAPTATION_VERSION:
        raise ValueError(f'an adaptation to a skin of version {version}, not {ADAPTATION_VERSION}')
    arrays = [data[f'{kind}{ADAPTATION_MARK}{part}'] for part in Adaptation._fields]
    if [array.shape for array in arrays] != [(), (outputs,), (width, outputs), (width,), (width,)] or any(
            array.dtype.kind != 'f' for array in arrays):
        raise ValueError(f'an adaptation to a skin that does not fit {outputs} outputs and {kind} frames')
    found = Adaptation(*(read_only(array.astype(float)) for array in arrays))
    if not (0 < found.temperature <= LARGEST_NUMBER and (found.spread > 0).all()
            and all((np.abs(array) <= LARGEST_NUMBER).all() for array in (found.biases, found.weights))):
        raise ValueError('an adaptation to a skin with numbers out of their range')
    return found


def arrays_of(kind: str, adaptation: Adaptation) -> dict[str, np.ndarray]:
    """Return the arrays that `read_adaptations` reads."""
    named = {'version': np.array(ADAPTATION_VERSION), **adaptation._asdict()}
    return {f'{kind}{ADAPTATION_MARK}{part}': array for part, array in named.items()}


def is_of_skin(name: str) -> bool:
    """Return True if the array of this name is part of the adaptation to a skin."""
    return ADAPTATION_MARK in name
