"""The smallest rectangle around a contact of any shape, and a check that finds hollow contacts."""

from typing import Any, NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.press import are_on_off
from tactile_node.contact.visibility import Visibility
from tactile_node.pose.evidence import holes
from tactile_node.pose.moments import check_pitch
from tactile_node.pose.rim import is_cut, reach, rim_of

LEAST_HOLE = 3           #: Smallest number of taxels of a hole; a smaller one may be speckle.
LEAST_HOLE_SHARE = 0.06  #: Smallest area of a hole, as a share of the contact together with the hole.
IDLE_SHARE = 0.3         #: A hole reads less than this share of the contact's median.


def is_hollow(pattern: ContactPattern) -> bool:
    """Return True if the contact encloses visible taxels that are hardly pressed.

    A few weak taxels in a solid contact are not a hole. A hole that the pad's edge cuts is not enclosed.
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


BOX_ANGLES = np.radians(np.arange(90.0))  #: Angles at which rectangles are laid around the contact [rad].
BOX_COSINES = np.cos(BOX_ANGLES)
BOX_SINES = np.sin(BOX_ANGLES)
QUARTER_TURN = np.pi / 2
# Each pair of standard deviations holds first for pressures, then for on/off or saturated taxels. They were measured on
# contacts of training seeds (bench/bench_box.py).
LENGTH_SD = (0.7, 0.45)  #: Standard deviation of a length at a given angle [pitches].
CENTRE_SD = (0.2, 0.2)   #: Standard deviation of the centre at a given angle [pitches].
SIDE_SD = (0.2, 0.3)     #: Standard deviation by which a side of the rectangle varies from angle to angle [pitches].
ANGLE_SD = 0.02          #: Smallest standard deviation of the angle [rad].


class ContactBox(NamedTuple):
    """The smallest rectangle around a contact, in the pad's frame, with standard deviations; NaN without a contact."""

    centre: tuple[float, float]   #: centre of the rectangle [m]; of its visible part if a length is a bound
    angle: float                  #: direction of the long side, from x to y, in (-π/2, π/2] [rad]
    lengths: tuple[float, float]  #: long side, short side [m]
    centre_sd: float              #: standard deviation along x and along y [m]
    #: standard deviation of the direction of the sides [rad]; 0.45 if all angles are equally likely, because the sides
    #: repeat every quarter turn
    angle_sd: float
    lengths_sd: tuple[float, float]  #: standard deviation of each length [m]
    #: True if the pad's edge or hidden taxels cut the contact, so that it may be longer
    length_is_bound: tuple[bool, bool]
    hollow: bool  #: True if the contact is a ring or a frame (`is_hollow`)


NOWHERE = ContactBox((np.nan, np.nan), np.nan, (np.nan, np.nan), np.nan, np.nan, (np.nan, np.nan), (False, False),
                     hollow=False)


def contact_box(pattern: ContactPattern, pitch: float = 1.0, visibility: Visibility | None = None) -> ContactBox:
    """Return the smallest rectangle around the contact of a pattern; NOWHERE if the pattern has no contact.

    Parameters
    ----------
    pattern : ContactPattern
        Pattern of the frame.
    pitch : float
        Distance of neighbouring taxels. All lengths of the result are in its unit.
    visibility : Visibility or None
        Visibility of the pattern if the caller knows it; None to compute it.

    Raises
    ------
    ConfigurationError
        If ``pitch`` is not a finite length above 0.
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
    is_over = np.abs(away) > QUARTER_TURN / 2  # after a quarter turn, the two axes exchange their roles
    sides = np.empty((5, len(BOX_ANGLES)))  # lengths along and across, x and y of the centre, angle
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
    """Return the probability that each angle, (k,), is the angle of the smallest rectangle; the sum is 1.

    ``lengths``, (2, k), are the sides of the rectangle at each angle.
    """
    area = lengths.prod(0)
    deviation = side_sd * np.sqrt(2 * np.square(lengths).sum(0))
    likely: np.ndarray = np.exp(-((area - area.min()) / deviation)**2 / 2)
    likely /= likely.sum()
    return likely


def _pair(values: np.ndarray) -> tuple[Any, Any]:
    first, second = values.tolist()
    return first, second
