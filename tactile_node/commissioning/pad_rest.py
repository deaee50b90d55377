"""Measure an untouched pad: noise, zero, drift, frame rate and lost frames."""

from typing import NamedTuple

import numpy as np

from tactile_node.commissioning.measurement import NOT_MEASURED, Estimate, mean_of
from tactile_node.commissioning.recording import PadFrames

BLOCKS = 10         #: Number of parts of the recording from whose means the drift is computed.
LEAST_FRAMES = 100  #: Smallest number of frames.


class PadRest(NamedTuple):
    """Properties of an untouched pad."""

    noise: Estimate      #: standard deviation of a taxel [N]
    drift: Estimate      #: change of the mean zero of a taxel [N/s]
    rate: float          #: frames per second, including lost frames
    lost: float          #: share of lost frames
    zero: np.ndarray     #: mean reading of each taxel, (rows, cols) [N]


def measure_rest(frames: PadFrames) -> PadRest | None:
    """Return the properties of an untouched pad, or None for fewer than LEAST_FRAMES frames."""
    count = len(frames.times)
    if count < LEAST_FRAMES:
        return None
    forces = frames.forces.reshape(count, -1)
    each = np.diff(forces, axis=0).std(0) / np.sqrt(2)  # differences contain no drift
    alive = each[each > 0]
    noise = Estimate(float(np.sqrt(np.mean(alive ** 2))), float(np.std(alive, ddof=1) / np.sqrt(alive.size))) \
        if alive.size > 1 else NOT_MEASURED
    sent = int(frames.sequences[-1] - frames.sequences[0]) + 1
    seconds = float(frames.times[-1] - frames.times[0])
    return PadRest(noise, _drift(frames.times, np.nanmean(forces[:, each > 0], axis=1)), (sent - 1) / seconds,
                   1 - count / sent, np.nanmean(frames.forces, axis=0))


def _drift(times: np.ndarray, means: np.ndarray) -> Estimate:
    """Return the mean of the slopes between parts that lie half of the recording apart."""
    parts = [slice(*pair) for pair in zip(*(np.linspace(0, len(times), BLOCKS + 1).astype(int)[k:] for k in (0, 1)))]
    at, level = (np.array([of[part].mean() for part in parts]) for of in (times, means))
    half = BLOCKS // 2
    return mean_of((level[half:] - level[:half]) / (at[half:] - at[:half]))
