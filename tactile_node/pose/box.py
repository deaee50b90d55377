"""Find the smallest rectangle around a contact of any shape, and detect hollow contacts."""

from typing import Any, NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.press import are_on_off
from tactile_node.contact.visibility import Visibility
from tactile_node.pose.evidence import holes
from tactile_node.pose.moments import check_pitch
from tactile_node.pose.rim import is_cut, reach, rim_of

LEAST_HOLE = 3           #: Smallest hole that counts [taxels]. A smaller gap may be noise.
LEAST_HOLE_SHARE = 0.06  #: Smallest hole that counts, as a share of the contact area including the hole.
IDLE_SHARE = 0.3         #: The mean reading in a hole is below this share of the contact's median reading.


def is_hollow(pattern: ContactPattern) -> bool:
    """Return True if the contact encloses visible taxels that are hardly pressed.

    A few weak taxels in a solid contact do not count as a hole. A gap that reaches the pad's edge does not count as a
    hole.
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


BOX_ANGLES = np.radians(np.arange(90.0))  #: Angles at which a rectangle is fitted around the contact [rad].
BOX_COSINES = np.cos(BOX_ANGLES)
BOX_SINES = np.sin(BOX_ANGLES)
QUARTER_TURN = np.pi / 2
# In each pair, the first standard deviation is for pressures and the second is for on/off or saturated taxels. The
# standard deviations were measured on contacts simulated with the training seeds (bench/bench_box.py at commit
# ecd333e6).
LENGTH_SD = (0.7, 0.45)  #: Standard deviation of a side length at a given angle [pitches].
CENTRE_SD = (0.2, 0.2)   #: Standard deviation of the centre at a given angle [pitches].
SIDE_SD = (0.2, 0.3)     #: Standard deviation of the change in side length between two angles [pitches].
ANGLE_SD = 0.02          #: Smallest standard deviation of the angle [rad].


class ContactBox(NamedTuple):
    """The smallest rectangle around a contact in the pad frame, with standard deviations.

    Every number is NaN if the pattern has no contact.
    """

    centre: tuple[float, float]   #: centre of the rectangle, or of its visible part if a length is a bound [m]
    angle: float                  #: direction of the long side, positive from x to y, in (-π/2, π/2] [rad]
    lengths: tuple[float, float]  #: long side, short side [m]
    centre_sd: float              #: standard deviation along x and along y [m]

    #: standard deviation of the direction of the sides [rad]. The sides repeat every quarter turn, so a value of 0.45
    #: means that all directions are equally likely.
    angle_sd: float
    lengths_sd: tuple[float, float]  #: standard deviation of each length [m]

    #: for each length, True if the contact may be longer because the pad's edge or hidden taxels cut it off
    length_is_bound: tuple[bool, bool]
    hollow: bool  #: True if the contact is a ring or a frame (`is_hollow`)


NOWHERE = ContactBox((np.nan, np.nan), np.nan, (np.nan, np.nan), np.nan, np.nan, (np.nan, np.nan), (False, False),
                     hollow=False)


def contact_box(pattern: ContactPattern, pitch: float = 1.0, visibility: Visibility | None = None) -> ContactBox:
    """Return the smallest rectangle around the contact of a pattern, or NOWHERE if the pattern has no contact.

    Parameters
    ----------
    pattern : ContactPattern
        Pattern of the frame.
    pitch : float
        Distance between neighbouring taxels. The lengths in the result have the unit of the pitch.
    visibility : Visibility or None
        Visibility of the pattern, or None to compute it from the pattern.

    Raises
    ------
    ConfigurationError
        Raised if ``pitch`` is not a finite length above 0.
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
    is_over = np.abs(away) > QUARTER_TURN / 2  # after a quarter turn, the two axes swap roles
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
    """Return the probability, (k,), that the smallest rectangle lies at each of the angles.

    ``lengths``, (2, k), holds the side lengths of the rectangle at each angle. The probabilities add up to 1.
    """
    area = lengths.prod(0)
    deviation = side_sd * np.sqrt(2 * np.square(lengths).sum(0))
    likely: np.ndarray = np.exp(-((area - area.min()) / deviation)**2 / 2)
    likely /= likely.sum()
    return likely


def _pair(values: np.ndarray) -> tuple[Any, Any]:
    first, second = values.tolist()
    return first, second
