"""Adapt the recogniser's probabilities to one skin, and store the adaptation as arrays in a model file.

`tactile assess` fits the adaptation to a few touches (tactile_node/learning/assess.py). The adaptation has two parts:

- A temperature divides the logarithm of each probability. A temperature above 1 makes the recogniser less confident.
- A linear function of the network's embedding is added to the logarithms, because a skin may make one shape look like
  another.

The networks and the heads of taught shapes do not change. Without touches of unknown objects, an adaptation has not
seen how this skin shows objects of other shapes. Such an adaptation makes no name sure (`shape.methods`).
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from tactile_node.taxel_frame import read_only

ADAPTATION_VERSION = 3      #: Version of the adaptation's arrays in a file.
ADAPTATION_MARK = '_skin_'  #: Part of the name of each array that belongs to an adaptation.
LEAST_PROBABILITY = 1e-6    #: Lower limit of a probability, so that the adaptation can make every class likelier.

#: Upper limit of the temperature and of each coefficient's magnitude. Fitted values are far smaller.
LARGEST_NUMBER = 100.0


class Adaptation(NamedTuple):
    """Adaptation for N outputs and one kind of frame, with an embedding of F numbers."""

    temperature: float
    biases: np.ndarray   #: (N,)
    weights: np.ndarray  #: (F, N)
    makes_sure: bool     #: True if a name may be sure that is not sure without the adaptation

    def applied(self, probabilities: np.ndarray, embedding: np.ndarray) -> np.ndarray:
        """Return the adapted probabilities. A class with the probability 0, which is not recognised, keeps it.

        Parameters
        ----------
        probabilities : np.ndarray
            Probabilities without the adaptation, (K, N).
        embedding : np.ndarray
            Embedding of the contacts, (K, F).

        Returns
        -------
        np.ndarray
            Adapted probabilities, (K, N).

        Examples
        --------
        >>> adaptation = Adaptation(2.0, np.zeros(2), np.zeros((1, 2)), makes_sure=True)
        >>> adaptation.applied(np.array([[0.9, 0.1]]), np.ones((1, 1))).round(4)
        array([[0.75, 0.25]])
        """
        logits = logits_of(probabilities) / self.temperature
        logits += self.biases + embedding @ self.weights
        logits[probabilities == 0] = -np.inf
        odds = np.exp(logits - logits.max(1, keepdims=True))
        adapted: np.ndarray = odds / odds.sum(1, keepdims=True)
        return adapted


def logits_of(probabilities: np.ndarray) -> np.ndarray:
    """Return the logarithms of probabilities, to which an adaptation applies."""
    found: np.ndarray = np.log(np.maximum(probabilities, LEAST_PROBABILITY))
    return found


def read_adaptations(data: Mapping[str, np.ndarray], outputs: int, widths: Mapping[str, int]) -> dict[str, Adaptation]:
    """Return the adaptations in a model file by kind of frame.

    Parameters
    ----------
    data : Mapping[str, np.ndarray]
        Arrays of the file by name.
    outputs : int
        Number of outputs of the recogniser, including the taught shapes.
    widths : Mapping[str, int]
        Number of columns of the embedding for each kind of frame.

    Returns
    -------
    dict[str, Adaptation]
        The adaptations, or an empty dictionary if the file has none.

    Raises
    ------
    ValueError, KeyError
        Raised if the arrays differ from those that `tactile assess` writes.
    """
    return {kind: _adaptation(data, kind, outputs, width) for kind, width in widths.items()
            if any(name.startswith(f'{kind}{ADAPTATION_MARK}') for name in data)}


def _adaptation(data: Mapping[str, np.ndarray], kind: str, outputs: int, width: int) -> Adaptation:
    version = data[f'{kind}{ADAPTATION_MARK}version']
    if version.shape != () or version.dtype.kind not in 'iu' or version != ADAPTATION_VERSION:
        raise ValueError(f'an adaptation to a skin of version {version}, not {ADAPTATION_VERSION}')
    arrays = [data[f'{kind}{ADAPTATION_MARK}{part}'] for part in Adaptation._fields]
    shapes = [array.shape for array in arrays]
    if shapes != [(), (outputs,), (width, outputs), ()] or [array.dtype.kind for array in arrays] != [*'fffb']:
        raise ValueError(f'an adaptation to a skin that does not fit {outputs} outputs and {kind} frames')
    temperature, biases, weights = (read_only(array.astype(float)) for array in arrays[:3])
    if temperature < 1 / LARGEST_NUMBER or any(np.abs(each).max() > LARGEST_NUMBER
                                               for each in (temperature, biases, weights)):
        raise ValueError('an adaptation with numbers out of range')
    return Adaptation(float(temperature), biases, weights, bool(arrays[3]))


def arrays_of(kind: str, adaptation: Adaptation) -> dict[str, np.ndarray]:
    """Return the arrays of an adaptation for one kind of frame, in the form that `read_adaptations` reads."""
    named = {'version': ADAPTATION_VERSION, **adaptation._asdict()}
    return {f'{kind}{ADAPTATION_MARK}{part}': np.asarray(value) for part, value in named.items()}


def is_of_skin(name: str) -> bool:
    """Return True if the array with this name belongs to an adaptation to a skin."""
    return ADAPTATION_MARK in name
