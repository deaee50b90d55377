"""The taxels that are evidence of a contact's outline: its own and those around it, without holes and invalid ones."""

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import box_of, grown, touches_edge
from tactile_node.errors import InputError
from tactile_node.pose.outlines import Window

WINDOW_MARGIN = 2  #: taxels around the contact that are looked at


class Evidence(NamedTuple):
    """The part of a frame that a fit uses; ``values`` and ``used`` are flat, row by row of the window."""

    window: Window
    values: np.ndarray  #: in units of ``level``; 0 where not used
    used: np.ndarray    #: bool
    solid: np.ndarray   #: (rows, cols), values >= 0, invalid taxels and holes filled: for moments
    level: float        #: typical value of the contact, in the unit of the frame
    on_off: bool        #: values are 0 and 1 only
    at_edge: bool       #: of the pad: a part of the contact may be beyond

    @property
    def strength(self) -> float:
        """Typical value times the number of taxels: it grows with the load and with what is seen of the contact."""
        return self.level * int(np.count_nonzero(self.used))


def gather(values: np.ndarray, mask: np.ndarray, at_edge: bool | None = None) -> Evidence:
    """Return the evidence in ``values`` (NaN: invalid) of the contact ``mask``, both (rows, cols).

    ``values`` that are bool, or the numbers 0 and 1 only, are an on/off pattern. ``at_edge``: whether the contact
    touches the pad's edge, where ``mask`` does not show it exactly. Raises InputError.
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
    """Return a frame as float and its contact as bool; InputError where they are none."""
    values, mask = np.asarray(values), np.asarray(mask)
    if values.ndim != 2 or values.shape != mask.shape or values.dtype.kind not in 'biuf':
        raise InputError(
            'frame and contact mask', expected='two arrays of real numbers of one shape (rows, cols)',
            got=f'{values.dtype} {values.shape} and {mask.shape}', remedy='Pass both of one frame.')
    if not mask.any():
        raise InputError('contact mask', expected='at least one taxel', got='none',
                         remedy='Fit only where something touches the pad.')
    return values.astype(float, copy=False), mask.astype(bool, copy=False)


def _window(mask: np.ndarray) -> Window:
    """Around the contact, also beyond the pad's edge: what presses there is felt by the taxels at the edge."""
    rows, cols = box_of(mask)
    return Window(rows.start - WINDOW_MARGIN, cols.start - WINDOW_MARGIN,
                  rows.stop - rows.start + 2 * WINDOW_MARGIN, cols.stop - cols.start + 2 * WINDOW_MARGIN)


def _seen_through(window: Window, taxels: np.ndarray, beyond: float) -> np.ndarray:
    """The window's part of ``taxels``, with the value ``beyond`` where there are none."""
    row, col, rows, cols = window
    part = taxels[max(row, 0):row + rows, max(col, 0):col + cols]
    if part.shape == (rows, cols):
        return part
    whole = np.full((rows, cols), beyond, taxels.dtype)
    below, right = max(-row, 0), max(-col, 0)
    whole[below:below + part.shape[0], right:right + part.shape[1]] = part
    return whole


def upper_median(values: np.ndarray) -> float:
    """Return the upper median, in a quarter of the time of numpy's; 0 of no values."""
    middle = values.size // 2
    return float(np.partition(values, middle)[middle]) if values.size else 0.0


def holes(mask: np.ndarray) -> np.ndarray | None:
    """Return what ``mask`` encloses, None for nothing (the usual case)."""
    begins = mask[:, 1:] & ~mask[:, :-1]
    if (np.add.reduce(begins, 1, int) + mask[:, 0]).max() < 2:  # a row without a gap encloses none
        return None
    between = ~mask
    for axis in (0, 1):  # quick: what is enclosed has taxels of the mask on all four sides
        between &= np.logical_or.accumulate(mask, axis) & np.flip(
            np.logical_or.accumulate(np.flip(mask, axis), axis), axis)
    if not between.any():
        return None
    labels, count = ndimage.label(np.pad(~mask, 1, constant_values=True))
    return labels[1:-1, 1:-1] > 1 if count > 1 else None

