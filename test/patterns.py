"""Patterns of taxels that many numerical tests share."""

import numpy as np
from scipy import ndimage

from tactile_node.helmholtz.rotation import with_rotated
from tactile_node.simulator.world import CLASSES
from training.ground_truth.seeds import Purpose, generator, random_pattern

ROWS, COLS = np.mgrid[:16, :16]
L_OF_THREE = np.array([[True, False], [True, True]])


def rotated_patterns(mask: np.ndarray) -> np.ndarray:
    """Return the pattern at each of the 46 angles, without the surrounding ring of inactive taxels."""
    return with_rotated(mask)[1:, 1:-1, 1:-1]


def box(row: int, col: int, rows: int, cols: int) -> np.ndarray:
    """Return the mask of a rectangle on a pad of 16x16 taxels."""
    return (ROWS >= row) & (ROWS < row + rows) & (COLS >= col) & (COLS < col + cols)


def ring(rows: int = 12, inner: float = 3.3, outer: float = 5.5) -> np.ndarray:
    y, x = np.indices((rows, rows)) - (rows - 1) / 2
    return (np.hypot(x, y) < outer) & (np.hypot(x, y) > inner)


def specks(seed: int) -> np.ndarray:
    """Return a random, disconnected pattern with single taxels and holes."""
    rng = np.random.default_rng(seed)
    mask = rng.random(rng.integers(1, 10, 2)) < rng.uniform(0.2, 0.8)
    mask.flat[rng.integers(mask.size)] = True
    return mask


def blob(seed: int) -> np.ndarray:
    """Return a pattern that consists of a few smooth islands."""
    noise = np.random.default_rng(seed).random((11, 11))
    return ndimage.gaussian_filter(noise, 1.0) > 0.5


def shapes(area: float) -> list[np.ndarray]:
    rng = generator(Purpose.TEST, 1)
    return [random_pattern(rng, shape, area) for shape in CLASSES]


def assorted() -> dict[str, np.ndarray]:
    """Return one pattern for each known special case."""
    named = {'one taxel': np.ones((1, 1), bool), 'row': np.ones((1, 20), bool),
             'column': np.ones((15, 1), bool),
             'diagonal': np.eye(9, dtype=bool), 'two apart': np.array([[True, False, False, True]]),
             'ring': ring(), 'rectangle': np.ones((5, 8), bool), 'L': L_OF_THREE,
             'dumbbell': np.pad(np.ones((3, 3), bool), ((0, 0), (0, 7))) | np.pad(
                 np.ones((3, 3), bool), ((0, 0), (7, 0))) | (
                     np.arange(3) == 1)[:, None] & np.ones((3, 10), bool)}
    return (named | {f'specks {seed}': specks(seed) for seed in range(12)}
            | {f'blob {seed}': blob(seed) for seed in range(4)}
            | {f'shape {i}': mask for i, mask in enumerate(shapes(30))})


def cropped(mask: np.ndarray) -> np.ndarray:
    rows, cols = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    return mask[rows[0]:rows[-1] + 1, cols[0]:cols[-1] + 1] if len(rows) else np.zeros((0, 0), bool)
