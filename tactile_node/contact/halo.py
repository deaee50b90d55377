"""The halo of a contact: the load that the skin's cover carries sideways, to taxels that nothing touches."""

import numpy as np

from tactile_node.contact.neighbours import box_of, grown

SKIRT_REACH = 2    #: distance from a contact at which its halo shows and its own rim does not [taxels]
LEAST_SKIRT = 8    #: taxels that show a halo
#: A halo surrounds its contact. Around a tilted or uneven contact the lowest quarter of the readings is at rest.
ALL_ROUND = 0.25
#: share of the contact's mean; computed contacts of elastic layers, and those of arrays that read 0 at rest, show less
LEAST_HALO = 0.02
HALO_LENGTH = 4.0  #: distance over which a halo falls to a third [taxels]; chosen on computed halos of five profiles


def halo_of(raised: np.ndarray, valid: np.ndarray, pressed: np.ndarray) -> np.ndarray | None:
    """Return the halo of the ``pressed`` taxels, float (rows, cols), in the unit of ``raised``; None without one.

    ``raised``: values above the level at rest; ``valid``: bool, the taxels with a value. The halo of a taxel is
    proportional to the load around it, by the factor that the readings beside the contact show all round.
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
    """Return the value below which a quarter of ``values`` lies, in a fifth of the time of numpy's quantile."""
    place = int(ALL_ROUND * values.size)
    return float(np.partition(values, place)[place])


def _spread(load: np.ndarray) -> np.ndarray:
    """Return ``load``, (rows, cols), as carried to each taxel; it falls with the distance in rows plus in columns."""
    rows, cols = (np.exp(-np.abs(np.subtract.outer(place, place)) / HALO_LENGTH)
                  for place in map(np.arange, load.shape))
    spread: np.ndarray = rows @ load @ cols
    return spread
