"""Frictionless contact of a rigid indenter with an elastic half-space, under a given load.

Conjugate gradients on the non-negative pressures (Polonsky & Keer, Wear 231, 1999): pressures that would pull are cut
off, cells that would overlap are taken in.
"""

from typing import NamedTuple

import numpy as np

from training.ground_truth.half_space import Influence, displacement_influence

TOLERANCE = 1e-6  #: change of the pressures in one step [fraction of the load]
MOST_STEPS = 1000


class Pressed(NamedTuple):
    """Arrays of the shape of the indenter's gap; where the indenter is not, gap is infinite and pressure 0."""

    pressure: np.ndarray  #: [E*]
    gap: np.ndarray       #: between indenter and deformed surface, 0 in the contact
    approach: float       #: of the indenter to the undeformed half-space


def press(gap: np.ndarray, cell: float, load: float, tolerance: float = TOLERANCE) -> Pressed:
    """Press an indenter with its undeformed ``gap`` to the surface, sampled in square cells of side ``cell``.

    ``gap``: in the length unit of ``cell``, any offset, infinite where there is no indenter; a tilted indenter has a
    tilted gap. ``load``: in units of E* and length². Raises ValueError if there is no indenter, RuntimeError if the
    steps do not converge.
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
