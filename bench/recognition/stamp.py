"""Press a figure of fine cells on a pad at a random place, to make frames of foreign and blemished figures.

This module and the families of figures that use it contain nothing from the training.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from training.ground_truth.overlap import ANY, Limits, best_overlap

CELLS = 256        #: Number of cells per side of a figure's square, in which x and y go from -1 to 1.
SUBSAMPLES = 6     #: The coverage of a taxel is sampled at 6 x 6 points.
PRESSURE = 0.1, 0.8  #: Range of the mean pressure [fraction of full scale].
TILT = 0.3         #: Largest relative rise of the pressure over the contact's mean radius.
BLUR = 0.5         #: Standard deviation of the elastomer's blur [pitches].
NOISE = 0.01       #: Standard deviation of the noise [fraction of full scale].
DEAD = 0.03        #: Share of taxels without a valid value.

#: Function that returns True for the points x, y, each (CELLS, CELLS), inside the drawn figure.
Drawing = Callable[[np.random.Generator, np.ndarray, np.ndarray], np.ndarray]


class Stamp(NamedTuple):
    """A figure to press on a pad, without a unit of length."""

    name: str           #: name of the figure's family
    filled: np.ndarray  #: bool, (rows, cols)
    shape: str          #: the most similar of the five shapes after enclosed holes are filled
    overlap: float      #: intersection over union with the most similar shape


def drawn(name: str, rng: np.random.Generator, drawing: Drawing, limits: Limits = ANY) -> Stamp:
    """Draw a figure with any overlap, again until it is in one piece and does not touch the edge of the square."""
    x, y = points()
    while True:
        filled = drawing(rng, x, y)
        if ndimage.label(filled)[1] == 1 and not _on_edge(filled):
            filled = cropped(filled)
            return Stamp(name, filled, *best_overlap(ndimage.binary_fill_holes(filled), limits))


def cropped(filled: np.ndarray) -> np.ndarray:
    """Return the bounding box of the filled cells."""
    rows, cols = np.flatnonzero(filled.any(1)), np.flatnonzero(filled.any(0))
    return filled[rows[0]:rows[-1] + 1, cols[0]:cols[-1] + 1].copy()


def points() -> tuple[np.ndarray, np.ndarray]:
    """Return the x and y coordinates of all cell centres, each (CELLS, CELLS)."""
    place = (np.arange(CELLS) + 0.5) * (2 / CELLS) - 1
    x, y = np.meshgrid(place, place)
    return x, y


def _on_edge(filled: np.ndarray) -> bool:
    return bool(filled[[0, -1]].any() or filled[:, [0, -1]].any())


def pressed(stamp: Stamp, rng: np.random.Generator, area: float, on_off: bool) -> np.ndarray:
    """Press ``stamp`` with ``area`` [taxels] near the middle of a pad, at a random angle, and return the frame.

    On/off frames are bool, and a taxel is on if its centre lies inside the figure. Other frames are float in fractions
    of full scale, with NaN for dead taxels.
    """
    rows, cols = np.nonzero(stamp.filled)
    cell = np.sqrt(area / len(rows))  # [pitches]
    middle = np.array((rows.mean(), cols.mean()))
    reach = np.hypot(rows - middle[0], cols - middle[1]).max() * cell
    side = max(16, int(np.ceil(2 * reach)) + 8)
    centre = (side - 1) / 2 + rng.uniform(-0.5, 0.5, 2)
    angle = rng.uniform(0, 2 * np.pi)
    turn = np.array(((np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle)))) / cell

    def inside(places: np.ndarray) -> np.ndarray:
        at = np.rint((places - centre) @ turn + middle).astype(int)
        valid = ((at >= 0) & (at < stamp.filled.shape)).all(-1)
        return valid & stamp.filled[tuple(np.moveaxis(np.where(valid[..., None], at, 0), -1, 0))]

    taxels = np.moveaxis(np.indices((side, side)), 0, -1).astype(float)
    if on_off:
        return inside(taxels)
    step = (np.arange(SUBSAMPLES) + 0.5) / SUBSAMPLES - 0.5
    points = np.moveaxis(np.array(np.meshgrid(step, step)), 0, -1).reshape(-1, 2)
    covered = inside(taxels[:, :, None] + points).mean(-1)
    return _values(rng, covered, taxels - centre, np.sqrt(area / np.pi))


def _values(rng: np.random.Generator, covered: np.ndarray, arms: np.ndarray, radius: float) -> np.ndarray:
    """Return the pressures of ``covered`` taxels, whose distances from the contact's middle are ``arms``."""
    tilt, angle = rng.uniform(0, TILT) / radius, rng.uniform(0, 2 * np.pi)
    rise = 1 + tilt * (arms @ (np.sin(angle), np.cos(angle)))
    values = ndimage.gaussian_filter(covered * np.clip(rng.uniform(*PRESSURE) * rise, 0, 1), BLUR)
    values += NOISE * rng.standard_normal(values.shape)
    values[rng.random(values.shape) < DEAD] = np.nan
    return values
