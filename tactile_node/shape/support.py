"""How sure a name may be: no surer than what the taxels of the contact can decide, whatever the network says."""

import numpy as np

from tactile_node.contact.neighbours import reached
from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.press import are_on_off
from tactile_node.shape.likeness import FIGURES
from tactile_node.shape.patch import joined
from tactile_node.shape.recognition import Recognition, Shape, TaughtShape, UnknownReason

SURE = 0.9            #: confidence from which a planner acts on a name
UNSUPPORTED = 0.85    #: confidence of a name that the taxels do not support, at most
#: Taxels that decide more than "a small contact". With 6,000 computed contacts of the five shapes (validation seeds),
#: less than 90 % of the sure squares and rectangles of fewer taxels were right. Triangles count as rectangles: the
#: computed ones were right, but real fingertips of 6 taxels are called triangles, too.
DECIDING_TAXELS = {Shape.SQUARE: 12, Shape.RECTANGLE: 9, Shape.RIGHT_TRIANGLE: 9, Shape.ISOSCELES_TRIANGLE: 9}
#: the figure of `likeness` that is laid over a contact of each shape
FIGURE_OF = {Shape.CIRCLE: 'disc', Shape.SQUARE: 'square', Shape.RECTANGLE: 'rectangle',
             Shape.RIGHT_TRIANGLE: 'triangle', Shape.ISOSCELES_TRIANGLE: 'triangle'}
FIGURE_TAXELS = 40    #: taxels of a contact whose overlap with a figure is no matter of its rim alone
#: Overlap of such a contact with the figure of its name. On the open arrays and with our computed contacts, 39 of 56
#: sure names that were wrong or foreign had less, and 29 of 433 that were right.
LEAST_OVERLAP = 0.65
#: Taxels that show corners under uneven gains. Of 250 computed squares with gains of 3:1, the network called 31
#: circles; a square covered most of these better, and none of as many circles.
CORNER_TAXELS = 80
#: Overlap by which a disc covers a large circle better than a square does. Of those 31, 30 had less; of circles under
#: the same gains, a tenth.
CLEARLY_ROUNDER = 0.02
LOW_SHARE = 0.2       #: of the contact's mean: a low outline, along which most uneven contacts are whole
LEAST_HELD = 0.5      #: probability of a sure name along the low outline


def as_far_as_supported(found: Recognition, pattern: ContactPattern) -> Recognition:
    """Return ``found``, no surer of its name than the number of taxels of ``pattern`` allows; the likeliest name stays.

    Nothing but a circle is certain from a few taxels.
    """
    if not _is_sure(found) or found.shape not in DECIDING_TAXELS:
        return found
    if np.count_nonzero(joined(pattern)) >= DECIDING_TAXELS[found.shape]:
        return found
    return found.no_surer_than(UNSUPPORTED, UnknownReason.TOO_SMALL)


def as_far_as_it_fits(found: Recognition, taxels: int, overlaps: np.ndarray) -> Recognition:
    """Return ``found``, no surer of its name than the overlap with the figure of that name allows.

    ``taxels``: of the contact; ``overlaps``: with each of FIGURES. The figure must cover the contact, and no other
    figure better. A square is a rectangle, too. A large circle that a square covers better is called a square.
    """
    if not _is_sure(found) or taxels < FIGURE_TAXELS:
        return found
    square, disc = (overlaps[FIGURES.index(figure)] for figure in ('square', 'disc'))
    if found.shape is Shape.CIRCLE and taxels >= CORNER_TAXELS and disc < square + CLEARLY_ROUNDER:
        found = found.exchanged(Shape.CIRCLE, Shape.SQUARE) if square > max(disc, LEAST_OVERLAP) else found
        return found.no_surer_than(UNSUPPORTED, UnknownReason.UNFAMILIAR)
    own = FIGURE_OF[Shape(found.shape)]
    others = [overlap for figure, overlap in zip(FIGURES, overlaps)
              if figure != own and (own, figure) != ('square', 'rectangle')]
    overlap = overlaps[FIGURES.index(own)]
    if overlap >= max(LEAST_OVERLAP, *others):
        return found
    return found.no_surer_than(UNSUPPORTED, UnknownReason.UNFAMILIAR)


def as_far_as_it_holds(found: Recognition, low: Recognition) -> Recognition:
    """Return ``found``, no surer of its name than that name holds in ``low``, of the `low_outline` of the contact.

    Half of the level breaks an object that presses unevenly, and a fragment may look like one of the shapes.
    """
    if not _is_sure(found) or low.probabilities[found.shape] >= LEAST_HELD:
        return found
    return found.no_surer_than(UNSUPPORTED, UnknownReason.UNSTABLE)


def low_outline(values: np.ndarray, mask: np.ndarray) -> np.ndarray | None:
    """Return the contact ``mask`` with the weak pressures joined to it, bool (rows, cols); None where there are none.

    ``values``: of the frame, NaN: no valid value.
    """
    inside = values[mask & np.isfinite(values)]
    if not inside.size or are_on_off(values):
        return None
    wide = mask | (values >= LOW_SHARE * inside.mean())
    low = reached(mask, wide)
    return low if np.count_nonzero(low) > np.count_nonzero(mask) else None


def _is_sure(found: Recognition) -> bool:
    """Return whether ``found`` is sure of one of the five names."""
    return not isinstance(found.shape, TaughtShape) and found.shape in FIGURE_OF and found.confidence >= SURE
