"""Find how far a contact shifts under a load along the pad, from a known weight."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tactile_node.commissioning.block_grip import MIRROR, Print
from tactile_node.commissioning.measurement import NOT_MEASURED, Estimate, mean_of
from tactile_node.commissioning.mistake import Mistake, RefusedStepError

MOST_DIFFERENT = 0.3  #: Largest difference between two grips, as a share of their mean.
SHARED_ERROR = 0.04   #: Relative error that both grips share, because the same taxels lie under the object.
LEAST_SHIFT = 1e-4    #: Smallest shift that shows that the weight hangs on the object [m].


class HungWeight(NamedTuple):
    """One grip of an object, without and with the weight."""

    before: tuple[Print, Print]
    loaded: tuple[Print, Print]
    forces: tuple[float, float]  #: force on each pad with the weight [N]


def shift_of(hung: HungWeight, weight: float, down: tuple[float, float]) -> float:
    """Return the mean shift of both pads, divided by the load as a share of the force [m].

    Parameters
    ----------
    hung : HungWeight
        The prints and forces.
    weight : float
        Weight [N]. Each pad carries half of it.
    down : tuple of float
        Direction of gravity on the left pad, as a unit vector (x, y).

    Raises
    ------
    RefusedStepError
        Raised if no contact has moved.
    """
    moved = [loaded.centre - before.centre for before, loaded in zip(hung.before, hung.loaded)]
    if max(float(np.linalg.norm(each)) for each in moved) < LEAST_SHIFT:
        raise RefusedStepError('weight', Mistake.WEIGHT_MISSING, expected='a shift of the contacts', got='none',
                               remedy='Hang the weight on the object, or use a heavier weight.')
    return float(np.mean([each @ towards / (weight / 2 / force)
                          for each, towards, force in zip(moved, (np.array(down), MIRROR @ down), hung.forces)]))


def shift_per_load(shifts: Sequence[float]) -> tuple[Estimate, str]:
    """Return the shift per load from two grips, and the reason if the two contradict each other."""
    if len(shifts) < 2:
        return NOT_MEASURED, 'the weight was hung in fewer than two grips'
    first, second = shifts[-2:]
    if first * second <= 0:
        return NOT_MEASURED, 'the two grips differ in sign'
    difference = abs(first - second) / (abs(first + second) / 2)
    if difference > MOST_DIFFERENT:
        return NOT_MEASURED, f'the two grips differ by {100 * difference:.0f} %, more than {100 * MOST_DIFFERENT:.0f} %'
    found = mean_of((first, second))
    return found.with_error(SHARED_ERROR * found.value), ''
