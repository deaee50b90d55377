"""From the pressure on a skin's surface to taxel values: the normal stress at the taxels' depth, at any pose.

Lengths are in taxel pitches. The skin is a half-space: that it ends on a stiff board, that the taxels are stiffer than
the layer, and friction on its surface are not modelled.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from tactile_node.taxel_frame import read_only
from training.ground_truth.half_space import stress_influence
from training.ground_truth.mechanics import Solution

REACH = 8.0            #: depths around the indenter in which its stress is followed: 0.2 % of the load is beyond
CELL_OF_DEPTH = 0.125  #: a field this coarse [depths] is smooth enough to be interpolated linearly, to 1 % at its peak
FINEST = 0.1           #: nor is a cell finer than this [pitches] of use to a taxel
POINTS = 4             #: a taxel's mean is taken over 4×4 points


@dataclass(frozen=True)
class StressField:
    """Normal stress in the plane of the taxels, in units of the mean pressure, in the indenter's frame [pitches]."""

    stress: np.ndarray           #: (rows, cols), read-only
    cell: float
    origin: tuple[float, float]  #: x, y of the centre of cell [0, 0]


def stress_field(solution: Solution, area: float, depth: float) -> StressField:
    """Return the stress at ``depth`` under a contact of ``area`` taxels."""
    scale = float(np.sqrt(area))
    coarser = max(1, int(max(FINEST, CELL_OF_DEPTH * depth) / (solution.cell * scale)))
    pressure = _coarser(solution.pressure, coarser)
    cell = coarser * solution.cell * scale
    margin = int(np.ceil((REACH * depth + 1) / cell))
    stress = stress_influence((pressure.shape[0], pressure.shape[1]), cell, depth, margin)(pressure)
    first = [scale * (origin + (coarser - 1) / 2 * solution.cell) - margin * cell for origin in solution.origin]
    return StressField(read_only(stress), cell, (first[0], first[1]))


def sample(field: StressField, x: float, y: float, angle: float, rows: int, cols: int,
           aperture: float = 1.0) -> np.ndarray:
    """Return the mean stress over each taxel, shape (rows, cols), for a mean pressure of 1.

    The indenter's origin is at ``x``, ``y`` [pitches; taxel (row, col) is centred at x = col, y = row], rotated by
    ``angle`` (x towards y). ``aperture``: side of a taxel's sensitive square, 1 for the whole pitch.
    """
    step = ((np.arange(POINTS) + 0.5) / POINTS - 0.5) * aperture
    across = (np.arange(cols)[:, np.newaxis] + step).reshape(-1) - x
    down = (np.arange(rows)[:, np.newaxis] + step).reshape(-1) - y
    cos, sin = np.cos(angle) / field.cell, np.sin(angle) / field.cell
    places = np.empty((2, rows * POINTS, cols * POINTS))
    np.add.outer(cos * down, -sin * across - field.origin[1] / field.cell, out=places[0])
    np.add.outer(sin * down, cos * across - field.origin[0] / field.cell, out=places[1])
    points = ndimage.map_coordinates(field.stress, places, order=1, mode='constant')
    frame: np.ndarray = points.reshape(rows, POINTS, cols, POINTS).mean((1, 3))
    return frame


def measured(stress: np.ndarray, mean_pressure: float, rng: np.random.Generator, noise: float = 0.0,
             dead: float = 0.0) -> np.ndarray:
    """Return a skin's values under ``stress`` (mean pressure 1): fractions of full scale, at most 1, NaN where dead.

    ``mean_pressure``, ``noise`` (standard deviation): fractions of full scale; ``dead``: fraction of the taxels.
    """
    values = np.minimum(mean_pressure * stress + noise * rng.standard_normal(stress.shape), 1.0)
    values[rng.random(values.shape) < dead] = np.nan
    return values


def _coarser(pressure: np.ndarray, times: int) -> np.ndarray:
    """Means over ``times`` × ``times`` cells, zeros added at the far ends."""
    if times == 1:
        return pressure
    rows, cols = (-(-count // times) for count in pressure.shape)
    padded = np.zeros((rows * times, cols * times))
    padded[:pressure.shape[0], :pressure.shape[1]] = pressure
    means: np.ndarray = padded.reshape(rows, times, cols, times).mean((1, 3))
    return means
