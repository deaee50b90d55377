"""Pressure frames of a synthetic contact: what a skin with pressure values would measure."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from tactile_node.synthetic.world import PAD, Contact

SUBSAMPLES = 8  #: a taxel's coverage is counted on 8×8 points


@dataclass(frozen=True)
class Skin:
    """How a skin answers to pressure."""

    full_scale: float = 100_000.0  #: [Pa]
    blur: float = 0.0              #: standard deviation of the elastomer's spread [pitches]
    noise: float = 0.0             #: standard deviation [fraction of full scale]
    dead: float = 0.0              #: fraction of taxels without a valid value (NaN), drawn anew a frame


def coverage(contact: Contact, rows: int = PAD, cols: int = PAD) -> np.ndarray:
    """Return the fraction of each taxel's square that the contact covers, shape (rows, cols)."""
    step = (np.arange(SUBSAMPLES) + 0.5) / SUBSAMPLES - 0.5
    y, x = np.meshgrid((np.arange(rows)[:, None] + step).reshape(-1),
                       (np.arange(cols)[:, None] + step).reshape(-1), indexing='ij')
    inside = contact.depth(x, y) >= 0
    return inside.reshape(rows, SUBSAMPLES, cols, SUBSAMPLES).mean((1, 3))


def pressure_frame(contact: Contact | None, rng: np.random.Generator, rows: int = PAD, cols: int = PAD, *,
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
