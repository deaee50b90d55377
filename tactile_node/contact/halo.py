"""Estimate the halo of a contact.

The halo is the load that the skin's cover carries sideways to taxels that nothing touches.
"""

import numpy as np

from tactile_node.contact.neighbours import box_of, grown

SKIRT_REACH = 2  #: Distance from a contact at which only its halo, and not its rim, is visible [taxels].
LEAST_SKIRT = 8  #: Smallest number of taxels that can show a halo.

#: Quantile of the readings around a contact at which the halo is measured. A halo surrounds its contact on all sides.
#: Around a tilted or uneven contact without a halo, the lowest quarter of the readings is at rest.
ALL_ROUND = 0.25
#: Smallest halo, as a share of the contact's mean reading. Simulated contacts on elastic layers, and contacts on arrays
#: that read 0 at rest, have smaller halos.
LEAST_HALO = 0.02
#: Distance over which a halo falls to about a third (1/e) [taxels]. The value was chosen with simulated halos of five
#: profiles.
HALO_LENGTH = 4.0


def halo_of(raised: np.ndarray, valid: np.ndarray, pressed: np.ndarray) -> np.ndarray | None:
    """Return the halo of the pressed taxels, or None if the contact has no halo.

    The halo at a taxel is proportional to the load around that taxel. The factor is chosen so that the halo explains
    the readings all around the contact.

    Parameters
    ----------
    raised : np.ndarray
        Readings above the level at rest, float (rows, cols).
    valid : np.ndarray
        Taxels with a valid value, bool (rows, cols).
    pressed : np.ndarray
        Pressed taxels, bool (rows, cols).

    Returns
    -------
    np.ndarray or None
        Halo at each taxel, float (rows, cols), in the unit of ``raised``.
    """
    if not np.count_nonzero(pressed):
        return None
    box = box_of(pressed, SKIRT_REACH)
    near = grown(pressed[box])
    skirt = grown(near) & ~near & valid[box]
    beside = raised[box][skirt]
    least = LEAST_HALO * raised[pressed].mean()
    if beside.size < LEAST_SKIRT or _lowest_quarter(beside) < least:
        return None
    spread = _spread(np.where(pressed, raised, 0.0))
    halo: np.ndarray = spread * _lowest_quarter(beside / spread[box][skirt])
    return halo


def _lowest_quarter(values: np.ndarray) -> float:
    """Return the value below which a quarter of ``values`` lies, computed five times as fast as with numpy's
    quantile."""
    place = int(ALL_ROUND * values.size)
    return float(np.partition(values, place)[place])


def _spread(load: np.ndarray) -> np.ndarray:
    """Return ``load``, (rows, cols), spread over all taxels. The load decays with the distance in rows plus columns."""
    rows, cols = (np.exp(-np.abs(np.subtract.outer(place, place)) / HALO_LENGTH)
                  for place in map(np.arange, load.shape))
    spread: np.ndarray = rows @ load @ cols
    return spread
