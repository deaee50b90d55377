"""Solve the contact of indenters with an elastic half-space.

The model has no length scale, so one solution serves all sizes and poses.
"""

from dataclasses import dataclass
from math import ceil, pi, sqrt

import numpy as np

from tactile_node.taxel_frame import read_only
from training.ground_truth.contact_solver import TOLERANCE, press
from training.ground_truth.indenters import Indenter

CELLS = 48  #: Number of cells along the square root of the nominal contact area.


@dataclass(frozen=True)
class Solution:
    """Pressure under an indenter, in units of its mean over the contact.

    The unit of length is the square root of the contact's area.

    The origin is the centre of area of the indenter's nominal outline. `solve` explains ``tilt``.
    """

    kind: str
    label: str
    pressure: np.ndarray         #: (rows, cols), read-only; mean 1 over the contact, 0 outside
    cell: float                  #: side of a cell
    origin: tuple[float, float]  #: x, y of the centre of cell [0, 0]
    outline: np.ndarray          #: nominal outline, (n, 2), read-only
    filled: float                #: area in contact divided by nominal area; small if a tilted indenter has lifted off
    compression: float
    tilt: tuple[float, float]

    @property
    def contact(self) -> np.ndarray:
        """Cells in contact, bool, with the shape of ``pressure``. The total area of these cells is 1."""
        return self.pressure > 0


def solve(indenter: Indenter, tilt: tuple[float, float] = (0.0, 0.0), cells: int = CELLS,
          tolerance: float = TOLERANCE) -> Solution:
    """Press ``indenter``. The square root of the nominal area is ``cells`` cells long.

    The ``tilt`` is given along x and y. The magnitude of the tilt is a fraction of the rotation at which the rim of a
    flat punch begins to lift off. For a sharp circle, this rotation is exact (θ = P / (4 E* radius²)), and the pressure
    rises by the tilt from the middle to the rim.
    """
    cell = 1 / cells
    (x, left), (y, low) = (_centres(indenter.low[k], indenter.high[k], cell) for k in (0, 1))
    rotation = _rotation(indenter, tilt)
    gap = indenter.gap(x[np.newaxis], y[:, np.newaxis]) - rotation[0] * x - rotation[1] * y[:, np.newaxis]
    pressure = press(gap, cell, load=indenter.compression, tolerance=tolerance).pressure
    touching = pressure > 0
    unit = cell * sqrt(touching.sum())  # the unit of length is the square root of the contact's area
    return Solution(indenter.kind, indenter.label, read_only(pressure / pressure[touching].mean()), cell=cell / unit,
                    origin=(left / unit, low / unit), outline=read_only(indenter.outline / unit),
                    filled=float(unit ** 2), compression=indenter.compression, tilt=tilt)


def _rotation(indenter: Indenter, tilt: tuple[float, float]) -> np.ndarray:
    """Return the rotations about y and x [rad].

    The rotations depend on how far the outline extends on the side that would lift off.
    """
    size = float(np.hypot(*tilt))
    if not size:
        return np.zeros(2)
    reach = float((indenter.outline @ (-np.array(tilt) / size)).max())
    return np.array(tilt) * (sqrt(pi) / 4 * indenter.compression / reach)


def _centres(low: float, high: float, cell: float) -> tuple[np.ndarray, float]:
    """Return the centres of the cells that cover ``low`` to ``high``, and the first centre."""
    count = ceil((high - low) / cell - 1e-9)
    centres = (low + high) / 2 + (np.arange(count) - (count - 1) / 2) * cell
    return centres, float(centres[0])
