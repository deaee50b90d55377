"""Select the taxels to which an outline is fitted.

The selection contains the contact and the taxels around it, except holes and invalid taxels. A wide contact is first
divided into blocks of taxels, so that the time of a fit is limited.
"""

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import box_of, grown, touches_edge
from tactile_node.errors import InputError
from tactile_node.pose.outlines import Window

WINDOW_MARGIN = 2  #: Number of taxels by which the window extends beyond the contact on each side.
MOST_BLOCKS = 32   #: Largest number of blocks across a contact.
BLOCKS_AROUND = 3  #: Number of additional blocks to fit on each side of the contact.
LEAST_SEEN = 0.5   #: Smallest share of valid taxels for which a block has a value.


class Evidence(NamedTuple):
    """The part of a frame that a fit uses.

    The window, ``values``, ``used`` and ``solid`` count blocks of ``size`` x ``size`` taxels. For most contacts, a
    block is a single taxel. ``values`` and ``used`` are flattened row by row.
    """

    window: Window
    values: np.ndarray  #: taxel values in units of ``level``, with 0 for invalid taxels
    used: np.ndarray    #: True for each taxel that the fit uses
    solid: np.ndarray   #: values >= 0 for the moments, (rows, cols), with invalid taxels and holes filled
    level: float        #: typical value of a taxel in the contact, in the unit of the frame
    on_off: bool        #: True if all values are 0 or 1
    at_edge: bool       #: True if the contact touches the pad's edge and may continue beyond it
    size: int           #: side length of a block [taxels]
    x: float            #: column at the centre of block (0, 0) [taxels]
    y: float            #: row at the centre of block (0, 0) [taxels]

    @property
    def strength(self) -> float:
        """Typical value times the number of used taxels.

        The strength grows with the load and with the visible part of the contact.
        """
        return self.level * int(np.count_nonzero(self.used))


def gather(values: np.ndarray, mask: np.ndarray, size: int | None = None) -> Evidence:
    """Return the evidence for fitting an outline to a contact.

    Parameters
    ----------
    values : np.ndarray
        Taxel values, (rows, cols), with NaN for invalid taxels. Booleans, or values that are all 0 or 1, are treated as
        an on/off pattern.
    mask : np.ndarray
        Taxels of the contact, bool (rows, cols).
    size : int or None
        Side length of a block [taxels], or None to choose it by the extent of the contact (`size_of`).

    Raises
    ------
    InputError
        Raised if the arrays have different shapes or are not real numbers, or if the mask is empty.
    """
    values, mask = _checked(values, mask)
    at_edge = touches_edge(mask)
    size = size_of(mask) if size is None else size
    x = y = 0.0
    if size > 1:
        blocks, of_contact, corner = in_blocks(values, mask, size)
        if of_contact.any():
            values, mask = blocks, of_contact
            x, y = corner
        else:  # a single line of taxels never fills half of a block
            size = 1
    window = _window(mask)
    values, mask = _seen_through(window, values, np.nan), _seen_through(window, mask, False)
    valid = np.isfinite(values)
    values = np.where(valid, values, 0.0)
    near = grown(mask)
    hole = holes(mask)
    used = valid & grown(near)
    if hole is not None:
        used &= ~(grown(hole) & ~grown(~mask & ~hole))
    level = upper_median(values[mask & valid])
    on_off = bool(((values == 0) | (values == 1)).all())
    values = values / level if level > 0 else mask.astype(float)
    solid = np.where(mask & ~valid, 1.0, values * (mask if on_off else near))
    if hole is not None:
        solid[hole] = 1.0
    return Evidence(window=window, values=values.reshape(-1), used=used.reshape(-1), solid=np.maximum(solid, 0),
                    level=level, on_off=on_off, at_edge=at_edge, size=size, x=x, y=y)


