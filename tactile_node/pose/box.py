"""The least rectangle around a contact: where it is and how large, whatever its shape; whether it is hollow."""

from typing import Any, NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.press import are_on_off
from tactile_node.contact.visibility import Visibility
from tactile_node.pose.evidence import holes
from tactile_node.pose.moments import check_pitch
from tactile_node.pose.rim import is_cut, reach, rim_of

LEAST_HOLE, LEAST_HOLE_SHARE = 3, 0.06  #: a smaller hole may be speckle [taxels, fraction of contact and hole]
IDLE_SHARE = 0.3  #: a hole reads less, relative to the contact's median


def is_hollow(pattern: ContactPattern) -> bool:
    """Return whether the contact of ``pattern`` encloses taxels that are seen and hardly pressed.

    A few weak taxels of a solid contact are no hole. One that the pad's edge cuts is not enclosed.
    """
    inside = holes(pattern.mask)
    if inside is None:
        return False
    labels, _ = ndimage.label(inside & ~pattern.hidden & ~pattern.unmapped)
    sizes = np.bincount(labels.reshape(-1))
    sizes[0] = 0
    largest = int(sizes.argmax())
    if sizes[largest] < max(LEAST_HOLE, LEAST_HOLE_SHARE * np.count_nonzero(pattern.mask | inside)):
        return False
    hole = pattern.values[labels == largest]
    return are_on_off(pattern.values) or bool(hole.mean() < IDLE_SHARE * np.nanmedian(pattern.values[pattern.mask]))


#: at which a rectangle is laid around the contact [rad]
BOX_ANGLES = np.radians(np.arange(90.0))
BOX_COSINES, BOX_SINES = np.cos(BOX_ANGLES), np.sin(BOX_ANGLES)
QUARTER_TURN = np.pi / 2
#: Standard deviations [pitches] of an angle's lengths, of the centre and of what a side of the rectangle varies by from
#: angle to angle: pressures, on/off or saturated taxels. On contacts of training seeds (bench/bench_box.py).
LENGTH_SD, CENTRE_SD, SIDE_SD = (0.7, 0.45), (0.2, 0.2), (0.2, 0.3)
ANGLE_SD = 0.02  #: at least [rad]


class ContactBox(NamedTuple):
    """The least rectangle around a contact, in the pad's frame, with standard deviations; NaN without a contact."""

    centre: tuple[float, float]       #: [m]; of what is seen where a length is a bound
    angle: float                      #: direction of the long side, x to y, in (-π/2, π/2] [rad]
    lengths: tuple[float, float]      #: long, short [m]
    centre_sd: float                  #: along x and along y [m]
    angle_sd: float  #: deviation of the sides, which are equal a quarter turn on [rad]; 0.45: any angle will do
    lengths_sd: tuple[float, float]   #: [m]
    length_is_bound: tuple[bool, bool]  #: the contact is cut by the pad's edge or by hidden taxels: it may be longer
    hollow: bool                      #: it is a ring or a frame (`is_hollow`)


NOWHERE = ContactBox((np.nan, np.nan), np.nan, (np.nan, np.nan), np.nan, np.nan, (np.nan, np.nan), (False, False),
                     hollow=False)


def contact_box(pattern: ContactPattern, pitch: float = 1.0, visibility: Visibility | None = None) -> ContactBox:
    """Return the box of the contact of ``pattern``; NOWHERE without one.

    ``pitch``: distance of neighbouring taxels; all lengths come in its unit. ``visibility`` of the pattern spares its
    computation where it is known.
    """
    check_pitch(pitch)
    if not pattern.mask.any():
        return NOWHERE
    rim = rim_of(pattern, visibility)
    kind = 0 if rim.graded else 1
    low, high = reach(rim, BOX_ANGLES).transpose(1, 0, 2)
    likely = _likelihood(high - low, SIDE_SD[kind])
    best = int(likely.argmax())
    away = BOX_ANGLES - BOX_ANGLES[best]
    is_over = np.abs(away) > QUARTER_TURN / 2  # a quarter turn on, the axes are the other ones
    sides = np.empty((5, len(BOX_ANGLES)))  # along and across, x and y of the centre, angle
    at_along, at_across = (high + low) / 2
    sides[:2] = high - low
    sides[2], sides[3] = at_along * BOX_COSINES - at_across * BOX_SINES, at_along * BOX_SINES + at_across * BOX_COSINES
    sides[:2, is_over] = sides[1::-1, is_over]
    sides[4] = away - is_over * np.copysign(QUARTER_TURN, away)
    middle = sides[:, best]
    along, across, x, y, turned = (sides - middle[:, np.newaxis])**2 @ likely  # variances
    lengths, lengths_sd = middle[:2], np.sqrt((LENGTH_SD[kind]**2 + along, LENGTH_SD[kind]**2 + across))
    is_bound, angle = is_cut(rim, BOX_ANGLES[best]), float(BOX_ANGLES[best])
    if lengths[1] > lengths[0]:
        lengths, lengths_sd, is_bound, angle = lengths[::-1], lengths_sd[::-1], is_bound[::-1], angle + QUARTER_TURN
    return ContactBox(
        centre=_pair(middle[2:4] * pitch), angle=angle if angle <= QUARTER_TURN else angle - np.pi,
        lengths=_pair(lengths * pitch), centre_sd=float(np.sqrt(CENTRE_SD[kind]**2 + max(x, y)) * pitch),
        angle_sd=float(np.sqrt(ANGLE_SD**2 + turned)), lengths_sd=_pair(lengths_sd * pitch),
        length_is_bound=_pair(is_bound), hollow=is_hollow(pattern))


def _likelihood(lengths: np.ndarray, side_sd: float) -> np.ndarray:
    """Return how likely each angle, (k,), is that of the least area of ``lengths``, (2, k); they sum to 1."""
    area = lengths.prod(0)
    deviation = side_sd * np.sqrt(2 * np.square(lengths).sum(0))
    likely: np.ndarray = np.exp(-((area - area.min()) / deviation)**2 / 2)
    likely /= likely.sum()
    return likely


def _pair(values: np.ndarray) -> tuple[Any, Any]:
    first, second = values.tolist()
    return first, second
