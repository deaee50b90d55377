"""Make samples from frames in bulk.

The results equal those of `patch.make_patch`, but are computed for hundreds of contacts at a time.

Contacts wider than a patch are scaled down one by one with `make_patch`.
"""

import numpy as np
from scipy import ndimage

from tactile_node.shape.invariants import COUNT
from tactile_node.shape.patch import BRIDGED_TAXELS, PATCH_ROOM, RIM_REACH, SIDE, make_patch
from training.samples import SMALLEST, Samples, joined_samples, packed

CELLS = np.arange(SIDE)
FLAT = np.pad(np.ones((1, 3, 3), bool), ((1, 1), (0, 0), (0, 0)))
NOTHING = Samples(*(np.empty((0, SIDE, SIDE), np.uint8) for _ in range(2)), np.empty((0, COUNT), np.float32),
                  np.empty(0, int))
CROPPED = 0.15  #: Share of the sides of wide contacts at which the pad ends.


def samples_of(rng: np.random.Generator, values: np.ndarray, press: np.ndarray, dead: np.ndarray, labels: np.ndarray,
               graded: bool) -> Samples:
    """Return samples of the largest contact in each of K frames, (K, rows, cols).

    A contact includes the pieces joined to it.

    The array ``press`` is the threshold of each frame, (K, 1, 1), or of each of its taxels, (K, rows, cols). Frames are
    skipped if their contact is too small or touches the edge of the frame.
    """
    pressed = (values >= press) & ~dead
    parts, found = ndimage.label(pressed, FLAT)
    sizes = np.bincount(parts.reshape(-1), minlength=found + 1)
    sizes[0] = 0
    largest = parts.reshape(len(labels), -1)
    main = largest[np.arange(len(labels)), sizes[largest].argmax(1)]
    wide = ndimage.maximum_filter(pressed.view(np.uint8), (1, BRIDGED_TAXELS + 1, BRIDGED_TAXELS + 1), mode='constant')
    groups, _ = ndimage.label(wide, FLAT)
    which = np.where(parts == main[:, None, None], groups, 0).reshape(len(labels), -1).max(1)
    mask = pressed & (groups == which[:, None, None])
    low, extent = _bounds(mask)
    good = (sizes[main] >= SMALLEST) & (main > 0) & (low > 0).all(1) & (low + extent < mask.shape[1:]).all(1)
    narrow, large = good & (extent.max(1) <= PATCH_ROOM), good & (extent.max(1) > PATCH_ROOM)
    made = []
    if narrow.any():
        made.append(_placed(values[narrow], mask[narrow], dead[narrow], low=low[narrow], extent=extent[narrow],
                            labels=labels[narrow], graded=graded))
    if large.any():
        made.append(_scaled(rng, np.where(dead, np.nan, values)[large], mask[large], labels[large]))
    return joined_samples(made) if made else NOTHING


def _scaled(rng, values, mask, labels) -> Samples:
    patches = [make_patch(*_cropped(rng, *frame)) for frame in zip(values, mask)]
    levels, unseen = (np.array([getattr(patch, name) for patch in patches]) for name in ('level', 'unseen'))
    return packed(levels, unseen, np.array([patch.scale for patch in patches]), labels)


def _cropped(rng, values, mask) -> tuple[np.ndarray, np.ndarray]:
    """Crop the frame so that some sides of the pad lie at the contact or one taxel away from it."""
    box = []
    for axis in (1, 0):
        used = np.flatnonzero(mask.any(axis))
        first, last = used[0] - rng.integers(0, 2), used[-1] + 1 + rng.integers(0, 2)
        keep = rng.random(2) >= CROPPED
        box.append(slice(0 if keep[0] else max(first, 0), None if keep[1] else last))
    return values[tuple(box)], mask[tuple(box)]


def _bounds(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    spans = [mask.any(2), mask.any(1)]
    low = np.column_stack([span.argmax(1) for span in spans])
    high = np.column_stack([span.shape[1] - span[:, ::-1].argmax(1) for span in spans])
    return low, high - low


def _placed(values, mask, dead, low, extent, labels, graded) -> Samples:
    known = np.where(dead, 0, values)
    if graded:
        inside = known * mask
        scale = inside.sum((1, 2)) / np.square(inside).sum((1, 2))
        near = ndimage.maximum_filter(mask.view(np.uint8), (1, 2 * RIM_REACH + 1, 2 * RIM_REACH + 1), mode='constant')
        level = known * near * scale[:, None, None]
    else:
        level = mask.astype(float)
    valid = (~dead).astype(float)
    sums, seen = (ndimage.uniform_filter(a, (1, 3, 3), mode='constant') for a in (level * valid, valid))
    level = np.where(dead, sums / np.maximum(seen, 1 / 9), level)
    start = low - (SIDE - extent) // 2
    row, col = (start[:, axis, None] + np.arange(SIDE) for axis in (0, 1))
    at = np.arange(len(labels))[:, None, None], row[:, :, None] + SIDE, col[:, None, :] + SIDE
    room = ((0, 0), (SIDE, SIDE), (SIDE, SIDE))
    # A patch shows RIM_REACH taxels around the contact's box, as in make_patch. The rest of the patch is an unpressed
    # pad.
    around = [(a >= first[:, None] - RIM_REACH) & (a < first[:, None] + size[:, None] + RIM_REACH)
              for a, first, size in ((row, low[:, 0], extent[:, 0]), (col, low[:, 1], extent[:, 1]))]
    shown = around[0][:, :, None] & around[1][:, None, :]
    levels = np.where(shown, np.pad(level, room)[at], 0)
    unseen = np.where(shown, np.pad(dead, room)[at], 1).astype(float)
    levels, unseen = _standing(levels.astype(np.float32), unseen.astype(np.float32), extent % 2)
    return packed(levels, unseen, np.ones(len(labels)), labels)


def _standing(levels: np.ndarray, unseen: np.ndarray, odd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the standard orientation of each of K patches, which is longer along x and skewed towards greater x and y.

    The standard orientation is one of the eight rotations and reflections. The array ``odd``, (K, 2), is 1 if the
    height or the width of the contact is an odd number of cells, so that the centre of the contact is half a cell off
    the middle.
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
    """Return the second and third central moments of K distributions, (K, SIDE), along one axis."""
    place = CELLS - (weight @ CELLS / weight.sum(1))[:, None]
    square = weight * place * place
    return square.sum(1), (square * place).sum(1)
