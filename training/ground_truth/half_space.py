"""Influence of uniformly loaded square cells of an elastic half-space, applied by FFT.

The sum over cells is exact for pressures that are constant in each cell, with zero padding, so that nothing wraps
around. Small strains, no friction, an infinitely thick homogeneous material: a thin layer on a stiff board is stiffer
at short range and lets less pressure spread; that is not modelled.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import fft

from tactile_node.taxel_frame import read_only

Primitive = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Influence:
    """A convolution of cell values, shape ``shape``, with a response even in x and y.

    Gives the response at the centres of the cells and ``margin`` cells farther on each side.
    """

    shape: tuple[int, int]
    margin: int
    size: tuple[int, int]  #: of the transform
    spectrum: np.ndarray   #: real, for the response is even

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Return the sum of all cells' responses, shape ``shape`` plus the margins."""
        rows, cols = self.shape
        padded = np.zeros(self.size)
        padded[self.margin:self.margin + rows, self.margin:self.margin + cols] = values
        summed: np.ndarray = fft.irfft2(fft.rfft2(padded) * self.spectrum, self.size)
        return summed[:rows + 2 * self.margin, :cols + 2 * self.margin]


def displacement_influence(shape: tuple[int, int], cell: float) -> Influence:
    """From pressure to normal displacement of the surface, for a contact modulus E* of 1 (Love 1929).

    ``cell``: side of a cell; displacement comes in units of length, pressure in units of E* = E / (1 - ν²).
    """
    return _influence(_love, shape, cell, margin=0)


def stress_influence(shape: tuple[int, int], cell: float, depth: float, margin: int = 0) -> Influence:
    """From pressure to the normal stress (compression positive) in a plane at ``depth`` (> 0) below the surface.

    Boussinesq's 3 z³ / (2π (r² + z²)^(5/2)), integrated over a cell (Newmark 1935); no elastic constant enters.
    """
    if not depth > 0:
        raise ValueError(f'depth {depth!r}: expected a positive depth')
    return _influence(lambda x, y: _newmark(x, y, depth), shape, cell, margin)


def _influence(primitive: Primitive, shape: tuple[int, int], cell: float, margin: int) -> Influence:
    """A cell's response at every offset, from its ``primitive``: ∂²/∂x∂y of it is the point response, it is odd in
    x and y, and so offsets of one quadrant do."""
    rows, cols = (count + margin for count in shape)
    y, x = ((np.arange(count + 1) - 0.5) * cell for count in (rows, cols))
    quadrant = np.diff(np.diff(primitive(x[np.newaxis], y[:, np.newaxis]), axis=0), axis=1)
    size = (int(fft.next_fast_len(2 * rows - 1, True)), int(fft.next_fast_len(2 * cols - 1, True)))
    kernel = np.zeros(size)
    kernel[:rows, :cols] = quadrant
    kernel[size[0] - rows + 1:, :cols] = quadrant[:0:-1]
    kernel[:, size[1] - cols + 1:] = kernel[:, cols - 1:0:-1]
    return Influence(shape, margin, size, read_only(fft.rfft2(kernel).real.copy()))


def _love(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Of 1 / (π r)."""
    primitive: np.ndarray = (x * np.arcsinh(y / np.abs(x)) + y * np.arcsinh(x / np.abs(y))) / np.pi
    return primitive


def _newmark(x: np.ndarray, y: np.ndarray, z: float) -> np.ndarray:
    """Of 3 z³ / (2π (r² + z²)^(5/2))."""
    slant = np.sqrt(x * x + y * y + z * z)
    parts = x * y * z / slant * (1 / (x * x + z * z) + 1 / (y * y + z * z))
    primitive: np.ndarray = (np.arctan(x * y / (z * slant)) + parts) / (2 * np.pi)
    return primitive