def size_of(mask: np.ndarray) -> int:
    """Return the side length of the blocks for fitting the contact ``mask`` [taxels]; it is 1 for most contacts.

    >>> size_of(np.ones((8, 8), bool)), size_of(np.ones((64, 10), bool))
    (1, 2)
    """
    rows, cols = box_of(mask)
    return int(-(-max(rows.stop - rows.start, cols.stop - cols.start) // MOST_BLOCKS))


def in_blocks(values: np.ndarray, mask: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray, tuple[float, float]]:
    """Reduce a contact and its surroundings to blocks of ``size`` x ``size`` taxels.

    Returns
    -------
    values : np.ndarray
        Mean of each block, (rows, cols). A block is NaN if too few of its taxels are valid, or if the pad's edge cuts
        it off.
    mask : np.ndarray
        Blocks of the contact, bool (rows, cols).
    corner : tuple of float
        Column and row at the centre of block (0, 0) [taxels].
    """
    part, missing, corner = [], [], []
    for used, length in zip(box_of(mask), mask.shape):
        first, last = max(used.start - BLOCKS_AROUND * size, 0), min(used.stop + BLOCKS_AROUND * size, length)
        stop = first - (first - last) // size * size
        part.append(slice(first, stop))
        missing.append((0, max(stop - length, 0)))
        corner.append(first + (size - 1) / 2)

    def blocks(taxels: np.ndarray, beyond: float) -> np.ndarray:
        padded = np.pad(taxels[tuple(part)], missing, constant_values=beyond)
        return padded.reshape(padded.shape[0] // size, size, -1, size)
    window, is_cut = blocks(values, np.nan), blocks(np.zeros(mask.shape, bool), True).any((1, 3))
    valid = np.isfinite(window)
    seen = valid.sum((1, 3))
    means = np.where(valid, window, 0).sum((1, 3)) / np.maximum(seen, 1)
    means[is_cut | (seen < LEAST_SEEN * size ** 2)] = np.nan
    return means, blocks(mask, False).mean((1, 3)) >= 0.5, (corner[1], corner[0])


def _checked(values: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the values of a frame as floats and the contact mask as booleans.

    Raises
    ------
    InputError
        Raised if the arrays have different shapes or are not real numbers, or if the mask is empty.
    """
    values, mask = np.asarray(values), np.asarray(mask)
    if values.ndim != 2 or values.shape != mask.shape or values.dtype.kind not in 'biuf':
        raise InputError(
            'frame and contact mask', expected='two arrays of real numbers with the same shape (rows, cols)',
            got=f'{values.dtype} {values.shape} and {mask.shape}', remedy='Pass the values and the mask of one frame.')
    if not mask.any():
        raise InputError('contact mask', expected='at least one taxel', got='none',
                         remedy='Fit an outline only if something touches the pad.')
    return values.astype(float, copy=False), mask.astype(bool, copy=False)


def _window(mask: np.ndarray) -> Window:
    """Return the window around the contact, which may extend beyond the pad's edge.

    The window extends beyond the edge, because a load beyond the edge also presses the taxels at the edge.
    """
    rows, cols = box_of(mask)
    return Window(rows.start - WINDOW_MARGIN, cols.start - WINDOW_MARGIN,
                  rows.stop - rows.start + 2 * WINDOW_MARGIN, cols.stop - cols.start + 2 * WINDOW_MARGIN)


def _seen_through(window: Window, taxels: np.ndarray, beyond: float) -> np.ndarray:
    """Return the part of ``taxels`` inside the window, with the value ``beyond`` outside the pad."""
    row, col, rows, cols = window
    part = taxels[max(row, 0):row + rows, max(col, 0):col + cols]
    if part.shape == (rows, cols):
        return part
    whole = np.full((rows, cols), beyond, taxels.dtype)
    below, right = max(-row, 0), max(-col, 0)
    whole[below:below + part.shape[0], right:right + part.shape[1]] = part
    return whole


def upper_median(values: np.ndarray) -> float:
    """Return the upper median of ``values``, or 0 if there are no values.

    This function is four times as fast as ``np.median``.
    """
    middle = values.size // 2
    return float(np.partition(values, middle)[middle]) if values.size else 0.0


def holes(mask: np.ndarray) -> np.ndarray | None:
    """Return the taxels that ``mask`` encloses, or None if it encloses none, which is the usual case."""
    begins = mask[:, 1:] & ~mask[:, :-1]
    if (np.add.reduce(begins, 1, int) + mask[:, 0]).max() < 2:  # no row has a gap
        return None
    between = ~mask
    for axis in (0, 1):  # a fast first check, because an enclosed taxel has taxels of the mask on all four sides
        between &= np.logical_or.accumulate(mask, axis) & np.flip(
            np.logical_or.accumulate(np.flip(mask, axis), axis), axis)
    if not between.any():
        return None
    labels, count = ndimage.label(np.pad(~mask, 1, constant_values=True))
    return labels[1:-1, 1:-1] > 1 if count > 1 else None
