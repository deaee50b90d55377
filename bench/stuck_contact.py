"""Compute what the taxels under an elastic layer read while a load pulls on a contact that sticks to the layer.

The indenter is rigid. Under the load, the contact moves along x as one piece. The finger may also tilt in a pitch joint
behind the layer, because the load acts at a distance from the joint. The normal force stays constant. The set of
touching cells stays constant too, so the response is proportional to the load.
"""

import math
from typing import NamedTuple

import numpy as np
from elastic_layer import ElasticLayer


class PitchJoint(NamedTuple):
    """The joint in which the finger tilts, behind the base of the layer."""

    stiffness: float = math.inf  #: torque by which the joint resists a tilt [N m/rad]
    arm: float = 0.02            #: distance of the joint from the base of the layer [m]


class StuckResponse(NamedTuple):
    """Response to a load that equals the normal force."""

    base: np.ndarray     #: change of the pressure at the base, (rows, cols) [Pa]
    displacement: float  #: displacement of the surface under the contact along x [m]
    tilt: float          #: tilt of the finger, negative if the side to which the load points lifts off [rad]


def stuck_response(layer: ElasticLayer, cell: float, pressure: np.ndarray, joint: PitchJoint) -> StuckResponse:
    """Return the response of a contact to a load along x that equals the normal force.

    Parameters
    ----------
    layer : ElasticLayer
        The layer, in metres and pascals.
    cell : float
        Side of a cell of the grid [m].
    pressure : np.ndarray
        Pressure on the surface before the load acts, (rows, cols) [Pa]. The grid has a margin of several thicknesses.
    joint : PitchJoint
        Joint of the finger.
    """
    rows, cols = np.nonzero(pressure > 0)
    x = (cols - np.average(cols, weights=pressure[rows, cols])) * cell
    compliance = _compliance(layer, cell, pressure.shape, rows, cols)
    # The contact moves by 1 along x, moves by 1 into the layer, and tilts by 1.
    none, one = np.zeros(len(x)), np.ones(len(x))
    motions = np.stack((np.concatenate((one, none, none)), np.concatenate((none, none, one)),
                        np.concatenate((none, none, x))), axis=1)
    tractions = np.linalg.solve(compliance, motions).reshape(3, len(x), 3)
    loads, pushes = tractions[0].sum(0) * cell**2, tractions[2].sum(0) * cell**2
    moments = (x @ tractions[2]) * cell**2 + layer.thickness * loads  # about the base
    load = float(pressure.sum()) * cell**2
    # The load and the moment at the base both turn the finger so that the side to which the load points lifts off.
    turned = np.array((0.0, 0.0, 1.0)) + moments / joint.stiffness
    weights = np.linalg.solve((loads, pushes, turned), (load, 0.0, -load * joint.arm / joint.stiffness))
    shear, across, normal = np.zeros((3, *pressure.shape))
    shear[rows, cols], across[rows, cols], normal[rows, cols] = tractions @ weights
    return StuckResponse(layer.base_pressure(cell, normal, shear, across), float(weights[0]), float(weights[2]))


def _compliance(layer: ElasticLayer, cell: float, shape: tuple[int, int], rows: np.ndarray,
                cols: np.ndarray) -> np.ndarray:
    """Return the displacements (x, y, z) of the touching cells under a unit traction (x, y, z) on each of them."""
    unit, none = np.zeros(shape), np.zeros(shape)
    unit[0, 0] = 1.0
    along, across, into = (layer.surface(cell, none, unit, none), layer.surface(cell, none, none, unit),
                           layer.surface(cell, unit, none, none))
    row, col = np.subtract.outer(rows, rows), np.subtract.outer(cols, cols)
    return np.block([[getattr(load, of)[row, col] for load in (along, across, into)] for of in ('x', 'y', 'z')])
