"""Find the taxels that stand out from the noise, and the outline of each contact.

Grips are light, so a fixed fraction of the full scale misses most of them. This module compares each taxel with the
noise and with the level of its own contact. Under a flat indenter, the normal stress in the skin below the indenter's
edge is half of the indenter's pressure at any depth (Boussinesq, loaded half-plane). The outline of a contact is
therefore where the taxels read half as much as inside the contact.

Taxels differ in gain, and real objects press unevenly. A taxel between pressed taxels therefore counts as pressed even
if it reads less than half, provided that it reads more than the skin's response beside a contact.

The skin's cover may carry load sideways to taxels that nothing touches. This load is the halo of a contact (`halo_of`).
"""

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import EIGHT_CONNECTED, box_of, enclosed, grown

OUTLINE_SHARE = 0.5  #: Share of a contact's local level at which the outline of the contact lies.

#: Smallest height of a contact's taxels above the level at rest [standard deviations of the noise].
NOISE_SPREADS = 3.0
KEPT_SHARE = 0.85  #: Hysteresis. A pressed taxel stays pressed down to this share of both limits.

#: A group of fewer than GROUP_TAXELS taxels is pressed only if one of its taxels rises by this many standard
#: deviations. A lower limit would accept the small groups that noise forms.
ALONE_SPREADS = 6.0
#: Number of connected taxels at NOISE_SPREADS that noise rarely produces (once in 20,000 frames of 256 taxels).
GROUP_TAXELS = 4
#: A reading below this share of the highest reading within HALO_REACH taxels is only the skin's response beside a
#: contact.
HALO_SHARE = 0.25
HALO_REACH = 3  #: Distance over which readings are compared [rows and columns].

#: A taxel between pressed taxels joins them if it reads at least this share of the highest level within HALO_REACH
#: taxels. Lower readings separate two contacts.
BETWEEN_SHARE = 0.2
#: Largest number of small groups (fewer than GROUP_TAXELS taxels) that may split off a contact whose taxels differ in
#: gain.
MOST_SPECKS = 2
PLANE_TAXELS = 12    #: Smallest number of taxels from which a tilt can be computed.
STEEPEST_TILT = 0.5  #: Largest deviation of the tilted level from its mean, as a share of the mean.

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


class Threshold(NamedTuple):
    """Limits above which a taxel stands out, in the unit of the values."""

    level: float       #: level of the taxels at rest
    noise: np.ndarray  #: (rows, cols), standard deviation of each taxel at rest
    least: float       #: smallest rise above the level at rest, whatever the noise

    #: Highest reading of a resting taxel, from this frame alone. A taxel of a contact must exceed this reading or
    #: HALO_SHARE of the frame's highest reading, whichever is lower. Otherwise a wide halo would count as pressed after
    #: quieter frames.
    highest_rest: float = -np.inf


