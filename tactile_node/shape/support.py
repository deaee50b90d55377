"""How sure a name may be: no surer than what the taxels of the contact can decide, whatever the network says."""

import numpy as np

from tactile_node.contact.pattern import ContactPattern
from tactile_node.shape.patch import joined
from tactile_node.shape.recognition import Recognition, Shape, TaughtShape

SURE = 0.9            #: confidence from which a planner acts on a name
UNSUPPORTED = 0.85    #: confidence of a name that the taxels do not support, at most
#: Taxels that decide more than "a small contact". With 6,000 computed contacts of the five shapes (validation seeds),
#: less than 90 % of the sure squares and rectangles of fewer taxels were right. Triangles count as rectangles: the
#: computed ones were right, but real fingertips of 6 taxels are called triangles, too.
DECIDING_TAXELS = {Shape.SQUARE: 12, Shape.RECTANGLE: 9, Shape.RIGHT_TRIANGLE: 9, Shape.ISOSCELES_TRIANGLE: 9}


def as_far_as_supported(found: Recognition, pattern: ContactPattern) -> Recognition:
    """Return ``found``, no surer of its name than the taxels of ``pattern`` allow; the likeliest name stays.

    Nothing but a circle is certain from a few taxels.
    """
    if found.confidence < SURE or isinstance(found.shape, TaughtShape) or found.shape not in DECIDING_TAXELS:
        return found
    if np.count_nonzero(joined(pattern)) >= DECIDING_TAXELS[found.shape]:
        return found
    return found.no_surer_than(UNSUPPORTED)
