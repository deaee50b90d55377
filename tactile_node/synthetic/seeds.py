"""Random streams by purpose: what is trained on is never evaluated on, whatever the seed."""

from enum import IntEnum

import numpy as np


class Purpose(IntEnum):
    """Each purpose has its own stream for every seed; numbers are fixed for ever."""

    TRAINING = 1
    VALIDATION = 2
    EVALUATION = 3
    DEMO = 4
    TEST = 5


def generator(purpose: Purpose, seed: int) -> np.random.Generator:
    """Return the generator of ``purpose`` and ``seed``; two different pairs never share a stream."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(int(purpose),)))
