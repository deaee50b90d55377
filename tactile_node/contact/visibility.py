"""How much of a pad, and of what lies around a contact, a frame shows.

A hidden taxel belongs to the pad and has no valid value. What lies beyond the pad's edge, and places without a taxel,
are no part of the pad.
"""

from math import ceil
from typing import NamedTuple

import numpy as np

from tactile_node.contact.neighbours import grown, largest_group, pad_seen, sides_reached
from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.press import SMALLEST_CONTACT
from tactile_node.taxel_frame import NO_SIDE, SkinSide

CONTACT_PART = 0.1  #: of a contact's taxels: so many hidden ones together beside it may change its size by as much


class Visibility(NamedTuple):
    """Counts are in taxels; those of the contact and its ring are 0 where there is no contact."""

    pad_seen: bool             #: no group of hidden taxels has room for the smallest contact, and none is left over
    hidden: int                #: taxels of the pad
    largest_hidden: int        #: size of the largest 8-connected group of hidden taxels
    hidden_in_contact: int     #: enclosed by the contact and counted as a part of it
    hidden_in_ring: int        #: taxels of the ring, those next to the contact, also by a corner
    ring: int                  #: the whole ring, hidden taxels too
    saturated_in_contact: int
    saturated_in_ring: int
    at_edge: bool              #: the contact reaches the pad's edge, or a place without a taxel
    goes_on: bool              #: the finger goes on there beyond the skin: what presses on it is not measured
    #: a group of hidden taxels in the ring has room for the smallest contact, or for CONTACT_PART of this one: it may
    #: continue there. Fewer (scattered dead taxels) make its outline uncertain.
    outline_hidden: bool
    inside_hidden: bool        #: the contact encloses such a group: what presses there is not known

    @property
    def is_part(self) -> bool:
        """Whether a part of what presses is not measured: by hidden or saturated taxels, or beyond the skin."""
        return self.outline_hidden or self.inside_hidden or self.goes_on or self.saturated_in_contact > 0


def visibility_of(pattern: ContactPattern, smallest_contact: int = SMALLEST_CONTACT,
                  finger_ends: SkinSide = NO_SIDE) -> Visibility:
    """Return what is seen of the pad and of the mask of ``pattern``; ``smallest_contact`` [taxels].

    ``finger_ends``: the sides at which the finger ends with the skin.

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
    """Return the ring of the contact, whether the contact reaches the end of the pad, and whether the finger goes on.

    Where the pad has no taxel, it does.
    """
    mask = pattern.mask
    around = grown(mask) & ~mask
    beyond, sides = bool((around & pattern.unmapped).any()), sides_reached(mask)
    return around & ~pattern.unmapped, beyond or bool(sides), beyond or bool(sides & ~finger_ends)
