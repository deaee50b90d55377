"""Compute with FFT the response of an elastic half-space to uniformly loaded square cells.

The sum over the cells is exact for pressures that are constant in each cell, because zero padding prevents the FFT from
wrapping around. The model assumes small strains, no friction, and an infinitely thick homogeneous material. A thin
layer on a stiff board is stiffer at short range and spreads the pressure less. The model does not include that effect.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import fft

from tactile_node.taxel_frame import read_only

Primitive = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Influence:
    """Convolution of cell values, an array of shape ``shape``, with a response that is even in x and y.

    The result is the response at the centres of the cells, and of ``margin`` more cells on each side.
    """

    shape: tuple[int, int]
    margin: int
    size: tuple[int, int]  #: size of the transform
    spectrum: np.ndarray   #: the transform is real, because the response is even

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Return the sum of the responses to all cells. The shape of the sum is ``shape`` plus the margins."""
        rows, cols = self.shape
        padded = np.zeros(self.size)
        padded[self.margin:self.margin + rows, self.margin:self.margin + cols] = values
        summed: np.ndarray = fft.irfft2(fft.rfft2(padded) * self.spectrum, self.size)
        return summed[:rows + 2 * self.margin, :cols + 2 * self.margin]


def displacement_influence(shape: tuple[int, int], cell: float) -> Influence:
    """Return the influence of the pressure on the normal displacement of the surface (Love 1929).

    The contact modulus E* is 1.

    The length ``cell`` is the side of a cell. Displacements are in units of length, and pressures in units of E* = E /
    (1 - ν²).
    """
    return _influence(_love, shape, cell, margin=0)


def stress_influence(shape: tuple[int, int], cell: float, depth: float, margin: int = 0) -> Influence:
    """Return the influence of the pressure on the normal stress at ``depth`` (> 0) below the surface.

    Compression is positive.

    The response to a point load is Boussinesq's 3 z³ / (2π (r² + z²)^(5/2)). This response is integrated over a cell
    (Newmark 1935). The result does not depend on any elastic constant.
    """
    if not depth > 0:
        raise ValueError(f'depth {depth!r}: expected a positive depth')
    return _influence(lambda x, y: _newmark(x, y, depth), shape, cell, margin)


def _influence(primitive: Primitive, shape: tuple[int, int], cell: float, margin: int) -> Influence:
    """Return the response to a cell at every offset.

    The derivative ∂²/∂x∂y of the function ``primitive`` is the response to a point load. The primitive is odd in x and
    in y, so the offsets in one quadrant are sufficient.
    """
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
    """Return the antiderivative of 1 / (π r)."""
    primitive: np.ndarray = (x * np.arcsinh(y / np.abs(x)) + y * np.arcsinh(x / np.abs(y))) / np.pi
    return primitive


def _newmark(x: np.ndarray, y: np.ndarray, z: float) -> np.ndarray:
    """Return the antiderivative of 3 z³ / (2π (r² + z²)^(5/2))."""
    slant = np.sqrt(x * x + y * y + z * z)
    parts = x * y * z / slant * (1 / (x * x + z * z) + 1 / (y * y + z * z))
    primitive: np.ndarray = (np.arctan(x * y / (z * slant)) + parts) / (2 * np.pi)
    return primitive
