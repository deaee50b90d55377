"""Whether a contact presses with its rim alone, as a ring or a frame does."""

import numpy as np
from scipy import ndimage

from tactile_node.contact.on_off import are_on_off
from tactile_node.contact.pattern import ContactPattern
from tactile_node.pose.evidence import holes

LEAST_HOLE, OF_CONTACT = 3, 0.06  #: a smaller hole may be speckle [taxels, fraction of contact and hole]
IDLE = 0.3  #: a hole reads less, relative to the contact's median


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
    if sizes[largest] < max(LEAST_HOLE, OF_CONTACT * np.count_nonzero(pattern.mask | inside)):
        return False
    hole = pattern.values[labels == largest]
    return are_on_off(pattern.values) or bool(hole.mean() < IDLE * np.nanmedian(pattern.values[pattern.mask]))
