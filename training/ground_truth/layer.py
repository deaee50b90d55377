"""Compute taxel values from the pressure on a skin's surface.

The values follow from the normal stress at the depth of the taxels, for any pose.

Lengths are in taxel pitches. The skin is modelled as a half-space. The model ignores the stiff board under the skin,
the higher stiffness of the taxels and the friction on the surface.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from tactile_node.taxel_frame import read_only
from training.ground_truth.half_space import stress_influence
from training.ground_truth.mechanics import Solution

#: Distance around the indenter up to which its stress is computed [depths]. Only 0.2 % of the load lies beyond this
#: distance.
REACH = 8.0
#: Largest cell of a stress field [depths]. With cells of this size, the error of linear interpolation at the peak is at
#: most 1 %.
CELL_OF_DEPTH = 0.125
FINEST = 0.1           #: Smallest cell of a stress field [pitches]. A taxel does not resolve smaller cells.

#: Number of points along each side of a taxel over which the mean is taken (POINTS x POINTS points).
POINTS = 4


@dataclass(frozen=True)
class StressField:
    """Normal stress in the taxel plane, in units of the mean pressure.

    Lengths are in pitches, in the frame of the indenter.
    """

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
    """Return the mean stress over each taxel, (rows, cols), for a mean pressure of 1.

    The indenter's origin is at ``x``, ``y`` [pitches]. Taxel (row, col) is centred at x = col, y = row. The
    indenter is rotated by ``angle`` from x towards y. The length ``aperture`` is the side of a taxel's sensitive
    square, where 1 is the whole pitch.
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
    """Return the values that a skin measures under ``stress``, as fractions of full scale.

    A value is at most 1. A dead taxel is NaN.

    The array ``stress`` has a mean pressure of 1. ``mean_pressure`` and ``noise`` (standard deviation) are fractions of
    full scale, and ``dead`` is a fraction of the taxels.
    """
    values = np.minimum(mean_pressure * stress + noise * rng.standard_normal(stress.shape), 1.0)
    values[rng.random(values.shape) < dead] = np.nan
    return values


def _coarser(pressure: np.ndarray, times: int) -> np.ndarray:
    """Return the means over ``times`` x ``times`` cells. Zeros are added at the far ends."""
    if times == 1:
        return pressure
    rows, cols = (-(-count // times) for count in pressure.shape)
    padded = np.zeros((rows * times, cols * times))
    padded[:pressure.shape[0], :pressure.shape[1]] = pressure
    means: np.ndarray = padded.reshape(rows, times, cols, times).mean((1, 3))
    return means
