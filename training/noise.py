"""Draw frames of a pad that nothing presses: salt noise, hum, lines, ragged clusters and idle counts.

In these frames, the groups of taxels above the threshold have no shape.
"""

import numpy as np
from scipy import ndimage

from training.patches import samples_of
from training.samples import UNKNOWN, Samples

PAD = 36
LEAST = 9  #: Smallest number of taxels in a sample. A smaller ragged group often comes from a small contact.


def draw_noise(rng: np.random.Generator, count: int, on_off: bool) -> Samples:
    """Draw about ``count`` samples with the label UNKNOWN, using all kinds of noise in turn."""
    kinds = (salt, lines, clusters, checks) if on_off else (salt, lines, clusters, checks, hum, idle, grain)
    drawn = [kinds[k % len(kinds)](rng) for k in range(count)]
    values = np.array(drawn, np.float32)
    if not on_off:
        values += rng.uniform(0, 0.05, count)[:, None, None] * rng.standard_normal(values.shape, np.float32)
    dead = rng.random(values.shape, np.float32) < np.where(rng.random(count) < 0.3, 0.05, 0)[:, None, None]
    press = np.full((count, 1, 1), 0.5) if on_off else rng.uniform(0.35, 0.65, (count, 1, 1))
    found = samples_of(rng, values, press, dead, np.full(count, UNKNOWN), graded=not on_off)
    large = np.exp(found.geometry[:, 0]) >= LEAST
    return Samples(*(array[large] for array in found))


def _window(rng) -> np.ndarray:
    """Return a part of the pad as a bool array. The rest of the pad is quiet."""
    window = np.zeros((PAD, PAD), bool)
    low = rng.integers(1, PAD // 2, 2)
    high = low + rng.integers(5, PAD // 2, 2)
    window[low[0]:high[0], low[1]:high[1]] = True
    return window


def salt(rng) -> np.ndarray:
    """Return a pattern in which 5 to 70 % of all taxels, chosen at random, are on."""
    return (rng.random((PAD, PAD)) < rng.uniform(0.05, 0.7)) & _window(rng)


def lines(rng) -> np.ndarray:
    """Return one to four rows or columns, one taxel wide, whole or broken."""
    frame = np.zeros((PAD, PAD))
    for _ in range(rng.integers(1, 5)):
        line = frame if rng.random() < 0.5 else frame.T
        low = rng.integers(1, PAD - 8)
        at = rng.integers(1, PAD - 1)
        length = rng.integers(6, PAD)
        line[at, low:min(low + length, PAD - 1)] = rng.random(len(line[at, low:min(low + length, PAD - 1)])) \
            < rng.uniform(0.6, 1.2)
    return frame


def clusters(rng) -> np.ndarray:
    """Return the part of filtered noise above a level, with random taxels removed."""
    noise = ndimage.gaussian_filter(rng.standard_normal((PAD, PAD)), rng.uniform(0.5, 1.5))
    return (noise > rng.uniform(0.3, 1.5) * noise.std()) & (rng.random((PAD, PAD)) < rng.uniform(0.6, 1.1)) \
        & _window(rng)


def checks(rng) -> np.ndarray:
    """Return a regular pattern: a checkerboard, stripes, or every second taxel."""
    y, x = np.indices((PAD, PAD))
    by, step = rng.integers(1, 4), rng.integers(2, 4)
    pattern = ((x // by + y // by) % 2 == 0, (x // by) % step == 0, (x % step == 0) & (y % 2 == 0))[rng.integers(3)]
    if rng.random() < 0.5:
        pattern = pattern.T
    return pattern & (rng.random((PAD, PAD)) < rng.uniform(0.85, 1.2)) & _window(rng)


def hum(rng) -> np.ndarray:
    """Return rows or columns whose values oscillate together, with noise."""
    wave = rng.standard_normal(PAD) if rng.random() < 0.5 else \
        np.sin(np.arange(PAD) * rng.uniform(0.3, 3) + rng.uniform(0, 6))
    frame = np.broadcast_to(np.abs(wave) / np.abs(wave).max(), (PAD, PAD)) \
        + rng.uniform(0, 0.4) * rng.standard_normal((PAD, PAD))
    return np.where(_window(rng), frame if rng.random() < 0.5 else frame.T, 0)


def idle(rng) -> np.ndarray:
    """Small counts."""
    return rng.binomial(2, rng.uniform(0.02, 0.4), (PAD, PAD)) / 2 * _window(rng)


def grain(rng) -> np.ndarray:
    """Return white or smooth sensor noise, relative to its largest values."""
    noise = rng.standard_normal((PAD, PAD))
    if rng.random() < 0.6:
        noise = ndimage.gaussian_filter(noise, rng.uniform(0.4, 1.5))
    return np.where(_window(rng), noise / np.sort(noise, axis=None)[-rng.integers(1, 40)], 0)
