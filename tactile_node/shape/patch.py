"""Convert a contact pattern to a patch: the contact on a small grid, with a standard position, level and orientation.

The patch is the input of the learned recogniser. The contact in the patch consists of the pattern's mask and the
pressed pieces close to the mask, because silent columns and dead taxels break a contact into pieces. If the taxels
measure pressure, the patch also shows the partial pressures at the rim of the contact.
"""

from typing import NamedTuple

import numpy as np

from tactile_node.contact.neighbours import box_of, grown, linked
from tactile_node.contact.pattern import MOST_LABELS, ContactPattern
from tactile_node.contact.press import are_on_off
from tactile_node.taxel_frame import read_only

SIDE = 20           #: Number of rows and of columns of a patch.
PATCH_ROOM = 18     #: A wider contact is scaled down to this width [cells].
BRIDGED_TAXELS = 2  #: Pieces with at most this many taxels between them belong to one contact.
PIECE_TAXELS = 3    #: Smallest number of taxels in a piece. A smaller group beside a contact is a speck.
RIM_REACH = 2       #: Distance from the mask up to which partial pressures are shown [taxels].

#: Highest level of a taxel. Training stores levels as bytes, so no network was trained with a higher level.
HIGHEST_LEVEL = 255 / 160
ROWS_AROUND, COLS_AROUND = np.indices((3, 3)).reshape(2, -1)


class Patch(NamedTuple):
    """A contact in standard form, with a level of 1 at full contact pressure."""

    level: np.ndarray   #: float32 (SIDE, SIDE), with the mean of the neighbours for a dead taxel
    unseen: np.ndarray  #: float32 (SIDE, SIDE), 1 where a taxel is dead or beyond the pad's edge
    scale: float        #: width of a cell [taxels], at least 1
    graded: bool        #: True if the levels come from pressures, False if they come from on/off taxels


