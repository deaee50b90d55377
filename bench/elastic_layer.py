"""Compute the deformation of an elastic layer that is bonded to a rigid base and loaded on its surface.

The equations of elasticity are solved for each wave of the load. The load repeats beyond the edges of the grid, so the
grid needs a margin of several thicknesses around the load.

The depth z points from the surface into the layer. A wave of the load along k deforms the layer in the plane of k and z
like a plane strain, and across k by pure shear. A plane strain is the sum of four solutions of Navier's equations (with
the potentials of Papkovich and Neuber): two decay with the depth from the surface, and two decay with the height above
the base.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import fft

#: Smallest wave number times thickness for which the four solutions are independent in double precision.
SHORTEST_WAVE = 1e-3


class Surface(NamedTuple):
    """Displacement of the surface, one value for each cell of the grid."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray  #: into the layer


class Responses(NamedTuple):
    """Response to a unit wave, for each wave number. The prefix is the load, the suffix the response.

    A response of the other direction than its load is shifted by a quarter of the wave, and stands here without the
    factor i.
    """

    normal_base: np.ndarray     #: pressure at the base under a normal wave
    shear_base: np.ndarray      #: pressure at the base under a wave that shears along k
    normal_depth: np.ndarray    #: displacement into the layer
    normal_along: np.ndarray    #: displacement along k
    shear_depth: np.ndarray
    shear_along: np.ndarray
    shear_across: np.ndarray    #: displacement across k under a wave that shears across k


@dataclass(frozen=True)
class ElasticLayer:
    """An elastic layer on a rigid base. All lengths have the same unit, and all stresses have the same unit.

    Attributes
    ----------
    thickness : float
        Thickness of the layer.
    shear_modulus : float
        Shear modulus.
    poisson : float
        Poisson's ratio, below 0.5.
    """

    thickness: float
    shear_modulus: float
    poisson: float

    def base_pressure(self, cell: float, normal: np.ndarray, shear_x: np.ndarray, shear_y: np.ndarray) -> np.ndarray:
        """Return the normal pressure at the base, (rows, cols). Compression is positive.

        Parameters
        ----------
        cell : float
            Side of a cell of the grid.
        normal : np.ndarray
            Pressure on the surface, (rows, cols).
        shear_x, shear_y : np.ndarray
            Tangential traction on the surface along x and y, (rows, cols).
        """
        waves = _waves(normal.shape, cell)
        of = self.responses(waves.number)
        along = waves.x * fft.rfft2(shear_x) + waves.y * fft.rfft2(shear_y)
        base: np.ndarray = fft.irfft2(of.normal_base * fft.rfft2(normal) + 1j * of.shear_base * along, normal.shape)
        return base

    def surface(self, cell: float, normal: np.ndarray, shear_x: np.ndarray, shear_y: np.ndarray) -> Surface:
        """Return the displacement of the surface under the same loads as in `base_pressure`."""
        waves = _waves(normal.shape, cell)
        of = self.responses(waves.number)
        pressure, x, y = (fft.rfft2(load) for load in (normal, shear_x, shear_y))
        along, across = waves.x * x + waves.y * y, waves.x * y - waves.y * x
        depth = of.normal_depth * pressure + 1j * of.shear_depth * along
        moved, turned = 1j * of.normal_along * pressure + of.shear_along * along, of.shear_across * across
        is_mean = waves.number == 0  # a constant shear has no direction k
        spectra = (np.where(is_mean, of.shear_across * x, waves.x * moved - waves.y * turned),
                   np.where(is_mean, of.shear_across * y, waves.y * moved + waves.x * turned), depth)
        return Surface(*(fft.irfft2(spectrum, normal.shape) for spectrum in spectra))

    def responses(self, wave: np.ndarray) -> Responses:
        """Return the responses to unit waves with the wave numbers ``wave``."""
        nu, shear = self.poisson, self.shear_modulus
        depth = np.maximum(wave * self.thickness, SHORTEST_WAVE)  # wave number times thickness
        # Columns: the four solutions. Rows: pressure and shear on the surface, then both displacements at the base.
        # Displacements are in units of 1 / wave number, stresses in units of twice the shear modulus.
        none = np.zeros_like(depth)
        at_surface, at_base = _solutions(none, depth, nu), _solutions(depth, none, nu)
        system = np.stack((-at_surface.normal, -at_surface.shear, at_base.along, at_base.into), axis=-2)
        loads = np.zeros((*depth.shape, 4, 2))
        loads[..., 0, 0] = loads[..., 1, 1] = 1.0
        weights = np.linalg.solve(system, loads)
        length = self.thickness / depth / (2 * shear)
        base = -np.einsum('...s,...sl->...l', at_base.normal, weights)
        into = np.einsum('...s,...sl->...l', at_surface.into, weights) * length[..., None]
        along = np.einsum('...s,...sl->...l', at_surface.along, weights) * length[..., None]
        # A traction along k is i times the unit of the shear stress.
        return Responses(base[..., 0], -base[..., 1], into[..., 0], along[..., 0], -into[..., 1], along[..., 1],
                         np.tanh(depth) / depth * self.thickness / shear)


class _Solutions(NamedTuple):
    """Displacements and stresses of the four solutions at one depth, (..., 4). Values along k have a factor i."""

    along: np.ndarray
    into: np.ndarray
    normal: np.ndarray
    shear: np.ndarray


def _solutions(z: np.ndarray, height: np.ndarray, nu: float) -> _Solutions:
    """Return the solutions at the depth ``z`` and the height ``height`` above the base, in units of 1 / wave number."""
    falling, rising = np.exp(-z), np.exp(-height)
    stiff = 3 - 4 * nu
    return _Solutions(
        along=np.stack((falling, z * falling, rising, -height * rising), -1),
        into=np.stack((-falling, -(stiff + z) * falling, rising, -(stiff + height) * rising), -1),
        normal=np.stack((falling, (2 - 2 * nu + z) * falling, rising, -(2 - 2 * nu + height) * rising), -1),
        shear=np.stack((-falling, -(1 - 2 * nu + z) * falling, rising, -(1 - 2 * nu + height) * rising), -1))


class _Waves(NamedTuple):
    """The wave of each element of a real transform. ``x`` and ``y`` are its direction, or 0 for the mean."""

    number: np.ndarray
    x: np.ndarray
    y: np.ndarray


def _waves(shape: tuple[int, ...], cell: float) -> _Waves:
    rows, cols = shape
    kx, ky = np.meshgrid(2 * np.pi * fft.rfftfreq(cols, cell), 2 * np.pi * fft.fftfreq(rows, cell))
    number = np.hypot(kx, ky)
    length = np.where(number > 0, number, 1.0)
    return _Waves(number, kx / length, ky / length)
