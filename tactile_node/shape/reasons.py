"""Find the reason why a contact has none of the five shapes."""

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import EIGHT_CONNECTED
from tactile_node.contact.pattern import ContactPattern
from tactile_node.shape.patch import joined
from tactile_node.shape.recognition import UnknownReason

COVERED_SHARE = 0.6  #: If a contact covers more than this share of the visible taxels, its outline is not visible.
HOLLOW_TAXELS = 3    #: Smallest number of taxels in a hole. Uneven gains can cause smaller holes.

#: A contact is cut by an edge of the pad if the number of its taxels at that edge exceeds this share of sqrt(taxels).
CUT_SHARE = 0.5


def why_unfamiliar(pattern: ContactPattern) -> UnknownReason:
    """Return the most obvious reason why a contact has none of the shapes.

    >>> why_unfamiliar(ContactPattern.of(np.eye(4) < 1, np.eye(4)))
    <UnknownReason.COVERS_PAD: 8>
    """
    contact = joined(pattern)
    taxels = np.count_nonzero(contact)
    seen = ~(pattern.hidden | pattern.unmapped)
    if taxels > COVERED_SHARE * np.count_nonzero(seen):
        return UnknownReason.COVERS_PAD
    if ndimage.label(contact, EIGHT_CONNECTED)[1] > 1:
        return UnknownReason.SEVERAL_PARTS
    if np.count_nonzero(ndimage.binary_fill_holes(contact) & ~contact & seen) >= HOLLOW_TAXELS:
        return UnknownReason.HOLLOW
    if max(map(np.count_nonzero, (contact[0], contact[-1], contact[:, 0], contact[:, -1]))) > CUT_SHARE * taxels ** 0.5:
        return UnknownReason.CUT_BY_EDGE
    return UnknownReason.UNFAMILIAR
