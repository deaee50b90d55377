"""Measure an untouched pad: noise, zero, drift, frame rate and lost frames."""

from typing import NamedTuple

import numpy as np

from tactile_node.commissioning.measurement import NOT_MEASURED, Estimate, mean_of
from tactile_node.commissioning.recording import PadFrames

BLOCKS = 10         #: Number of parts of the recording from whose means the drift is computed.
LEAST_FRAMES = 100  #: Smallest number of frames with values.
TOUCH_TIME = 1.0    #: Time within which a touch changes the taxels, and drift does not [s].
TOUCH_STEP = 0.02   #: Smallest change of a taxel in a touch [N].
TOUCH_NOISES = 10   #: The same, in standard deviations of the noise.
TOUCHED_TAXELS = 3  #: Smallest number of taxels that a touch changes at the same time.


class PadRest(NamedTuple):
    """Properties of an untouched pad."""

    noise: Estimate      #: standard deviation of a taxel [N]
    drift: Estimate      #: change of the mean zero of a taxel [N/s]
    rate: float          #: frames per second, including lost frames
    lost: float          #: share of frames that were lost or had no value
    zero: np.ndarray     #: mean reading of each taxel, (rows, cols) [N]


def measure_rest(frames: PadFrames) -> PadRest | None:
    """Return the properties of an untouched pad, or None for fewer than LEAST_FRAMES frames with values."""
    count = len(frames.times)
    zero = frames.mean
    forces = frames.forces.reshape(count, -1)[:, np.isfinite(zero).ravel()]
    is_known = np.isfinite(forces).any(1)  # a frame may arrive without any value
    if np.count_nonzero(is_known) < LEAST_FRAMES:
        return None
    each = np.nanstd(np.diff(forces[is_known], axis=0), axis=0) / np.sqrt(2)  # differences contain no drift
    alive = each[each > 0]
    noise = Estimate(float(np.sqrt(np.mean(alive ** 2))), float(np.std(alive, ddof=1) / np.sqrt(alive.size))) \
        if alive.size > 1 else NOT_MEASURED
    sent = int(frames.sequences[-1] - frames.sequences[0]) + 1
    drift = _drift(frames.times[is_known], np.nanmean(forces[is_known][:, each > 0], axis=1)) \
        if alive.size else NOT_MEASURED
    return PadRest(noise, drift, frames.rate, 1 - np.count_nonzero(is_known) / sent, zero)


def was_touched(frames: PadFrames) -> bool:
    """Return True if several taxels have changed at once by more than noise and drift explain.

    The result is False for fewer than LEAST_FRAMES complete frames.
    """
    forces = frames.forces[:, np.isfinite(frames.mean)]
    forces = forces[np.isfinite(forces).all(1)]  # complete frames
    if len(forces) < LEAST_FRAMES:
        return False
    gap = max(round(TOUCH_TIME * frames.rate), 1)
    # median of the differences of two frames, which a short touch does not change: 0.95 standard deviations
    noise = np.median(np.abs(np.diff(forces, axis=0)), axis=0) / 0.95
    is_changed = np.abs(forces[gap:] - forces[:-gap]) > np.maximum(TOUCH_STEP, TOUCH_NOISES * noise)
    return bool((np.count_nonzero(is_changed, axis=1) >= TOUCHED_TAXELS).any())


def _drift(times: np.ndarray, means: np.ndarray) -> Estimate:
    """Return the mean of the slopes between parts that lie half of the recording apart."""
    parts = [slice(*pair) for pair in zip(*(np.linspace(0, len(times), BLOCKS + 1).astype(int)[k:] for k in (0, 1)))]
    at, level = (np.array([of[part].mean() for part in parts]) for of in (times, means))
    half = BLOCKS // 2
    return mean_of((level[half:] - level[:half]) / (at[half:] - at[:half]))
