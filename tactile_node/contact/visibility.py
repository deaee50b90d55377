"""Measure how much a frame shows of a pad and of the surroundings of a contact.

A hidden taxel belongs to the pad and has no valid value. Places beyond the pad's edge and places without a taxel do not
belong to the pad.
"""

from math import ceil
from typing import NamedTuple

import numpy as np

from tactile_node.contact.neighbours import grown, largest_group, pad_seen, sides_reached
from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.press import SMALLEST_CONTACT
from tactile_node.taxel_frame import NO_SIDE, SkinSide

#: Share of a contact's taxels. If that many connected taxels beside the contact are hidden, the size of the contact may
#: be wrong by this share.
CONTACT_PART = 0.1


class Visibility(NamedTuple):
    """Visibility of a pad and of its largest contact. Counts are numbers of taxels.

    The ring of a contact consists of all taxels next to it, including those at its corners. Without a contact, the
    counts of the contact and of its ring are 0.
    """

    #: True if no group of hidden taxels has room for the smallest contact, and nothing else may hide a contact
    pad_seen: bool
    hidden: int             #: hidden taxels of the pad
    largest_hidden: int     #: size of the largest 8-connected group of hidden taxels
    hidden_in_contact: int  #: hidden taxels that the contact encloses and that count as part of it
    hidden_in_ring: int     #: hidden taxels of the ring
    ring: int               #: all taxels of the ring, including hidden ones
    saturated_in_contact: int
    saturated_in_ring: int
    at_edge: bool  #: True if the contact reaches the pad's edge or a place without a taxel

    #: True if the finger continues beyond the skin at the contact, so that a part of the load may not be measured
    goes_on: bool
    #: True if the contact may continue in hidden taxels of the ring, because a group of hidden taxels has room for the
    #: smallest contact or for CONTACT_PART of this contact. Fewer hidden taxels, such as scattered dead ones, only make
    #: the outline uncertain.
    outline_hidden: bool
    #: True if the contact encloses a group of hidden taxels of at least that size, so that their load is unknown
    inside_hidden: bool

    @property
    def is_part(self) -> bool:
        """True if a part of the load is not measured.

        Such a part lies under hidden or saturated taxels or beyond the skin.
        """
        return self.outline_hidden or self.inside_hidden or self.goes_on or self.saturated_in_contact > 0


def visibility_of(pattern: ContactPattern, smallest_contact: int = SMALLEST_CONTACT,
                  finger_ends: SkinSide = NO_SIDE) -> Visibility:
    """Return how much a frame shows of the pad and of the contact in its mask.

    Parameters
    ----------
    pattern : ContactPattern
        Pattern of the frame.
    smallest_contact : int
        Size of the smallest contact that is reported [taxels].
    finger_ends : SkinSide
        Sides at which the finger ends together with the skin.

    Examples
    --------
    >>> values = np.full((4, 4), np.nan)
    >>> visibility_of(ContactPattern.of(values > 0, values)).pad_seen
    False
    """
    hidden = int(np.count_nonzero(pattern.hidden))
    is_seen = not pattern.may_hide_contact and pad_seen(pattern.hidden, pattern.unmapped, smallest_contact)
    mask = pattern.mask
    ring, at_edge, goes_on = _around(pattern, finger_ends)
    room = min(smallest_contact, ceil(CONTACT_PART * np.count_nonzero(mask)))
    return Visibility(
        pad_seen=is_seen, hidden=hidden,
        largest_hidden=largest_group(pattern.hidden),
        hidden_in_contact=int(np.count_nonzero(mask & pattern.hidden)) if hidden else 0,
        hidden_in_ring=int(np.count_nonzero(ring & pattern.hidden)) if hidden else 0,
        ring=int(np.count_nonzero(ring)), saturated_in_contact=int(np.count_nonzero(mask & pattern.saturated)),
        saturated_in_ring=int(np.count_nonzero(ring & pattern.saturated)), at_edge=at_edge, goes_on=goes_on,
        outline_hidden=0 < room <= largest_group(pattern.hidden, ring),
        inside_hidden=0 < room <= largest_group(pattern.hidden & mask))


def _around(pattern: ContactPattern, finger_ends: SkinSide) -> tuple[np.ndarray, bool, bool]:
    """Return the ring of the contact, and two flags.

    The flags are True if the contact reaches the end of the pad, and if the finger continues beyond that end. A place
    without a taxel counts as an end of the pad beyond which the finger continues.
    """
    mask = pattern.mask
    around = grown(mask) & ~mask
    beyond, sides = bool(np.count_nonzero(around & pattern.unmapped)), sides_reached(mask)
    return around & ~pattern.unmapped, beyond or bool(sides), beyond or bool(sides & ~finger_ends)
