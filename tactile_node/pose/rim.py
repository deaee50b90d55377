"""The rim of a contact, finer than its taxels, and how far it reaches along an axis. Lengths are in pitches.

Along rows and columns, the rim is where values, interpolated between a taxel of the contact and one beside it, are half
of the contact's own level there. Next to what is not seen (hidden taxels, the pad's edge, places without a taxel) it is
the border of the last taxel that is seen, and the contact may go on.
"""

from typing import NamedTuple

import numpy as np

from tactile_node.contact.neighbours import framed, grown, sum_around
from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.press import are_on_off
from tactile_node.contact.visibility import Visibility, visibility_of

NEIGHBOUR_STEPS = np.array(((1, 0), (-1, 0), (0, 1), (0, -1)))  #: to the neighbours, (x, y)
UNSEEN_REACH = 1.5      #: farther from what is not seen, along rows and columns, the rim is an end of the contact
EVEN_SHARE = 0.75      #: share of what deeper taxels read, the outermost under an even pressure: it covers them in part
STEEPNESS_RANGE = (0.4, 1.8)  #: least and most, see `_steepness`
STRAIGHT_TOLERANCE = 0.35    #: less than the farthest place, others reach as far: what a straight rim varies by


class Rim(NamedTuple):
    """Places of a contact's rim in the pad's frame."""

    places: np.ndarray  #: x, y, (n, 2)
    is_end: np.ndarray  #: bool, (n,): the contact ends there; what is not seen is away
    graded: bool        #: between pressures, none of them saturated; on/off taxels know less


def rim_of(pattern: ContactPattern, visibility: Visibility | None = None) -> Rim:
    """Return the rim of the contact of ``pattern``, which has a taxel; ``visibility`` of it, None: not known yet.

    Hidden taxels count as not seen where the contact may continue there (`Visibility.outline_hidden`); single ones make
    the rim less certain.
    """
    graded = not are_on_off(pattern.values)
    mask, seen = framed(pattern.mask), framed(~(pattern.hidden | pattern.unmapped))
    ends = seen
    if pattern.hidden.any() and not (visibility or visibility_of(pattern)).outline_hidden:
        ends = framed(~pattern.unmapped)
    values = framed(np.fmax(pattern.values, 0.0) if graded else pattern.mask.astype(float))
    half = 0.5 * _level(values * mask)
    if graded:
        half *= _steepness(values, mask & seen)
    mask, seen, ends = (taxels.reshape(-1) for taxels in (mask, seen, ends))
    values, half = values.reshape(-1), half.reshape(-1)
    cols = pattern.mask.shape[1] + 2
    at = np.flatnonzero(mask)
    beside = at[:, np.newaxis] + (1, -1, cols, -cols)
    taxel, step = np.nonzero(~mask[beside])
    inner, outer = at[taxel], beside[taxel, step]
    fall, ends = values[inner] - values[outer], ends[outer]
    is_known = seen[outer] & seen[inner] & (fall > 0)
    share = np.where(is_known, (values[inner] - half[inner]) / np.where(is_known, fall, 1.0), 0.5)
    row, col = np.divmod(inner, cols)
    places = np.minimum(np.maximum(share, -0.5), 1.0)[:, np.newaxis] * NEIGHBOUR_STEPS[step]
    places[:, 0] += col - 1
    places[:, 1] += row - 1
    return Rim(places, ends & ~_are_near(outer, outer[~ends], cols),
               graded and not (pattern.saturated & pattern.mask).any())


def reach(rim: Rim, angles: np.ndarray) -> np.ndarray:
    """Return from where to where the rim reaches along axes at ``angles``, (k,), and across them: (2, 2, k).

    The first index is the axis, the second the end: the lower one, the higher one.
    """
    along = _along(rim, angles)
    ends = np.empty((2, 2, len(angles)))
    np.minimum.reduce(along, 0, out=ends[:, 0])
    np.maximum.reduce(along, 0, out=ends[:, 1])
    return ends


def ends_seen(rim: Rim, angle: float) -> np.ndarray:
    """Return whether the contact is seen to end along ``angle`` and across it, at the low and high end: bool (2, 2).

    An end is seen where the rim reaches as far away from all that is not seen, as the flank of a bar does that leaves
    the pad.
    """
    if rim.is_end.all():
        return np.ones((2, 2), bool)
    along = _along(rim, np.array([angle]))[..., 0]
    ends = along[rim.is_end]
    low, high = along.min(0) + STRAIGHT_TOLERANCE, along.max(0) - STRAIGHT_TOLERANCE
    return np.stack(((ends <= low).any(0), (ends >= high).any(0)), 1)


def is_cut(rim: Rim, angle: float) -> np.ndarray:
    """Return whether the contact may go on beyond either end along ``angle``, and across it: bool (2,)."""
    cut: np.ndarray = np.logical_and.reduce(ends_seen(rim, angle), 1) == 0
    return cut


def _along(rim: Rim, angles: np.ndarray) -> np.ndarray:
    """Coordinates of the places along and across axes at ``angles``, (n, 2, k)."""
    cos, sin = np.cos(angles), np.sin(angles)
    axes = np.array(((cos, -sin), (sin, cos)))
    along: np.ndarray = rim.places @ axes.reshape(2, -1)
    return along.reshape(-1, 2, len(angles))


def _are_near(taxels: np.ndarray, others: np.ndarray, cols: int) -> np.ndarray:
    """Return which of ``taxels`` are within UNSEEN_REACH of one of ``others``, all as numbers in rows of ``cols``."""
    if not len(others):
        return np.zeros(len(taxels), bool)
    apart = [np.abs(of[:, np.newaxis] - to) for of, to in zip(np.divmod(taxels, cols), np.divmod(others, cols))]
    return (np.maximum(*apart) <= UNSEEN_REACH).any(1)


def _level(inside: np.ndarray) -> np.ndarray:
    """Return the level of a contact around each taxel: a mean of its values in which high ones count more."""
    total = sum_around(inside)
    return sum_around(inside * inside) / np.where(total > 0, total, 1.0)


def _steepness(values: np.ndarray, contact: np.ndarray) -> float:
    """Return how much more the outermost taxels of ``contact`` read than an even pressure's, 1: as much.

    Under a sharp edge they read more, and the skin spreads that outwards; under a dome they read less.
    """
    inner = ~grown(~contact)
    deep = float(values[inner].mean()) if inner.any() else 0.0
    return float(np.clip(values[contact & ~inner].mean() / (EVEN_SHARE * deep), *STEEPNESS_RANGE)) if deep > 0 else 1.0
