"""Solve the frictionless contact of a rigid indenter with an elastic half-space under a given load.

The solver uses conjugate gradients on the non-negative pressures (Polonsky & Keer, Wear 231, 1999). Cells with a
tensile pressure leave the contact, and cells that would overlap join it.
"""

from typing import NamedTuple

import numpy as np

from training.ground_truth.half_space import Influence, displacement_influence

TOLERANCE = 1e-6  #: The iteration stops when the pressures change by less than this fraction of the load in one step.
MOST_STEPS = 1000


class Pressed(NamedTuple):
    """A pressed indenter.

    All arrays have the shape of the indenter's gap. Outside the indenter, the gap is infinite and the pressure is 0.
    """

    pressure: np.ndarray  #: [E*]
    gap: np.ndarray       #: distance between the indenter and the deformed surface; 0 in the contact
    approach: float       #: approach of the indenter to the undeformed half-space


def press(gap: np.ndarray, cell: float, load: float, tolerance: float = TOLERANCE) -> Pressed:
    """Press an indenter against the surface.

    Parameters
    ----------
    gap : np.ndarray
        Undeformed gap, in the length unit of ``cell``, with any offset; infinite outside the indenter. For a tilted
        indenter, the gap is tilted.
    cell : float
        Side of a square cell.
    load : float
        Load, in units of E* and length².
    tolerance : float
        The iteration stops when the pressures change by less than this fraction of the load in one step.

    Raises
    ------
    ValueError
        Raised if there is no indenter.
    RuntimeError
        Raised if the iteration does not converge.
    """
    solid = np.isfinite(gap)
    if not solid.any():
        raise ValueError('gap: expected an indenter, got no cell with a finite gap')
    finite = np.where(solid, gap, 0.0)
    bend = displacement_influence((gap.shape[0], gap.shape[1]), cell)
    pressure = solid * (load / cell ** 2 / solid.sum())
    direction, before, keep = np.zeros_like(pressure), 1.0, 0.0
    for _ in range(MOST_STEPS):
        contact = pressure > 0
        residual = bend(pressure) + finite
        residual -= residual[contact].mean()
        now = float((residual[contact] ** 2).sum())
        direction = np.where(contact, residual + keep * now / before * direction, 0.0)
        step = _step(bend, residual, direction, contact)
        updated = np.where(contact, np.maximum(pressure - step * direction, 0.0), 0.0)
        overlapping = solid & (updated == 0) & (residual < 0)
        updated[overlapping] = -step * residual[overlapping]
        updated *= load / cell ** 2 / updated.sum()
        change = float(np.abs(updated - pressure).sum()) * cell ** 2
        pressure, before, keep = updated, now or 1.0, float(not overlapping.any())
        if change < tolerance * load:
            return _pressed(pressure, finite, solid, bend)
    raise RuntimeError(f'contact not solved in {MOST_STEPS} steps: change {change / load:.1e}, '
                       f'expected {tolerance:.1e} of the load; is the gap that of a solid body?')


def _step(bend: Influence, residual: np.ndarray, direction: np.ndarray, contact: np.ndarray) -> float:
    response = bend(direction)
    response -= response[contact].mean()
    curvature = float((response * direction)[contact].sum())
    return float((residual * direction)[contact].sum()) / curvature if curvature else 0.0


def _pressed(pressure: np.ndarray, finite: np.ndarray, solid: np.ndarray, bend: Influence) -> Pressed:
    distance = bend(pressure) + finite
    approach = float(distance[pressure > 0].mean())
    return Pressed(pressure, np.where(solid, distance - approach, np.inf), approach)
