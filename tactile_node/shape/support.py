"""Limit the confidence in a shape to the level that the taxels of the contact support.

The taxels must be many enough, must be covered by the figure of the shape, must also show the shape along a lower
outline, and must fill their convex hull. The five shapes are convex. Hooks, bows and scattered pieces are not convex.
On/off taxels must be pressed throughout their hull or only along its rim, and the edges of the pad must not be the
sides of the shape.
"""

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import EIGHT_CONNECTED, box_of, reached
from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.press import are_on_off
from tactile_node.shape.invariants import FIGURES
from tactile_node.shape.patch import joined
from tactile_node.shape.recognition import Recognition, Shape, TaughtShape, UnknownReason
from tactile_node.shape.shapeless import edges_that_cut

SURE = 0.9          #: Smallest confidence with which a planner acts on a shape.
UNSUPPORTED = 0.85  #: Highest confidence in a shape that the taxels do not support.

#: Number of taxels that a contact needs for a confident recognition. The numbers were chosen with 6,000 simulated
#: contacts of the five shapes (validation seeds). With fewer taxels, less than 90 % of the confident squares and
#: rectangles were correct. Triangles have the same limit as rectangles. The simulated triangles were correct, but real
#: fingertips of 6 taxels are also recognised as triangles.
DECIDING_TAXELS = {Shape.SQUARE: 12, Shape.RECTANGLE: 9, Shape.RIGHT_TRIANGLE: 9, Shape.ISOSCELES_TRIANGLE: 9}
#: Figure of `invariants.FIGURES` with which a contact of each shape is compared.
FIGURE_OF = {Shape.CIRCLE: 'disc', Shape.SQUARE: 'square', Shape.RECTANGLE: 'rectangle',
             Shape.RIGHT_TRIANGLE: 'triangle', Shape.ISOSCELES_TRIANGLE: 'triangle'}
FIGURE_TAXELS = 40  #: With this many taxels or more, the overlap with a figure depends on more than the rim.

#: Smallest overlap with the figure of its shape for a confident recognition of a contact with FIGURE_TAXELS or more. On
#: the open arrays and with simulated contacts, 39 of 56 confident recognitions of wrong or foreign shapes had less
#: overlap. Only 29 of 433 correct recognitions had less overlap.
LEAST_OVERLAP = 0.65
#: Number of taxels from which corners are visible even if the gains are uneven. Of 250 simulated squares with gains of
#: 3:1, the network recognised 31 as circles. A square covered most of these 31 contacts better than a disc. None of 250
#: circles was covered better by a square.
CORNER_TAXELS = 80
#: Difference in overlap by which a disc must cover a large circle better than a square does. The difference was smaller
#: for 30 of the 31 squares that the network recognised as circles, and for a tenth of the circles with the same gains.
CLEARLY_ROUNDER = 0.02
#: Share of the contact's mean at which the low outline is drawn. Within the low outline, most uneven contacts hold
#: together.
LOW_SHARE = 0.2
LEAST_HELD = 0.5  #: Probability that a confident shape must also have along the low outline.

#: Sizes of the inner and of the central part of an on/off contact's hull, as shares of the size of the hull.
INNER_SIZE = 0.7
CENTRAL_SIZE = 0.4
#: A solid contact presses at least this share of the inner part.
SOLID_INSIDE = 0.7
#: A contact that presses only along its rim presses at most this share of the central part. This limit and SOLID_INSIDE
#: were chosen with 9,387 simulated contacts with faulty taxels, lines, edges or holes. Only 5 of these contacts are
#: neither solid nor a rim, but 158 of 169 spirals that the network recognised with high confidence are.
RIM_CENTRE = 0.3

#: Smallest share of its hull that each of the five shapes fills, after small gaps are closed and rims are filled. The
#: value was chosen on the validation seeds.
LEAST_CONVEXITY = 0.7
PARTIAL_LEVEL = 0.2  #: Taxels with a pressure above this share of the contact's mean belong to the contact.
HULL_ANGLES = np.radians(np.arange(0.0, 180.0, 7.5))  #: Directions in which the hull is measured [rad].
HULL_AXES = np.stack((np.cos(HULL_ANGLES), np.sin(HULL_ANGLES)))  #: Unit vector of each direction, one per column.
HULL_ROUNDING = 0.01  #: Points up to this distance outside the hull count as inside [pitches].


def as_far_as_supported(found: Recognition, pattern: ContactPattern) -> Recognition:
    """Return ``found`` with its confidence limited by the number of taxels of ``pattern``.

    The most probable shape does not change. With few taxels, only a circle can be recognised with high confidence.
    """
    if not _is_sure(found) or found.shape not in DECIDING_TAXELS:
        return found
    if np.count_nonzero(joined(pattern)) >= DECIDING_TAXELS[found.shape]:
        return found
    return found.no_surer_than(UNSUPPORTED, UnknownReason.TOO_SMALL)


