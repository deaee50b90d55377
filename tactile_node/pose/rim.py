"""Locate the rim of a contact more finely than its taxels, and find how far the rim reaches along an axis.

All lengths are in pitches. The rim is located along rows and columns, between a taxel of the contact and a taxel beside
the contact. At the rim, the interpolated values are half of the contact's local level. Next to hidden taxels, the pad's
edge and cells without a taxel, the rim is the border of the last visible taxel, and the contact may continue.
"""

from typing import NamedTuple

import numpy as np

from tactile_node.contact.neighbours import framed, grown, sum_around
from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.press import are_on_off
from tactile_node.contact.visibility import Visibility, visibility_of

NEIGHBOUR_STEPS = np.array(((1, 0), (-1, 0), (0, 1), (0, -1)))  #: Steps to the four neighbours, (x, y).

#: Within this many rows and columns of an unseen cell, the rim does not count as an end of the contact.
UNSEEN_REACH = 1.5
#: Reading of the outermost taxels relative to inner taxels under an even pressure. The share is below 1, because the
#: contact covers the outermost taxels only in part.
EVEN_SHARE = 0.75
STEEPNESS_RANGE = (0.4, 1.8)  #: Smallest and largest value that `_steepness` returns.

#: Largest variation of a straight rim. If two points on the rim differ by less than this along an axis, they count as
#: equally far out.
STRAIGHT_TOLERANCE = 0.35


class Rim(NamedTuple):
    """Points on a contact's rim in the pad frame."""

    places: np.ndarray  #: x, y, (n, 2)
    is_end: np.ndarray  #: True where the contact ends, because no unseen cell is near, bool (n,)
    graded: bool        #: True if the taxels measure pressure and no taxel of the contact is saturated


def rim_of(pattern: ContactPattern, visibility: Visibility | None = None) -> Rim:
    """Return the rim of a contact.

    Hidden taxels count as unseen cells if the contact may continue in them (`Visibility.outline_hidden`). Single hidden
    taxels only make the rim less certain.

    Parameters
    ----------
    pattern : ContactPattern
        Pattern of a frame with a contact.
    visibility : Visibility or None
        Visibility of the pattern, or None to compute it from the pattern.
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
    """Return how far the rim reaches along axes at ``angles``, (k,), and across them.

    The result has the shape (2, 2, k). The first index is the axis. The second index is the end: 0 for the lower end, 1
    for the higher end.
    """
    along = _along(rim, angles)
    ends = np.empty((2, 2, len(angles)))
    np.minimum.reduce(along, 0, out=ends[:, 0])
    np.maximum.reduce(along, 0, out=ends[:, 1])
    return ends


def ends_seen(rim: Rim, angle: float) -> np.ndarray:
    """Return which ends of the contact, along ``angle`` and across it, are seen, as bool (2, 2).

    The first index is the axis. The second index is the end: 0 for the lower end, 1 for the higher end. An end is seen
    if the rim reaches it at a point that is not near unseen cells. For example, if a bar extends beyond the pad, its
    two flanks are seen.
    """
    if rim.is_end.all():
        return np.ones((2, 2), bool)
    along = _along(rim, np.array([angle]))[..., 0]
    ends = along[rim.is_end]
    low, high = along.min(0) + STRAIGHT_TOLERANCE, along.max(0) - STRAIGHT_TOLERANCE
    return np.stack(((ends <= low).any(0), (ends >= high).any(0)), 1)


def is_cut(rim: Rim, angle: float) -> np.ndarray:
    """Return True for each axis along which the contact may continue beyond an end.

    The first axis lies along ``angle``, and the second axis lies across it. The result is bool (2,).
    """
    cut: np.ndarray = np.logical_and.reduce(ends_seen(rim, angle), 1) == 0
    return cut


def _along(rim: Rim, angles: np.ndarray) -> np.ndarray:
    """Return the coordinates of the rim's points along and across axes at ``angles``, (n, 2, k)."""
    cos, sin = np.cos(angles), np.sin(angles)
    axes = np.array(((cos, -sin), (sin, cos)))
    along: np.ndarray = rim.places @ axes.reshape(2, -1)
    return along.reshape(-1, 2, len(angles))


def _are_near(taxels: np.ndarray, others: np.ndarray, cols: int) -> np.ndarray:
    """Return True for each of ``taxels`` that is within UNSEEN_REACH of one of ``others``.

    ``taxels`` and ``others`` are flat indices into rows of ``cols`` taxels.
    """
    if not len(others):
        return np.zeros(len(taxels), bool)
    apart = [np.abs(of[:, np.newaxis] - to) for of, to in zip(np.divmod(taxels, cols), np.divmod(others, cols))]
    return (np.maximum(*apart) <= UNSEEN_REACH).any(1)


def _level(inside: np.ndarray) -> np.ndarray:
    """Return the local level of a contact around each taxel, as a mean that gives high values more weight."""
    total = sum_around(inside)
    return sum_around(inside * inside) / np.where(total > 0, total, 1.0)


def _steepness(values: np.ndarray, contact: np.ndarray) -> float:
    """Return the reading of the outermost taxels of a contact relative to their reading under an even pressure.

    Under a sharp edge, the outermost taxels read more, and the skin spreads the pressure outwards. Under a dome, the
    outermost taxels read less.
    """
    inner = ~grown(~contact)
    deep = float(values[inner].mean()) if inner.any() else 0.0
    return float(np.clip(values[contact & ~inner].mean() / (EVEN_SHARE * deep), *STEEPNESS_RANGE)) if deep > 0 else 1.0
