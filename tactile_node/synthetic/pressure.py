"""Pressure frames of a synthetic contact: what a skin with pressure values would measure."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy import ndimage

from tactile_node.synthetic.world import PAD

SUBSAMPLES = 8  #: a taxel's coverage is counted on 8×8 points
HALF_DIAGONAL = 0.708  #: of a taxel [pitches]


class Touching(Protocol):
    """What can touch a pad."""

    @property
    def x(self) -> float: ...

    @property
    def y(self) -> float: ...

    @property
    def reach(self) -> float: ...

    def depth(self, x: np.ndarray, y: np.ndarray) -> np.ndarray: ...


@dataclass(frozen=True)
class Skin:
    """How a skin answers to pressure."""

    full_scale: float = 100_000.0  #: [Pa]
    blur: float = 0.0              #: standard deviation of the elastomer's spread [pitches]
    noise: float = 0.0             #: standard deviation [fraction of full scale]
    dead: float = 0.0              #: fraction of taxels without a valid value (NaN), drawn again for each frame


def coverage(contact: Touching, rows: int = PAD, cols: int = PAD) -> np.ndarray:
    """Return the fraction of each taxel's square that the contact covers, shape (rows, cols).

    Counted on points, not exact as `geometry.coverage`: what touches need not be a polygon (hollow, rounded, any
    outlier), and the committed weights and figures come from these very numbers.
    """
    covered, near = np.zeros((rows, cols)), _window(contact, rows, cols)
    y, x = np.indices((rows, cols))[(slice(None), *near)].astype(float)
    depth = contact.depth(x, y)
    part = (depth >= 0).astype(float)
    rim = np.abs(depth) < HALF_DIAGONAL  # only there a taxel can be covered in part
    step = (np.arange(SUBSAMPLES) + 0.5) / SUBSAMPLES - 0.5
    dy, dx = (offset.reshape(-1) for offset in np.meshgrid(step, step, indexing='ij'))
    part[rim] = (contact.depth(x[rim][:, None] + dx, y[rim][:, None] + dy) >= 0).mean(1)
    covered[near] = part
    return covered


def _window(contact: Touching, rows: int, cols: int) -> tuple[slice, slice]:
    """The part of the pad that the contact can touch."""
    low = np.floor(np.array([contact.y, contact.x]) - contact.reach).astype(int)
    high = np.ceil(np.array([contact.y, contact.x]) + contact.reach).astype(int) + 1
    return slice(*np.clip((low[0], high[0]), 0, rows)), slice(*np.clip((low[1], high[1]), 0, cols))


def pressure_frame(contact: Touching | None, rng: np.random.Generator, rows: int = PAD, cols: int = PAD, *,
                   pressure: float = 0.5, tilt: tuple[float, float] = (0.0, 0.0),
                   skin: Skin = Skin()) -> np.ndarray:
    """Return taxel values [Pa], float, shape (rows, cols); ``contact`` None is an untouched pad.

    ``pressure``: mean pressure [fraction of full scale]; ``tilt``: relative rise of pressure a pitch
    along x and y from the contact's centre; never below 0 or above full scale before noise.
    """
    values = np.zeros((rows, cols))
    if contact is not None:
        y, x = np.indices((rows, cols), float)
        slope = 1 + tilt[0] * (x - contact.x) + tilt[1] * (y - contact.y)
        values = coverage(contact, rows, cols) * np.clip(pressure * slope, 0, 1)
    if skin.blur:
        values = ndimage.gaussian_filter(values, skin.blur, mode='constant')
    values = skin.full_scale * (values + skin.noise * rng.standard_normal(values.shape))
    values[rng.random(values.shape) < skin.dead] = np.nan
    return values
