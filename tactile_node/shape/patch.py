"""Contact pattern -> patch: the contact on a small grid, in a standard place, level and orientation.

What the learned recogniser looks at. A contact is the pattern's mask, joined with the pressed pieces
that lie within reach of each other (silent columns and dead taxels tear a contact apart), and, where
taxels give pressures, the partial pressures of its rim.
"""

from typing import NamedTuple

import numpy as np

from tactile_node.contact.neighbours import box_of, grown, linked
from tactile_node.contact.pattern import MOST_LABELS, ContactPattern
from tactile_node.contact.press import are_on_off
from tactile_node.taxel_frame import read_only

SIDE = 20        #: rows and columns of a patch
PATCH_ROOM = 18        #: a contact wider than this is scaled down to it
BRIDGED_TAXELS = 2      #: pieces with up to so many taxels between them are one contact [taxels]
PIECE_TAXELS = 3        #: fewer taxels beside a contact are no piece of it
RIM_REACH = 2          #: how far beyond the mask partial pressures reach [taxels]
HIGHEST_LEVEL = 255 / 160  #: level of a taxel: training keeps levels as bytes, so no network has seen a higher one
ROWS_AROUND, COLS_AROUND = np.indices((3, 3)).reshape(2, -1)


class Patch(NamedTuple):
    """A contact in standard form; ``level`` 1 is full contact pressure."""

    level: np.ndarray    #: float32, (SIDE, SIDE); where nothing is known, what the neighbours suggest
    unseen: np.ndarray   #: float32, (SIDE, SIDE): 1 where a taxel is dead or beyond the pad's edge
    scale: float         #: taxels a patch cell is wide, 1 or more
    graded: bool         #: True: from pressures; False: from on/off taxels


def joined(pattern: ContactPattern) -> np.ndarray:
    """Return the mask with the pressed pieces near it, and those near them, bool, shape (rows, cols).

    Specks are left out: groups of fewer than PIECE_TAXELS taxels with at most one taxel between each other.
    """
    if pattern.contacts <= 1:
        return pattern.mask
    least = np.nanmin(pattern.values[pattern.mask], initial=np.inf)
    others = (pattern.values >= least) & ~pattern.mask
    groups = linked(others, 1)
    others &= (np.bincount(groups[others], minlength=groups.max() + 1) >= PIECE_TAXELS)[groups]
    pressed = pattern.mask | others
    groups = linked(pressed, BRIDGED_TAXELS)
    of_contact = np.zeros(int(groups.max()) + 1, bool)
    of_contact[groups[pattern.mask]] = True  # hidden taxels may keep its pieces farther apart than BRIDGED_TAXELS
    return pressed & of_contact[groups]


def join_pieces(pattern: ContactPattern) -> ContactPattern:
    """Return ``pattern`` with the largest contact and the pieces `joined` to it as one, in mask, labels and counts."""
    together = joined(pattern)
    is_piece = np.zeros(MOST_LABELS + 1, bool)
    is_piece[pattern.labels[together | pattern.mask]] = True
    is_piece[0] = False
    number = np.where(is_piece, 1, np.cumsum(~is_piece)).astype(np.uint8)  # none, then the others in their order
    number[0] = 0
    labels = number[pattern.labels]
    labels[together] = 1
    sizes = tuple(np.bincount(labels.reshape(-1))[1:].tolist())
    return pattern._replace(mask=read_only(labels == 1), labels=read_only(labels), sizes=sizes,
                            contacts=pattern.contacts - int(np.count_nonzero(is_piece)) + 1)


