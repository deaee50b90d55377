"""Create several readings of a contact with hidden taxels, in which these taxels are empty or pressed.

If a recogniser reports the same shape for all readings, the hidden taxels do not matter. If the reported shapes differ,
the shape depends on the hidden taxels and is uncertain.
"""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import EIGHT_CONNECTED, grown
from tactile_node.contact.pattern import ContactPattern, in_line, number_contacts
from tactile_node.contact.visibility import Visibility
from tactile_node.taxel_frame import read_only

#: Up to this share of the ring around a contact, isolated hidden taxels are treated as dead taxels, which change
#: little.
SCATTERED_SHARE = 0.1


def hidden_taxels_matter(pattern: ContactPattern, visibility: Visibility) -> bool:
    """Return True if hidden taxels may change the shape of the contact.

    Hidden taxels matter if connected taxels are hidden within the contact or its ring, or if more than SCATTERED_SHARE
    of the ring is hidden. A few scattered hidden taxels do not matter, because the recogniser was trained with such
    taxels.
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
    """Return three readings of a contact with hidden taxels.

    In the first reading, the hidden taxels are empty. In the second reading, the hidden taxels next to the contact are
    pressed. In the third reading, the contact continues straight on along rows and columns as far as taxels are hidden.
    A hidden taxel that is read as pressed gets the median value of the contact.
    """
    nowhere = np.zeros_like(pattern.hidden)
    beside = grown(pattern.mask) & pattern.hidden
    continued = _continued(pattern)
    pressed_beside = _completed(pattern, beside)
    as_beside = np.array_equal(continued, beside)
    return _completed(pattern, nowhere), pressed_beside, pressed_beside if as_beside else _completed(pattern, continued)


def distinct(patterns: Sequence[ContactPattern]) -> tuple[list[ContactPattern], list[int]]:
    """Remove repeated objects from a list of patterns.

    Parameters
    ----------
    patterns : sequence of ContactPattern
        Patterns, some of which may be the same object.

    Returns
    -------
    kept : list of ContactPattern
        Each pattern object once, in order of first appearance.
    which : list of int
        Index in ``kept`` for each of ``patterns``.
    """
    indices: dict[int, int] = {}
    which = [indices.setdefault(id(pattern), len(indices)) for pattern in patterns]
    return [patterns[which.index(k)] for k in range(len(indices))], which


def _completed(pattern: ContactPattern, pressed: np.ndarray) -> ContactPattern:
    """Return ``pattern`` with the hidden taxels read as pressed or empty.

    The largest piece becomes the contact.
    """
    seen = pattern.mask & ~pattern.hidden
    level = np.median(pattern.values[seen])
    values = np.where(pattern.hidden, level * pressed, pattern.values)
    labels, pieces = number_contacts(seen | pressed, np.zeros_like(seen))
    completed = ContactPattern.of(read_only(labels == 1), read_only(values))
    return completed._replace(contacts=pattern.contacts + pieces - 1)


def _continued(pattern: ContactPattern) -> np.ndarray:
    """Return the hidden taxels that the contact covers if it continues along rows and columns, without thin spikes."""
    reached = pattern.mask.copy()
    for direction in in_line(pattern.mask & ~pattern.hidden, pattern.hidden):
        reached |= direction
    wide = ndimage.binary_opening(reached, np.ones((2, 2)))  # a thin spike contains no square of 2x2 taxels
    return (wide | pattern.mask) & pattern.hidden
