"""Provide independent random streams for training and benchmarks, and random patterns."""

from enum import IntEnum

import numpy as np

from tactile_node.simulator.world import PAD, random_contact


class Purpose(IntEnum):
    """Purpose of a random stream.

    Each purpose has a separate stream for every seed, so the numbers must never change.
    """

    TRAINING = 1
    VALIDATION = 2
    EVALUATION = 3
    DEMO = 4
    TEST = 5


def generator(purpose: Purpose, seed: int) -> np.random.Generator:
    """Return the generator for a purpose and a seed. Two different pairs never share a stream."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(int(purpose),)))


def random_pattern(rng: np.random.Generator, shape: str, area: float) -> np.ndarray:
    """Draw the on/off pattern of a contact in general position, on a pad that is large enough for it."""
    room = max(PAD, int(np.ceil(4 * np.sqrt(area))) + 4)
    return random_contact(rng, shape, area, rows=room, cols=room).pattern(room, room)