def make_patch(values: np.ndarray, mask: np.ndarray) -> Patch:
    """Return the patch of the contact ``mask``, bool with a taxel in it, of a frame ``values``."""
    (low, high), around = np.array([(used.start, used.stop) for used in box_of(mask)]).T, box_of(mask, RIM_REACH)
    level, dead, graded = _levels(values[around], mask[around])
    first = np.array([shown.start for shown in around])
    level, dead, shown, extent = _standing(level, dead, low - first, high - low)
    scale = max(extent) / PATCH_ROOM
    if scale <= 1:
        place = [(SIDE - size) // 2 - margin for size, margin in zip(extent, shown)]
        return Patch(_placed(level, place, 0.0), _placed(dead, place, 1.0), 1.0, graded)
    level, dead = _scaled(level, dead, scale, before=shown, extent=extent)
    return Patch(level, dead, scale, graded)


def _standing(level: np.ndarray, dead: np.ndarray, before: np.ndarray,
              extent: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[int], list[int]]:
    """Rotate and mirror: longer along x, more spread towards greater x and y.

    ``before``: taxels shown above and left of the contact's box, ``extent``: the box's rows and columns.
    """
    after = np.array(level.shape) - extent - before
    (xx, xxx), (yy, yyy) = _spread(level.sum(0)), _spread(level.sum(1))
    sense = (slice(None, None, -1 if yyy < 0 else 1), slice(None, None, -1 if xxx < 0 else 1))
    level = level[sense]
    dead = dead[sense]
    before = np.where((yyy < 0, xxx < 0), after, before)
    if yy > xx:
        level = level.T
        dead = dead.T
        before = before[::-1]
        extent = extent[::-1]
    return level, dead, before.tolist(), extent.tolist()


def _spread(weight: np.ndarray) -> tuple[float, float]:
    """Second and third central moments of a distribution along one axis."""
    place = np.arange(len(weight)) - weight @ np.arange(len(weight)) / weight.sum()
    square = weight * place * place
    return float(square.sum()), float(square @ place)


def _levels(values: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
    """Levels, dead taxels (as 1.0), and whether there are pressures between none and full."""
    dead = np.isnan(values)
    known = np.where(dead, 0, np.maximum(values, 0))  # below 0 is noise, or what a broken taxel sends
    inside = known * mask
    graded = bool(inside.any()) and not are_on_off(values)
    if graded:
        known = known * grown(grown(mask))  # RIM_REACH taxels
        level = np.minimum(known * (inside.sum() / np.square(inside).sum()), HIGHEST_LEVEL)
    else:
        level = mask.astype(float)
    return (_filled(level, dead) if dead.any() else level), dead.astype(float), graded


def _filled(level: np.ndarray, dead: np.ndarray) -> np.ndarray:
    """Dead taxels take the mean of those around them that are not."""
    room = np.array(level.shape) + 2
    known, valid = np.zeros(room), np.zeros(room)
    known[1:-1, 1:-1], valid[1:-1, 1:-1] = np.where(dead, 0, level), ~dead
    row, col = dead.nonzero()
    around = row[:, None] + ROWS_AROUND, col[:, None] + COLS_AROUND
    filled = level.copy()
    filled[row, col] = known[around].sum(1) / np.maximum(valid[around].sum(1), 1)
    return filled


def _placed(image: np.ndarray, place: list[int], beyond: float) -> np.ndarray:
    """``image`` with its first taxel at ``place`` of the patch; ``beyond`` around it."""
    patch = np.full((SIDE, SIDE), beyond, np.float32)
    source, target = zip(*(_overlap(start, size) for start, size in zip(place, image.shape)))
    patch[target] = image[source]
    return patch


def _overlap(start: int, size: int) -> tuple[slice, slice]:
    low, high = max(start, 0), min(start + size, SIDE)
    return slice(low - start, high - start), slice(low, high)


def _scaled(level: np.ndarray, dead: np.ndarray, scale: float, before: list[int],
            extent: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Means over cells ``scale`` taxels wide, the contact in the middle."""
    down, along = (_cells(n, scale, margin, size) for n, margin, size in zip(level.shape, before, extent))
    covered = down.sum(1)[:, None] * along.sum(1)
    level, dead = down @ level @ along.T, down @ dead @ along.T
    return level.astype(np.float32), np.clip(dead + 1 - covered, 0, 1).astype(np.float32)


def _cells(n: int, scale: float, before: int, size: int) -> np.ndarray:
    """Share of each patch cell that each of ``n`` taxels covers, shape (SIDE, n)."""
    edge = (size - SIDE * scale) / 2 + before + scale * np.arange(SIDE + 1)
    taxel = np.arange(n)
    overlap = np.minimum(edge[1:, None], taxel + 1) - np.maximum(edge[:-1, None], taxel)
    return np.clip(overlap, 0, None) / scale