def joined(pattern: ContactPattern) -> np.ndarray:
    """Return the mask of the pattern, joined with the pressed pieces close to the mask or to a joined piece.

    The result is bool (rows, cols) and contains no specks. A speck is a group of fewer than PIECE_TAXELS taxels. Taxels
    with at most one other taxel between them belong to the same group.
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
    # several groups if hidden taxels divide the mask by more than BRIDGED_TAXELS
    of_contact[groups[pattern.mask]] = True
    return pressed & of_contact[groups]


def join_pieces(pattern: ContactPattern) -> ContactPattern:
    """Return ``pattern`` with its largest contact and the pieces close to it (`joined`) as a single contact.

    The mask, the labels, the sizes and the number of contacts all show the joined contact.
    """
    together = joined(pattern)
    is_piece = np.zeros(MOST_LABELS + 1, bool)
    is_piece[pattern.labels[together | pattern.mask]] = True
    is_piece[0] = False
    number = np.where(is_piece, 1, np.cumsum(~is_piece)).astype(np.uint8)  # new label of each old label
    number[0] = 0
    labels = number[pattern.labels]
    labels[together] = 1
    sizes = tuple(np.bincount(labels.reshape(-1))[1:].tolist())
    return pattern._replace(mask=read_only(labels == 1), labels=read_only(labels), sizes=sizes,
                            contacts=pattern.contacts - int(np.count_nonzero(is_piece)) + 1)


def make_patch(values: np.ndarray, mask: np.ndarray) -> Patch:
    """Return the patch of a contact.

    Parameters
    ----------
    values : np.ndarray
        Taxel values of the frame, float (rows, cols).
    mask : np.ndarray
        Taxels of the contact, bool (rows, cols), with at least one True.
    """
    box, around = box_of(mask), box_of(mask, RIM_REACH)
    level, dead, graded = _levels(values[around], mask[around])
    level, dead, shown, extent = _standing(level, dead, [used.start - seen.start for used, seen in zip(box, around)],
                                           [used.stop - used.start for used in box])
    scale = max(extent) / PATCH_ROOM
    if scale <= 1:
        place = [(SIDE - size) // 2 - margin for size, margin in zip(extent, shown)]
        return Patch(_placed(level, place, 0.0), _placed(dead, place, 1.0), 1.0, graded)
    level, dead = _scaled(level, dead, scale, before=shown, extent=extent)
    return Patch(level, dead, scale, graded)


def _standing(level: np.ndarray, dead: np.ndarray, before: list[int],
              extent: list[int]) -> tuple[np.ndarray, np.ndarray, list[int], list[int]]:
    """Rotate and mirror the contact until it is longer along x and skewed towards greater x and y.

    ``before`` holds the numbers of taxels shown above and to the left of the contact's box. ``extent`` holds the
    numbers of rows and columns of the box.
    """
    (xx, xxx), (yy, yyy) = _spread(level.sum(0)), _spread(level.sum(1))
    is_mirrored = yyy < 0, xxx < 0
    sense = tuple(slice(None, None, -1 if is_back else 1) for is_back in is_mirrored)
    before = [shown - size - margin if is_back else margin
              for is_back, shown, size, margin in zip(is_mirrored, level.shape, extent, before)]
    level = level[sense]
    dead = dead[sense]
    if yy > xx:
        level = level.T
        dead = dead.T
        before = before[::-1]
        extent = extent[::-1]
    return level, dead, before, extent


def _spread(weight: np.ndarray) -> tuple[float, float]:
    """Return the second and third central moments of a distribution along one axis."""
    place = np.arange(len(weight))
    place = place - weight @ place / weight.sum()
    square = weight * place * place
    return float(square.sum()), float(square @ place)


def _levels(values: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
    """Return the levels, the dead taxels (as 1.0), and True if the levels are graded."""
    dead = np.isnan(values)
    known = np.where(dead, 0, np.maximum(values, 0))  # a value below 0 is noise or comes from a broken taxel
    inside = known * mask
    graded = bool(inside.any()) and not are_on_off(values)
    if graded:
        known = known * grown(grown(mask))  # RIM_REACH taxels
        level = np.minimum(known * (inside.sum() / np.square(inside).sum()), HIGHEST_LEVEL)
    else:
        level = mask.astype(float)
    return (_filled(level, dead) if dead.any() else level), dead.astype(float), graded


def _filled(level: np.ndarray, dead: np.ndarray) -> np.ndarray:
    """Return ``level`` with each dead taxel set to the mean of its live neighbours."""
    room = np.array(level.shape) + 2
    known, valid = np.zeros(room), np.zeros(room)
    known[1:-1, 1:-1], valid[1:-1, 1:-1] = np.where(dead, 0, level), ~dead
    row, col = dead.nonzero()
    around = row[:, None] + ROWS_AROUND, col[:, None] + COLS_AROUND
    filled = level.copy()
    filled[row, col] = known[around].sum(1) / np.maximum(valid[around].sum(1), 1)
    return filled


def _placed(image: np.ndarray, place: list[int], beyond: float) -> np.ndarray:
    """Return a patch that shows ``image`` with its first taxel at ``place``, and ``beyond`` everywhere else."""
    patch = np.full((SIDE, SIDE), beyond, np.float32)
    source, target = zip(*(_overlap(start, size) for start, size in zip(place, image.shape)))
    patch[target] = image[source]
    return patch


def _overlap(start: int, size: int) -> tuple[slice, slice]:
    low, high = max(start, 0), min(start + size, SIDE)
    return slice(low - start, high - start), slice(low, high)


def _scaled(level: np.ndarray, dead: np.ndarray, scale: float, before: list[int],
            extent: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Return the means over cells that are ``scale`` taxels wide, with the contact at the centre of the patch."""
    down, along = (_cells(n, scale, margin, size) for n, margin, size in zip(level.shape, before, extent))
    covered = down.sum(1)[:, None] * along.sum(1)
    level, dead = down @ level @ along.T, down @ dead @ along.T
    return level.astype(np.float32), np.clip(dead + 1 - covered, 0, 1).astype(np.float32)


def _cells(n: int, scale: float, before: int, size: int) -> np.ndarray:
    """Return the share of each patch cell that each of ``n`` taxels covers, shape (SIDE, n)."""
    edge = (size - SIDE * scale) / 2 + before + scale * np.arange(SIDE + 1)
    taxel = np.arange(n)
    overlap = np.minimum(edge[1:, None], taxel + 1) - np.maximum(edge[:-1, None], taxel)
    return np.clip(overlap, 0, None) / scale
