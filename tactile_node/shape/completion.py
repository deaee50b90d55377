"""What a contact may be where hidden taxels cover a part of it: the same frame with these taxels read in other ways.

If a recogniser answers all of them alike, the hidden taxels do not matter; if not, they decide, and it cannot be sure.
"""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import EIGHT_CONNECTED, grown
from tactile_node.contact.pattern import ContactPattern, in_line, number_contacts
from tactile_node.contact.visibility import Visibility
from tactile_node.taxel_frame import read_only

SCATTERED_SHARE = 0.1  #: of the ring: so many hidden taxels apart from each other are dead ones, which change little


def hidden_taxels_matter(pattern: ContactPattern, visibility: Visibility) -> bool:
    """Return whether more than single taxels are hidden within the contact or its ring, or many of the ring's.

    A few scattered ones are what the recogniser was trained with.
    """
    if not visibility.hidden_in_ring and not visibility.hidden_in_contact:
        return False
    if visibility.hidden_in_ring > SCATTERED_SHARE * visibility.ring:
        return True
    if visibility.largest_hidden == 1:
        return False
    labels, _ = ndimage.label(pattern.hidden, EIGHT_CONNECTED)
    sizes = np.bincount(labels.reshape(-1))
    return bool((sizes[labels[grown(pattern.mask) & pattern.hidden]] > 1).any())


def completions(pattern: ContactPattern) -> tuple[ContactPattern, ContactPattern, ContactPattern]:
    """Return the contact of ``pattern`` with its hidden taxels empty, pressed next to it, and pressed as it continues.

    It continues straight on, as far as taxels are hidden. A pressed taxel has the median value of the contact.
    """
    nowhere = np.zeros_like(pattern.hidden)
    beside = grown(pattern.mask) & pattern.hidden
    continued = _continued(pattern)
    pressed_beside = _completed(pattern, beside)
    as_beside = np.array_equal(continued, beside)
    return _completed(pattern, nowhere), pressed_beside, pressed_beside if as_beside else _completed(pattern, continued)


def distinct(patterns: Sequence[ContactPattern]) -> tuple[list[ContactPattern], list[int]]:
    """Return ``patterns`` without those that are the same object as one before, and the index of each among these."""
    indices: dict[int, int] = {}
    which = [indices.setdefault(id(pattern), len(indices)) for pattern in patterns]
    return [patterns[which.index(k)] for k in range(len(indices))], which


def _completed(pattern: ContactPattern, pressed: np.ndarray) -> ContactPattern:
    """Return ``pattern`` with its hidden taxels ``pressed`` or, the others, empty; its largest piece is the contact."""
    seen = pattern.mask & ~pattern.hidden
    level = np.median(pattern.values[seen])
    values = np.where(pattern.hidden, level * pressed, pattern.values)
    labels, pieces = number_contacts(seen | pressed, np.zeros_like(seen))
    completed = ContactPattern.of(read_only(labels == 1), read_only(values))
    return completed._replace(contacts=pattern.contacts + pieces - 1)


def _continued(pattern: ContactPattern) -> np.ndarray:
    """Return the hidden taxels that the contact covers when it continues along rows and columns, less thin spikes."""
    reached = pattern.mask.copy()
    for direction in in_line(pattern.mask & ~pattern.hidden, pattern.hidden):
        reached |= direction
    wide = ndimage.binary_opening(reached, np.ones((2, 2)))  # thin spikes are in no square of four
    return (wide | pattern.mask) & pattern.hidden
