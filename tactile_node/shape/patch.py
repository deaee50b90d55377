"""Contact pattern -> patch: the contact on a small grid, in a standard place, level and orientation.

What the learned recogniser looks at. A contact is the pattern's mask, joined with the pressed pieces
that lie within reach of each other (silent columns and dead taxels tear a contact apart), and, where
taxels give pressures, the partial pressures of its rim.
"""

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.contact.pattern import ContactPattern

SIDE = 20        #: rows and columns of a patch
ROOM = 18        #: a contact wider than this is scaled down to it
BRIDGED = 2      #: pieces with up to so many taxels between them are one contact [taxels]
CELLS = np.arange(SIDE)
RIM = 2          #: how far beyond the mask partial pressures reach [taxels]


class Patch(NamedTuple):
    """A contact in standard form; ``level`` 1 is full contact pressure."""

    level: np.ndarray    #: float32, (SIDE, SIDE); where nothing is known, what the neighbours suggest
    unseen: np.ndarray   #: float32, (SIDE, SIDE): 1 where a taxel is dead or beyond the pad's edge
    scale: float         #: taxels a patch cell is wide, 1 or more
    graded: bool         #: True: from pressures; False: from on/off taxels


def joined(pattern: ContactPattern) -> np.ndarray:
    """Return the mask with the pressed pieces near it, and those near them, bool, shape (rows, cols)."""
    if pattern.contacts <= 1:
        return pattern.mask
    least = np.nanmin(pattern.values[pattern.mask], initial=np.inf)
    pressed = pattern.mask | (pattern.values >= least)
    wide = ndimage.maximum_filter(pressed.view(np.uint8), BRIDGED + 1, mode='constant')
    labels, _ = ndimage.label(wide, np.ones((3, 3)))
    return pressed & (labels == labels[pattern.mask][0])


def make_patch(values: np.ndarray, mask: np.ndarray) -> Patch:
    """Return the patch of the contact ``mask``, bool with a taxel in it, of a frame ``values``."""
    rows, cols = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    top, bottom, left, right = int(rows[0]), int(rows[-1]) + 1, int(cols[0]), int(cols[-1]) + 1
    around = (slice(max(top - RIM, 0), bottom + RIM), slice(max(left - RIM, 0), right + RIM))
    near, seen = values[around], mask[around]
    level, dead, graded = _levels(near, seen)
    offset = around[0].start - top, around[1].start - left
    extent = np.array((bottom - top, right - left))
    scale, odd = float(extent.max() / ROOM), extent[None] % 2
    if scale <= 1:
        place = (SIDE - extent) // 2 + offset
        level, unseen, scale = _placed(level, place, 0.0), _placed(dead, place, 1.0), 1.0
    else:
        level, unseen = _scaled(level, dead, scale, offset, extent)
        odd = np.zeros_like(odd)
    level, unseen = standing(level[None], unseen[None], odd)
    return Patch(level[0], unseen[0], scale, graded)


def _levels(values: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
    """Levels, dead taxels (as 1.0), and whether there are pressures between none and full."""
    dead = np.isnan(values)
    known = np.where(dead, 0, values)
    peak = known.max()
    graded = bool(((known > 0) & (known < peak)).any())
    if graded:
        inside = known * mask
        known = known * ndimage.maximum_filter(mask.view(np.uint8), 2 * RIM + 1, mode='constant')
        level = known * (inside.sum() / np.square(inside).sum())
    else:
        level = mask.astype(float)
    return (_filled(level, dead) if dead.any() else level), dead.astype(float), graded


def _filled(level: np.ndarray, dead: np.ndarray) -> np.ndarray:
    """Dead taxels take the mean of those around them that are not."""
    valid = (~dead).astype(float)
    sums, count = ndimage.uniform_filter(level * valid, 3, mode='constant'), ndimage.uniform_filter(valid, 3)
    return np.where(dead, sums / np.maximum(count, 1 / 9), level)


def _placed(image: np.ndarray, place: np.ndarray, beyond: float) -> np.ndarray:
    """``image`` with its first taxel at ``place`` of the patch; ``beyond`` around it."""
    patch = np.full((SIDE, SIDE), beyond, np.float32)
    source, target = zip(*(_overlap(start, size) for start, size in zip(place, image.shape)))
    patch[target] = image[source]
    return patch


def _overlap(start: int, size: int) -> tuple[slice, slice]:
    low, high = max(start, 0), min(start + size, SIDE)
    return slice(low - start, high - start), slice(low, high)


def _scaled(level, dead, scale, offset, extent) -> tuple[np.ndarray, np.ndarray]:
    """Means over cells ``scale`` taxels wide, the contact in the middle."""
    down, along = (_cells(n, scale, start, size)
                   for n, start, size in zip(level.shape, offset, extent))
    covered = down.sum(1)[:, None] * along.sum(1)
    level, dead = down @ level @ along.T, down @ dead @ along.T
    return level.astype(np.float32), np.clip(dead + 1 - covered, 0, 1).astype(np.float32)


def _cells(n: int, scale: float, start: int, size: int) -> np.ndarray:
    """Share of each patch cell that each of ``n`` taxels covers, shape (SIDE, n)."""
    edge = (size - SIDE * scale) / 2 - start + scale * np.arange(SIDE + 1)
    taxel = np.arange(n)
    return np.clip(np.minimum(edge[1:, None], taxel + 1) - np.maximum(edge[:-1, None], taxel), 0, None) / scale


def standing(levels: np.ndarray, unseen: np.ndarray, odd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of each of K patches' eight turns and mirrorings: longer along x, more spread to greater x and y.

    ``odd``: (K, 2), 1 where the contact is an odd number of cells high, wide: half a cell off the middle.
    """
    (xx, xxx), (yy, yyy) = _spread(levels.sum(1)), _spread(levels.sum(2))
    rows, cols = (np.where(skew[:, None] < 0, (SIDE - 1 - off[:, None] - CELLS) % SIDE, CELLS)
                  for skew, off in ((yyy, odd[:, 0]), (xxx, odd[:, 1])))
    lying = (yy > xx)[:, None, None]
    rows, cols = np.where(lying, rows[:, None, :], rows[:, :, None]), np.where(lying, cols[:, :, None],
                                                                               cols[:, None, :])
    k = np.arange(len(levels))[:, None, None]
    return levels[k, rows, cols], unseen[k, rows, cols]


def _spread(weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Second and third central moments of K distributions (K, SIDE) along one axis."""
    place = CELLS - (weight @ CELLS / weight.sum(1))[:, None]
    square = weight * place * place
    return square.sum(1), (square * place).sum(1)
