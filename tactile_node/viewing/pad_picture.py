"""Draw a pad as SVG: taxels, outline, names and lengths. Row 0 is at the bottom, as in the pad frame."""

import base64
import struct
import zlib
from functools import cache

import numpy as np
from markupsafe import Markup

from tactile_node.colour_map import PALETTE, value_colours
from tactile_node.taxel_frame import ON_OFF_UNIT, TaxelStatus
from tactile_node.viewing.chart import ticks
from tactile_node.viewing.states import PadState
from tactile_node.viewing.templates import shared

#: length of the longer side of the taxel area [SVG units]
LONGER_SIDE = 16.0
#: largest number of rows or columns that an axis numbers
MOST_NUMBERS = 16
#: opacity of a picture whose readings are out of date
PALE = 0.25
#: scale factor and displayed unit for each unit of taxel values
SHOWN_AS = {'Pa': (1e-3, 'kPa'), 'N': (1.0, 'N'), ON_OFF_UNIT: (1.0, '')}


def pad_picture(state: PadState, full_scale: float, is_old: bool = False) -> Markup:
    """Return a picture of the readings of a pad, with the outline of the contact.

    Parameters
    ----------
    state
        State of the pad.
    full_scale
        Reading shown in the brightest colour, in the unit of the pad.
    is_old
        True to draw the pad pale, because the readings are out of date.
    """
    opaque = np.where(state.status == TaxelStatus.UNMAPPED, 0, 255)
    return taxel_map(
        state.pad, np.dstack((value_colours(state.values, full_scale), opaque)), state.pitch,
        top=reading(full_scale, state.unit), hidden=state.hidden,
        saturated=state.status == TaxelStatus.SATURATED,
        outline=None if state.contact is None else state.contact.outline, opacity=PALE if is_old else 1.0)


def taxel_map(label: str, colours: np.ndarray, pitch: float | None, *, top: tuple[str, str] | None = None,
              hidden: np.ndarray | None = None, saturated: np.ndarray | None = None,
              outline: np.ndarray | None = None, opacity: float = 1.0, axes: str = 'mm') -> Markup:
    """Return a picture of a pad with a colour for each taxel.

    The axes show millimetres from the centre of taxel (0, 0), or the numbers of rows and columns.

    Parameters
    ----------
    label
        Name of the picture.
    colours
        RGB or RGBA colours, 0 to 255, shape (rows, cols, 3 or 4).
    pitch
        Distance between neighbouring taxels [m], or None to number the rows and columns.
    top
        Number and unit at the bright end of the colour bar, or None to draw no bar.
    hidden, saturated
        Masks of the taxels without a valid value, which get a cross, and of the taxels at the end of their range, which
        get a ring; bool (rows, cols).
    outline
        Corners of the outline in the pad frame (n, 2) [m], or None. The outline needs the pitch.
    opacity
        Opacity of the picture, from 0 to 1.
    axes
        Text below the axes.
    """
    rows, cols = colours.shape[:2]
    scale = 1e-3 / pitch if pitch else 1.0  # taxels per unit of the axes
    x_ticks, y_ticks = (ticks(0, 1e3 * pitch * (count - 1)) if pitch else range(0, count, -(-count // MOST_NUMBERS))
                        for count in (cols, rows))
    return shared().pad(
        label, rows, cols, LONGER_SIDE / max(rows, cols), opacity, _png(colours[::-1]), _places(hidden),
        _places(saturated), [(scale * x + 0.5, f'{x:g}') for x in x_ticks],
        [(rows - 0.5 - scale * y, f'{y:g}') for y in y_ticks],
        top, _bar(), '' if outline is None or pitch is None else _points(outline, pitch, rows),
        axes)


def reading(value: float, unit: str) -> tuple[str, str]:
    """Return a reading as number and unit.

    >>> reading(81234.0, 'Pa'), reading(2e6, 'Pa'), reading(0.25, 'N')
    (('81.2', 'kPa'), ('2000', 'kPa'), ('0.25', 'N'))
    """
    factor, name = SHOWN_AS[unit]
    return f'{float(f"{factor * value:.3g}"):g}', name


def _places(mask: np.ndarray | None) -> list[list[int]]:
    """Return the row and column of each True."""
    return [] if mask is None else np.argwhere(mask).tolist()


def _points(corners: np.ndarray, pitch: float, rows: int) -> str:
    """Return ``corners`` (n, 2) [m] as SVG points, with row 0 at the bottom and each taxel a unit square."""
    return ' '.join(f'{x / pitch + 0.5:.3f},{rows - 0.5 - y / pitch:.3f}' for x, y in corners)


@cache
def _bar() -> Markup:
    """Return a picture of the colour bar, with the brightest colour at the top."""
    return _png(PALETTE[::-1, np.newaxis])


def _png(colours: np.ndarray) -> Markup:
    """Return a PNG data URL with one pixel for each of ``colours`` (rows, cols, 3 or 4), the first row at the top."""
    rows, cols, channels = colours.shape
    kind = {3: 2, 4: 6}[channels]
    lines = np.pad(colours.astype(np.uint8).reshape(rows, -1), ((0, 0), (1, 0)))  # 0 before each line: no filter
    data = b''.join((b'\x89PNG\r\n\x1a\n', _chunk(b'IHDR', struct.pack('>2I5B', cols, rows, 8, kind, 0, 0, 0)),
                     _chunk(b'IDAT', zlib.compress(lines.tobytes(), 1)), _chunk(b'IEND', b'')))
    return Markup('data:image/png;base64,' + base64.b64encode(data).decode())  # nosec B704: letters


def _chunk(kind: bytes, content: bytes) -> bytes:
    """Return a chunk of a PNG file (PNG specification, section 5.3)."""
    return struct.pack('>I', len(content)) + kind + content + struct.pack('>I', zlib.crc32(kind + content))
