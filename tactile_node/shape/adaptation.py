"""How the probabilities of the recogniser change for one skin, and how that is read from a model file.

`tactile assess` finds it from a few touches (tactile_node/learning/assess.py): the logarithm of each probability is
divided by a temperature, which is larger than 1 if the recogniser is too sure on this skin, and a class that the skin
makes too likely has a negative bias. The networks and taught shapes stay as they are.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from tactile_node.taxel_frame import read_only

ADAPTATION_VERSION = 1
ADAPTATION_PREFIX = 'skin_'     #: of the names of the arrays in a file
LEAST_PROBABILITY = 1e-6        #: a lower probability counts as this one: a class is never ruled out for ever
LARGEST_NUMBER = 20.0           #: of a temperature and of a bias, far more than touches show


class Adaptation(NamedTuple):
    """Temperature and biases for one skin."""

    temperature: float
    biases: np.ndarray  #: (N,), one for each output of the recogniser

    def applied(self, probabilities: np.ndarray) -> np.ndarray:
        """Return the adapted probabilities, (K, N).

        >>> Adaptation(2.0, np.zeros(2)).applied(np.array([[0.9, 0.1]])).round(4).tolist()
        [[0.75, 0.25]]
        """
        logits = np.log(np.maximum(probabilities, LEAST_PROBABILITY)) / self.temperature + self.biases
        odds = np.exp(logits - logits.max(1, keepdims=True))
        adapted: np.ndarray = odds / odds.sum(1, keepdims=True)
        return adapted


def read_adaptation(data: Mapping[str, np.ndarray], outputs: int) -> Adaptation | None:
    """Return the adaptation in the arrays of a model file, None if there is none.

    Raises ValueError or KeyError where its arrays are not those that `tactile assess` writes.
    """
    if not any(map(is_of_skin, data)):
        return None
    version, temperature, biases = (data[f'{ADAPTATION_PREFIX}{name}'] for name in ('version', 'temperature', 'biases'))
    if version.shape != () or version.dtype.kind not in 'iu' or version != ADAPTATION_VERSION:
        raise ValueError(f'an adaptation to a skin of version {version}, not {ADAPTATION_VERSION}')
    if temperature.dtype.kind != 'f' or temperature.shape != () or not 0 < temperature <= LARGEST_NUMBER:
        raise ValueError(f'a temperature of the skin that is not within 0 and {LARGEST_NUMBER:g}')
    if biases.dtype.kind != 'f' or biases.shape != (outputs,) or not (np.abs(biases) <= LARGEST_NUMBER).all():
        raise ValueError(f'biases of the skin that are not {outputs} numbers up to {LARGEST_NUMBER:g}')
    return Adaptation(float(temperature), read_only(biases.astype(float)))


def arrays_of(adaptation: Adaptation) -> dict[str, np.ndarray]:
    """Return the arrays that `read_adaptation` reads."""
    return {f'{ADAPTATION_PREFIX}version': np.array(ADAPTATION_VERSION),
            f'{ADAPTATION_PREFIX}temperature': np.array(adaptation.temperature),
            f'{ADAPTATION_PREFIX}biases': adaptation.biases}


def is_of_skin(name: str) -> bool:
    """Return True if the array of this name is part of the adaptation to a skin."""
    return name.startswith(ADAPTATION_PREFIX)
