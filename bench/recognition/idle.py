"""Draw sequences of frames from an untouched array."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.simulator.figures import coverage
from tactile_node.simulator.world import CLASSES, random_contact

RATE = 50.0   #: Frame rate of the sequences [1/s].
HELD = 50     #: Number of pressed frames before a contact is released.


class Idle(NamedTuple):
    """Frames of one pad, (frames, rows, cols), either bool or float in fractions of full scale."""

    frames: np.ndarray
    begin: int = 0   #: index of the first frame in which the pad is untouched


#: The arguments are the rng, the number of frames and the side of the square pad.
Draw = Callable[[np.random.Generator, int, int], Idle]


def _shape(frames: int, side: int) -> tuple[int, int, int]:
    return frames, side, side


def _noise(rng: np.random.Generator, shape: tuple[int, ...], low: float = 0.002, high: float = 0.02) -> np.ndarray:
    return rng.uniform(low, high) * rng.standard_normal(shape)


def _log_uniform(rng: np.random.Generator, low: float, high: float, size=None):
    return np.exp(rng.uniform(np.log(low), np.log(high), size))


def _graded(rng: np.random.Generator, active: np.ndarray) -> Idle:
    """Return an on/off pad in half of the cases, and otherwise a pad with equal or different random levels."""
    if rng.random() < 0.5:
        return Idle(active)
    own = rng.uniform(0.2, 1.0, active.shape[1:]) if rng.random() < 0.5 else rng.uniform(0.1, 1.0)
    return Idle(np.clip(active * own + _noise(rng, active.shape), 0, 1))


def gaussian(rng: np.random.Generator, frames: int, side: int) -> Idle:
    """Draw Gaussian noise of 0.05 to 50 % of full scale, cut off below 0 on half of the pads."""
    values = _log_uniform(rng, 0.0005, 0.5) * rng.standard_normal(_shape(frames, side))
    return Idle(np.maximum(values, 0) if rng.random() < 0.5 else values)


def counts(rng: np.random.Generator, frames: int, side: int) -> Idle:
    """Draw readings of 0, 1 or 2 counts, with random probabilities and a resolution of 8 to 16 bits."""
    full_scale = 2.0 ** rng.integers(8, 17) - 1
    return Idle(rng.choice(3, _shape(frames, side), p=rng.dirichlet((2, 1, 0.5))) / full_scale)


def drift(rng: np.random.Generator, frames: int, side: int) -> Idle:
    """Draw noise with an offset and gradients that each drift by up to 30 % of full scale."""
    time = np.arange(frames)[:, None, None] / RATE
    y, x = np.indices((side, side)) / (side - 1) - 0.5
    values = rng.uniform(0, 0.2) + _noise(rng, _shape(frames, side))
    for pattern in (np.ones_like(x), x, y, x * y, x * x - y * y):
        size, frequency = _log_uniform(rng, 0.005, 0.3), _log_uniform(rng, 0.05, 1.0)
        values += size * pattern * np.sin(2 * np.pi * (frequency * time + rng.random()))
    return Idle(values)


def hum(rng: np.random.Generator, frames: int, side: int) -> Idle:
    """Draw noise and hum, with the same frequency but different amplitudes and phases on the rows (or columns)."""
    time = np.arange(frames)[:, None] / RATE
    size = _log_uniform(rng, 0.01, 0.4) * rng.uniform(0, 1, side) ** rng.uniform(0, 4)
    phase = rng.uniform(0, 2 * np.pi) + rng.uniform(0, 2) * rng.uniform(-np.pi, np.pi, side)
    lines = size * np.sin(2 * np.pi * rng.uniform(0.5, 24.9) * time + phase)
    return _along_rows_or_columns(rng, lines[..., None] + _noise(rng, _shape(frames, side)))


def noisy_lines(rng: np.random.Generator, frames: int, side: int) -> Idle:
    """Draw one to three rows (or columns) with 5 to 100 times the noise of all other rows (or columns)."""
    values = _noise(rng, _shape(frames, side), 0.001, 0.01)
    values[:, rng.choice(side, rng.integers(1, 4), replace=False)] *= _log_uniform(rng, 5, 100)
    return _along_rows_or_columns(rng, values)


def _along_rows_or_columns(rng: np.random.Generator, values: np.ndarray) -> Idle:
    return Idle(values if rng.random() < 0.5 else np.swapaxes(values, 1, 2))


def stuck(rng: np.random.Generator, frames: int, side: int) -> Idle:
    """Draw stuck taxels, which are 0.5 to 12 % of all taxels and stay on permanently."""
    chosen = _chosen(rng, (side, side), _log_uniform(rng, 0.005, 0.12))
    return _graded(rng, np.broadcast_to(chosen, _shape(frames, side)))


def flickering(rng: np.random.Generator, frames: int, side: int) -> Idle:
    """Draw flickering taxels, 0.5 to 12 % of all taxels, with different rates and with duty cycles of up to 100 %."""
    chosen = _chosen(rng, (side, side), _log_uniform(rng, 0.005, 0.12))
    duty, stay = rng.uniform(0.1, 1.0, (side, side)), rng.uniform(0, 0.95, (side, side))
    on = np.empty(_shape(frames, side), bool)
    on[0] = rng.random((side, side)) < duty
    for k in range(1, frames):
        on[k] = np.where(rng.random((side, side)) < stay, on[k - 1], rng.random((side, side)) < duty)
    return _graded(rng, on & chosen)


def _chosen(rng: np.random.Generator, shape: tuple[int, ...], share: float) -> np.ndarray:
    """Choose a random ``share`` of the taxels, but at least one."""
    chosen = rng.random(shape) < share
    chosen[tuple(rng.integers(shape))] = True
    return chosen


def static_salt(rng: np.random.Generator, frames: int, side: int) -> Idle:
    """Draw 1 to 50 % of the taxels as active, the same taxels in all frames."""
    return _graded(rng, np.broadcast_to(rng.random((side, side)) < _log_uniform(rng, 0.01, 0.5), _shape(frames, side)))


def changing_salt(rng: np.random.Generator, frames: int, side: int) -> Idle:
    """Draw 1 to 50 % of the taxels as active, different taxels in each frame."""
    return _graded(rng, rng.random(_shape(frames, side)) < _log_uniform(rng, 0.01, 0.5))


def full_scale_salt(rng: np.random.Generator, frames: int, side: int) -> Idle:
    """Draw values up to full scale on 1 to 50 % of the taxels, either constant or different in each frame."""
    one = rng.random() < 0.5
    shape = _shape(1 if one else frames, side)
    salt = np.where(rng.random(shape) < _log_uniform(rng, 0.01, 0.5), rng.uniform(0, 1, shape), 0.0)
    return Idle(np.broadcast_to(salt, _shape(frames, side)))


def checkerboard(rng: np.random.Generator, frames: int, side: int) -> Idle:
    """Draw a checkerboard with fields one or two taxels wide, which is steady or inverts at a random period."""
    row, col = np.indices((side, side)) // rng.integers(1, 3)
    turned = np.arange(frames) // rng.choice((1, 5, 25, frames)) + rng.integers(2)
    return _graded(rng, (row + col + turned[:, None, None]) % 2 == 0)


def line(rng: np.random.Generator, frames: int, side: int) -> Idle:
    """Draw a line one taxel wide from edge to edge, along a row, a column, a diagonal or an oblique direction."""
    slope = rng.choice((0.0, 1.0, rng.uniform(0.05, 0.95)))
    begin = rng.uniform(0, side - 1) - slope * (side - 1) / 2
    active = np.arange(side)[:, None] == np.rint(begin + slope * np.arange(side))
    active = active if rng.random() < 0.5 else active[:, ::-1]
    active = active if rng.random() < 0.5 else active.T
    return _graded(rng, np.broadcast_to(active, _shape(frames, side)))


def leftover(rng: np.random.Generator, frames: int, side: int) -> Idle:
    """Draw a known contact that presses for a second and leaves 2 to 30 % of its taxels on after the release."""
    area = _log_uniform(rng, 0.06, 0.25) * side * side
    contact = random_contact(rng, CLASSES[rng.integers(len(CLASSES))], area, rows=side, cols=side)
    on_off = rng.random() < 0.5
    covered = contact.pattern(side, side).astype(float) if on_off else coverage(contact, side, side)
    left = covered * _left(rng, covered > 0.5, rng.uniform(0.02, 0.3))
    steady = np.concatenate((np.repeat(covered[None], HELD, 0), np.repeat(left[None], frames, 0)))
    if on_off:
        return Idle(steady > 0, HELD)
    level = rng.uniform(0.3, 0.8) * np.where(np.arange(len(steady)) < HELD, 1.0, rng.uniform(0.4, 1.0))
    return Idle(np.clip(level[:, None, None] * steady + _noise(rng, steady.shape), 0, 1), HELD)


def _left(rng: np.random.Generator, pressed: np.ndarray, share: float) -> np.ndarray:
    """Choose a ``share`` of the pressed taxels, scattered in half of the cases and clumped in the other half."""
    score = rng.random(pressed.shape)
    if rng.random() < 0.5:
        score = ndimage.gaussian_filter(rng.standard_normal(pressed.shape), 0.8)
    return pressed & (score >= np.quantile(score[pressed], 1 - share))


IDLE: dict[str, Draw] = {
    'Gaussian noise': gaussian, 'counts 0 to 2': counts, 'drift': drift, 'row and column hum': hum,
    'noisy rows and columns': noisy_lines, 'stuck taxels': stuck, 'flickering taxels': flickering,
    'salt, static': static_salt, 'salt, changing': changing_salt, 'salt, full scale': full_scale_salt,
    'checkerboard': checkerboard, 'line, edge to edge': line, 'leftover after a release': leftover}