def as_far_as_it_fits(found: Recognition, taxels: int, overlaps: np.ndarray) -> Recognition:
    """Return a recognition with its confidence limited by the overlap with the figure of its shape.

    The figure must cover the contact, and no other figure may cover the contact better. A rectangle may cover a square
    better, because a square is also a rectangle. If a square covers a large circle better than a disc does, the contact
    is reported as a square.

    Parameters
    ----------
    found : Recognition
        Recognition of the contact.
    taxels : int
        Number of taxels of the contact.
    overlaps : np.ndarray
        Overlap with each of FIGURES.
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


def as_far_as_it_is_filled(found: Recognition, values: np.ndarray, mask: np.ndarray) -> Recognition:
    """Return the recognition of an on/off contact with its confidence limited by how the contact fills its hull.

    Each of the five shapes is either solid or pressed only along its rim. A contact with a pressed centre and large
    gaps around the centre, for example a spiral, is neither.

    Parameters
    ----------
    found : Recognition
        Recognition of the contact.
    values : np.ndarray
        Taxel values of the frame, float (rows, cols), with NaN for a missing value. Taxels without a value do not count
        as gaps.
    mask : np.ndarray
        Taxels of the contact, bool (rows, cols).
    """
    if not _is_sure(found) or np.count_nonzero(mask) < FIGURE_TAXELS:
        return found
    inside, centre = _filled_inside(mask, mask | np.isfinite(values), (INNER_SIZE, CENTRAL_SIZE))
    if inside >= SOLID_INSIDE or centre <= RIM_CENTRE:
        return found
    return found.no_surer_than(UNSUPPORTED, UnknownReason.UNFAMILIAR)


def as_far_as_no_edge_shapes_it(found: Recognition, mask: np.ndarray) -> Recognition:
    """Return the recognition of an on/off contact with its confidence limited by the edges of the pad that cut it.

    Two edges that meet give the visible part of any contact a right angle and two straight sides, so it may look like a
    rectangle. Two opposite edges hide both ends of a rectangle, so its visible part may look like a square. With
    computed contacts (validation seeds), 40 of 86 confident rectangles and 9 of 22 confident squares that were cut in
    these ways were wrong. The function sees only cuts by the outer rows and columns, so it misses a cut by an outer row
    that is silent.

    Parameters
    ----------
    found : Recognition
        Recognition of the contact.
    mask : np.ndarray
        Taxels of the contact, bool (rows, cols).
    """
    first_row, last_row, first_col, last_col = edges_that_cut(mask)
    is_corner = (first_row or last_row) and (first_col or last_col)
    has_two_ends_cut = (first_row and last_row) or (first_col and last_col)
    is_from_edges = found.shape is Shape.RECTANGLE and is_corner or found.shape is Shape.SQUARE and has_two_ends_cut
    if not is_from_edges or not _is_sure(found):
        return found
    return found.no_surer_than(UNSUPPORTED, UnknownReason.CUT_BY_EDGE)


def as_far_as_it_holds(found: Recognition, low: Recognition) -> Recognition:
    """Return a recognition with its confidence limited by the recognition along the low outline.

    The outline at half of the contact's level may break into fragments if an object presses unevenly. A fragment may
    look like one of the shapes.

    Parameters
    ----------
    found : Recognition
        Recognition of the contact.
    low : Recognition
        Recognition of the same contact along its `low_outline`.
    """
    if not _is_sure(found) or low.probabilities[found.shape] >= LEAST_HELD:
        return found
    return found.no_surer_than(UNSUPPORTED, UnknownReason.UNSTABLE)


def low_outline(values: np.ndarray, mask: np.ndarray) -> np.ndarray | None:
    """Return the contact extended by the weak pressures connected to it, or None if there are no weak pressures.

    Parameters
    ----------
    values : np.ndarray
        Taxel values of the frame, float (rows, cols), with NaN for an invalid value.
    mask : np.ndarray
        Taxels of the contact, bool (rows, cols).

    Returns
    -------
    np.ndarray or None
        bool (rows, cols).
    """
    inside = values[mask & np.isfinite(values)]
    if not inside.size or are_on_off(values):
        return None
    wide = mask | (values >= LOW_SHARE * inside.mean())
    low = reached(mask, wide)
    return low if np.count_nonzero(low) > np.count_nonzero(mask) else None


def has_sure_name(found: Recognition) -> bool:
    """Return True if ``found`` reports a shape, also a taught one, with a confidence of SURE or more."""
    return found.shape not in (Shape.NONE, Shape.UNKNOWN) and found.confidence >= SURE


def _is_sure(found: Recognition) -> bool:
    """Return True if ``found`` reports one of the five shapes with a confidence of SURE or more."""
    return not isinstance(found.shape, TaughtShape) and found.shape in FIGURE_OF and found.confidence >= SURE


def is_convex(values: np.ndarray, mask: np.ndarray) -> bool:
    """Return True if the contact fills its convex hull as much as the five shapes do.

    Taxels without a value do not count as notches. A hole counts as filled if it is enclosed by a rim, or by a rim and
    one edge of the pad.

    Parameters
    ----------
    values : np.ndarray
        Taxel values of the frame, float (rows, cols), with NaN for a missing value.
    mask : np.ndarray
        Taxels of the contact, bool (rows, cols).

    Examples
    --------
    >>> bar = np.zeros((20, 20))
    >>> bar[9:12, 2:18] = 1
    >>> hook = bar.copy()
    >>> hook[2:9, 2:5] = 1
    >>> is_convex(bar, bar > 0), is_convex(hook, hook > 0)
    (True, False)
    """
    if _fills(mask, box_of(mask)):
        return True
    unseen = np.isnan(values)
    pressures = values[mask & ~unseen]
    wide = mask | (np.where(unseen, 0.0, values) >= PARTIAL_LEVEL * float(pressures.mean()))
    wide = reached(mask, wide)
    rows, cols = box_of(wide)
    inside, unseen = wide[rows, cols], unseen[rows, cols]
    hull = _hull(inside)
    if _fills(inside, hull & ~(unseen & ~inside)):
        return True
    closed = inside | ndimage.binary_closing(np.pad(inside, 2), EIGHT_CONNECTED)[2:-2, 2:-2]
    at_edge = (rows.start == 0, rows.stop == mask.shape[0], cols.start == 0, cols.stop == mask.shape[1])
    return _fills(closed | _holes(closed | unseen, at_edge), hull & ~(unseen & ~closed))


def _fills(taxels: np.ndarray, hull: np.ndarray | tuple[slice, slice]) -> bool:
    """Return True if ``taxels``, bool (rows, cols), fill LEAST_CONVEXITY of ``hull``.

    ``hull`` is a mask, bool (rows, cols), or a box of rows and columns.
    """
    part = taxels[hull]
    return bool(np.count_nonzero(part) >= LEAST_CONVEXITY * part.size)


def _holes(rim: np.ndarray, at_edge: tuple[bool, bool, bool, bool]) -> np.ndarray:
    """Return the taxels that ``rim`` encloses, alone or together with one edge of the pad.

    ``at_edge`` is True for each edge that counts, in the order first row, last row, first column, last column.
    """
    filled = ndimage.binary_fill_holes(rim)
    for edge, is_touched in enumerate(at_edge):
        if is_touched:
            axis, end = divmod(edge, 2)
            closed = np.insert(rim, end * rim.shape[axis], True, axis)
            filled |= np.delete(ndimage.binary_fill_holes(closed), end * rim.shape[axis], axis)
    return filled & ~rim


def _filled_inside(mask: np.ndarray, seen: np.ndarray, sizes: tuple[float, ...]) -> list[float]:
    """Return the share of the ``seen`` taxels that is pressed, in the hull of ``mask`` reduced to each of ``sizes``.

    Rows and columns without a pressed taxel are left out, because they may be silent.
    """
    rows, cols = mask.any(1), mask.any(0)
    contact, seen = mask[rows][:, cols], seen[rows][:, cols].reshape(-1)
    along, pressed = _along(contact), contact.reshape(-1)
    middle = along[_hull(contact).reshape(-1)].mean(0)
    low, high = along[pressed].min(0) - 0.5, along[pressed].max(0) + 0.5
    shares = []
    for size in sizes:
        inner = seen & ((along >= middle + size * (low - middle)) & (along <= middle + size * (high - middle))).all(1)
        shares.append(float(pressed[inner].mean()) if inner.any() else 0.0)
    return shares


def _hull(mask: np.ndarray) -> np.ndarray:
    """Return the taxels whose centres lie in the convex hull of the centres of ``mask``."""
    every = _along(mask)
    along = every[mask.reshape(-1)]
    within: np.ndarray = ((every >= along.min(0) - HULL_ROUNDING) & (every <= along.max(0) + HULL_ROUNDING)).all(1)
    return within.reshape(mask.shape)


def _along(mask: np.ndarray) -> np.ndarray:
    """Return the position of each taxel along each direction of the hull, (taxels, directions) [pitches]."""
    row, col = np.indices(mask.shape).reshape(2, -1)
    positions: np.ndarray = np.array((col, row)).T @ HULL_AXES
    return positions