def standing_out(values: np.ndarray, valid: np.ndarray, threshold: Threshold,
                 before: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the pressed taxels of a frame, and their halo.

    Parameters
    ----------
    values : np.ndarray
        Taxel values, float (rows, cols).
    valid : np.ndarray
        Taxels with a valid value, bool (rows, cols).
    threshold : Threshold
        Limits for this frame.
    before : np.ndarray
        Taxels pressed in the previous frame, bool (rows, cols). Taxels pressed before stay pressed down to KEPT_SHARE
        of the limits.

    Returns
    -------
    pressed : np.ndarray
        Pressed taxels, bool (rows, cols).
    halo : np.ndarray or None
        Part of each value that the halo of the pressed taxels adds, (rows, cols), or None without a halo.
    """
    raised = np.where(valid, values - threshold.level, 0.0)
    ease = np.where(before, KEPT_SHARE, 1.0)
    pressed = _find_pressed(raised, valid, threshold, ease)
    halo = halo_of(raised, valid, pressed)
    if halo is not None:
        pressed = _find_pressed(np.where(valid, raised - halo, 0.0), valid, threshold, ease)
    return pressed, halo


def _find_pressed(raised: np.ndarray, valid: np.ndarray, threshold: Threshold, ease: np.ndarray) -> np.ndarray:
    candidates = valid & (raised > 0) & (raised >= np.maximum(NOISE_SPREADS * threshold.noise, threshold.least) * ease)
    pressed = np.zeros(raised.shape, bool)
    if np.count_nonzero(candidates):
        candidates &= raised >= min(threshold.highest_rest - threshold.level, HALO_SHARE * raised.max())
        # the computing time then depends on the size of the contacts, not on the size of the pad
        box = box_of(candidates, HALO_REACH)
        pressed[box] = _pressed(raised[box], candidates[box], ease[box], ALONE_SPREADS * threshold.noise[box])
    return pressed


def _pressed(raised: np.ndarray, candidates: np.ndarray, ease: np.ndarray, strong: np.ndarray) -> np.ndarray:
    near = candidates & (raised >= HALO_SHARE * _highest_near(raised))
    level = _outlined(raised, near, ease)
    rest = near & ~grown(level > 0)
    if np.count_nonzero(rest) >= GROUP_TAXELS:  # the skin's response would join a weaker contact to a stronger one
        level = np.maximum(level, _outlined(raised, rest, ease))
    pressed = level > 0
    weak = candidates & ~pressed & enclosed(pressed)
    if np.count_nonzero(weak):
        whole = pressed | weak & (raised >= BETWEEN_SHARE * ease * _highest_near(level))
        pressed = pressed if _are_specks(whole, raised) else whole
    return _significant(pressed, raised >= strong)


def _highest_near(values: np.ndarray) -> np.ndarray:
    """Return, for each taxel, the highest value up to HALO_REACH rows and columns away.

    Values beyond the edge are 0.
    """
    return ndimage.maximum_filter(values, 2 * HALO_REACH + 1, mode='constant')


def _outlined(raised: np.ndarray, candidates: np.ndarray, ease: np.ndarray) -> np.ndarray:
    """Return the local level of each candidate taxel that reaches half of that level, and 0 for all other taxels."""
    groups, count = ndimage.label(candidates, EIGHT_CONNECTED)
    flat, weight = groups.reshape(-1), raised.reshape(-1)
    sums = np.bincount(flat, weight, count + 1)
    sums[0] = 1.0  # the values of taxels outside any group may add up to 0
    levels = np.bincount(flat, weight * weight, count + 1) / sums
    local = levels[groups]
    inside = candidates & (raised >= OUTLINE_SHARE * local)
    sizes = np.bincount(groups[inside], minlength=count + 1)
    for number in (sizes[1:] >= PLANE_TAXELS).nonzero()[0] + 1:
        _tilted(local, raised, groups == number, inside)
    return np.where(candidates & (raised >= OUTLINE_SHARE * ease * local), local, 0.0)


def _tilted(local: np.ndarray, raised: np.ndarray, group: np.ndarray, inside: np.ndarray) -> None:
    """In the ``group``, set ``local`` to the plane through the readings of the ``inside`` taxels."""
    row, col = group.nonzero()
    y, x = (group & inside).nonzero()
    reading = raised[y, x]
    taxels = len(reading)
    mean, middle = reading.sum() / taxels, (y.sum() / taxels, x.sum() / taxels)
    dy, dx = y - middle[0], x - middle[1]
    yy, xx, xy = dy @ dy, dx @ dx, dy @ dx
    determinant = yy * xx - xy * xy
    if determinant <= 1e-9 * (yy + xx) ** 2:  # the group is only a line of taxels
        return
    vy, vx = dy @ reading, dx @ reading
    along_y, along_x = (vy * xx - vx * xy) / determinant, (vx * yy - vy * xy) / determinant
    plane = mean + along_y * (row - middle[0]) + along_x * (col - middle[1])
    local[row, col] = np.minimum(np.maximum(plane, (1 - STEEPEST_TILT) * mean), (1 + STEEPEST_TILT) * mean)


def _are_specks(pressed: np.ndarray, raised: np.ndarray) -> bool:
    """Return True if more than MOST_SPECKS small groups read as much as the largest group.

    In that case, the small groups are noise and must not be joined to a contact.
    """
    groups, count = ndimage.label(pressed, EIGHT_CONNECTED)
    groups = groups[pressed]
    sizes = np.bincount(groups, minlength=count + 1)[1:]
    means = np.bincount(groups, raised[pressed], count + 1)[1:] / sizes
    are_specks = (sizes < GROUP_TAXELS) & (means >= OUTLINE_SHARE * means[sizes.argmax()])
    return bool(np.count_nonzero(are_specks) > MOST_SPECKS)


def _significant(pressed: np.ndarray, strong: np.ndarray) -> np.ndarray:
    """Return ``pressed`` without the small groups that noise creates."""
    if not np.count_nonzero(pressed & ~strong):
        return pressed
    groups, count = ndimage.label(pressed, EIGHT_CONNECTED)
    keeps = np.bincount(groups.reshape(-1), minlength=count + 1) >= GROUP_TAXELS
    keeps[groups[pressed & strong]] = True
    keeps[0] = False
    return keeps[groups]


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
