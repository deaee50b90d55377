"""The taxels to which an outline is fitted.

These are the taxels of the contact and those around it, without holes and invalid taxels.
"""

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import box_of, grown, touches_edge
from tactile_node.errors import InputError
from tactile_node.pose.outlines import Window

WINDOW_MARGIN = 2  #: Number of taxels around the contact that belong to the window.


class Evidence(NamedTuple):
    """The part of a frame that a fit uses; ``values`` and ``used`` are flat, row by row of the window."""

    window: Window
    values: np.ndarray  #: values in units of ``level``; 0 where a taxel is not used
    used: np.ndarray    #: bool, taxels that the fit uses
    solid: np.ndarray   #: (rows, cols), values >= 0 with invalid taxels and holes filled, for moments
    level: float        #: typical value of the contact, in the unit of the frame
    on_off: bool        #: True if all values are 0 or 1
    at_edge: bool       #: True if the contact touches the pad's edge, so that a part of it may be beyond

    @property
    def strength(self) -> float:
        """Typical value times the number of taxels; grows with the load and with the visible part of the contact."""
        return self.level * int(np.count_nonzero(self.used))


def gather(values: np.ndarray, mask: np.ndarray, at_edge: bool | None = None) -> Evidence:
    """Return the evidence of a contact.

    Parameters
    ----------
    values : np.ndarray
        Taxel values, (rows, cols); NaN where a taxel is invalid. Values of bool, or of the numbers 0 and 1 only, are an
        on/off pattern.
    mask : np.ndarray
        Taxels of the contact, bool (rows, cols).
    at_edge : bool or None
        True if the contact touches the pad's edge; None to derive it from ``mask``.

    Raises
    ------
    InputError
        If the arrays have different shapes or are not real numbers, or if the mask is empty.
    """
    values, mask = checked(values, mask)
    window, at_edge = _window(mask), touches_edge(mask) if at_edge is None else at_edge
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
                    level=level, on_off=on_off, at_edge=at_edge)


def checked(values: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a frame as float and its contact as bool.

    Raises
    ------
    InputError
        If the arrays have different shapes or are not real numbers, or if the mask is empty.
    """
    values, mask = np.asarray(values), np.asarray(mask)
    if values.ndim != 2 or values.shape != mask.shape or values.dtype.kind not in 'biuf':
        raise InputError(
            'frame and contact mask', expected='two arrays of real numbers with the same shape (rows, cols)',
            got=f'{values.dtype} {values.shape} and {mask.shape}', remedy='Pass the values and the mask of one frame.')
    if not mask.any():
        raise InputError('contact mask', expected='at least one taxel', got='none',
                         remedy='Fit only where something touches the pad.')
    return values.astype(float, copy=False), mask.astype(bool, copy=False)


def _window(mask: np.ndarray) -> Window:
    """Return the window around the contact, which may extend beyond the pad's edge.

    The taxels at the edge also feel a load beyond the edge.
    """
    rows, cols = box_of(mask)
    return Window(rows.start - WINDOW_MARGIN, cols.start - WINDOW_MARGIN,
                  rows.stop - rows.start + 2 * WINDOW_MARGIN, cols.stop - cols.start + 2 * WINDOW_MARGIN)


def _seen_through(window: Window, taxels: np.ndarray, beyond: float) -> np.ndarray:
    """Return the part of ``taxels`` in the window, with the value ``beyond`` where there are no taxels."""
    row, col, rows, cols = window
    part = taxels[max(row, 0):row + rows, max(col, 0):col + cols]
    if part.shape == (rows, cols):
        return part
    whole = np.full((rows, cols), beyond, taxels.dtype)
    below, right = max(-row, 0), max(-col, 0)
    whole[below:below + part.shape[0], right:right + part.shape[1]] = part
    return whole


def upper_median(values: np.ndarray) -> float:
    """Return the upper median, or 0 without values; four times as fast as numpy's median."""
    middle = values.size // 2
    return float(np.partition(values, middle)[middle]) if values.size else 0.0


def holes(mask: np.ndarray) -> np.ndarray | None:
    """Return the taxels that ``mask`` encloses; None if there are none, which is the usual case."""
    begins = mask[:, 1:] & ~mask[:, :-1]
    if (np.add.reduce(begins, 1, int) + mask[:, 0]).max() < 2:  # no row has a gap
        return None
    between = ~mask
    for axis in (0, 1):  # a fast first check: an enclosed taxel has taxels of the mask on all four sides
        between &= np.logical_or.accumulate(mask, axis) & np.flip(
            np.logical_or.accumulate(np.flip(mask, axis), axis), axis)
    if not between.any():
        return None
    labels, count = ndimage.label(np.pad(~mask, 1, constant_values=True))
    return labels[1:-1, 1:-1] > 1 if count > 1 else None

