"""A pad as a picture (SVG): taxels, outline, names and lengths. Row 0 is at the bottom, as in the pad's frame."""

import base64
import io
from html import escape

import numpy as np
from PIL import Image

from tactile_node.colour_map import PALETTE, STEPS, levels, rounded_up
from tactile_node.taxel_frame import ON_OFF_UNIT, TaxelStatus
from tactile_node.viewing.states import PadState, SeenContact

NO_VALUE_COLOUR = '#8a8f98'
OUTLINE_COLOUR, FAINT_COLOUR = '#29e6ff', '#5c6672'
LEFT_MARGIN, RIGHT_MARGIN, TOP_MARGIN, BOTTOM_MARGIN = 1.4, 2.9, 0.2, 1.5  #: [units of the picture]
LONGER_SIDE = 16.0  #: of the taxels [units of the picture]
#: what a person reads: factor and name, by unit
SHOWN_AS = {'Pa': (1e-3, 'kPa'), 'N': (1.0, 'N'), ON_OFF_UNIT: (1.0, '')}


def heat_map(state: PadState, full_scale: float, is_old: bool = False) -> str:
    """Return the picture as SVG. ``full_scale``: reading of the brightest colour; ``is_old``: pale, since it is not
    what the pad reads now.
    """
    rows, cols = state.values.shape
    unit = LONGER_SIDE / max(rows, cols)  # of the picture, a taxel
    width, height = cols * unit, rows * unit
    view = (f'{-LEFT_MARGIN:g} {-TOP_MARGIN:g} {width + LEFT_MARGIN + RIGHT_MARGIN:g} '
            f'{height + TOP_MARGIN + BOTTOM_MARGIN:g}')
    opacity = 0.25 if is_old else 1
    parts = [f'<svg class="tactile-map" data-pad="{escape(state.pad, quote=True)}" viewBox="{view}" '
             'xmlns="http://www.w3.org/2000/svg">',
             f'<g opacity="{opacity}"><image href="{_png(state, full_scale)}" width="{width:g}" height="{height:g}" '
             'preserveAspectRatio="none" style="image-rendering:pixelated"/>',
             _marks(state, unit), _axes(state, unit), _colour_bar(state.unit, full_scale, width, height)]
    if state.contact is not None and state.contact.outline is not None:
        parts.append(_outline(state.contact.outline, state.pitch, rows, unit))
    return ''.join((*parts, '</g></svg>'))


def _png(state: PadState, full_scale: float) -> str:
    """One pixel a taxel, row 0 at the bottom; a place without a value is transparent: what lies below marks it."""
    values = state.values[::-1]
    indices = np.where(np.isnan(values), STEPS - 1, np.minimum(levels(values, full_scale), STEPS - 2))
    picture = Image.frombytes('P', values.shape[::-1], indices.astype(np.uint8).tobytes())
    picture.putpalette(PALETTE.tobytes())
    data = io.BytesIO()
    picture.save(data, 'PNG', compress_level=1, **({'transparency': STEPS - 1} if np.isnan(values).any() else {}))
    return 'data:image/png;base64,' + base64.b64encode(data.getvalue()).decode()


def _marks(state: PadState, unit: float) -> str:
    """Grey with a cross: no valid value; a ring: a lower bound. Where the layout maps no taxel, nothing."""
    rows = len(state.values)
    hidden = np.isnan(state.values) & (state.status != TaxelStatus.UNMAPPED)
    squares, crosses = [], []
    for row, col in np.argwhere(hidden).tolist():
        x, y = col * unit, (rows - 1 - row) * unit
        squares.append(f'M{x:g} {y:g}h{unit:g}v{unit:g}h{-unit:g}z')
        crosses.append(f'M{x + .2 * unit:g} {y + .2 * unit:g}l{.6 * unit:g} {.6 * unit:g}m0 {-.6 * unit:g}'
                       f'l{-.6 * unit:g} {.6 * unit:g}')
    bounds = ''.join(f'<circle cx="{(col + .5) * unit:g}" cy="{(rows - row - .5) * unit:g}" r="{.25 * unit:g}"/>'
                     for row, col in np.argwhere(state.status == TaxelStatus.SATURATED).tolist())
    return (f'<path class="no-value" d="{"".join(squares)}" fill="{NO_VALUE_COLOUR}"/>'
            f'<path d="{"".join(crosses)}" stroke="#2b2f36" stroke-width="{.1 * unit:g}" fill="none"/>'
            f'<g fill="none" stroke="#17a34a" stroke-width="{.1 * unit:g}">{bounds}</g>')


def _outline(outline: np.ndarray, pitch: float, rows: int, unit: float) -> str:
    points = ' '.join(f'{(x / pitch + .5) * unit:.3f},{(rows - .5 - y / pitch) * unit:.3f}' for x, y in outline)
    return (f'<polygon class="outline" points="{points}" fill="none" stroke="{OUTLINE_COLOUR}" stroke-width="0.22" '
            'stroke-linejoin="round"/>')


def _axes(state: PadState, unit: float) -> str:
    """Millimetres from the centre of taxel (0, 0)."""
    rows, cols = state.values.shape
    parts = [f'<rect width="{cols * unit:g}" height="{rows * unit:g}" fill="none" stroke="{FAINT_COLOUR}" '
             'stroke-width="0.06"/>']
    for length in _ticks(1e3 * state.pitch * (cols - 1)):
        x = (length / (1e3 * state.pitch) + .5) * unit
        parts.append(_text(x, rows * unit + .85, f'{length:g}', 'middle'))
    for length in _ticks(1e3 * state.pitch * (rows - 1)):
        y = (rows - .5 - length / (1e3 * state.pitch)) * unit
        parts.append(_text(-.2, y + .2, f'{length:g}', 'end'))
    parts.append(_text(cols * unit, rows * unit + 1.45, 'mm', 'end'))
    return ''.join(parts)


def _ticks(length: float) -> list[float]:
    """About four round lengths from 0 to ``length``."""
    step = rounded_up(length / 4) if length else 1.0
    return [k * step for k in range(int(length / step) + 1)]


def _colour_bar(unit_name: str, full_scale: float, width: float, height: float) -> str:
    factor, name = SHOWN_AS[unit_name]
    stops = ''.join(f'<stop offset="{k / 8:g}" stop-color="rgb({r},{g},{b})"/>'
                    for k, (r, g, b) in enumerate(PALETTE[::-1][np.linspace(0, STEPS - 1, 9).astype(int)].tolist()))
    return (f'<defs><linearGradient id="bar" x2="0" y2="1">{stops}</linearGradient></defs>'
            f'<rect x="{width + .5:g}" width=".55" height="{height:g}" fill="url(#bar)"/>'
            + _text(width + 1.2, .6, f'{factor * full_scale:g}', 'start') + _text(width + 1.2, height, '0', 'start')
            + _text(width + 1.2, 1.3, name, 'start'))


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.3g}" y="{y:.3g}" font-size="0.65" fill="{FAINT_COLOUR}" text-anchor="{anchor}">{text}</text>'


def words(contact: SeenContact | None) -> str:
    """Return the contact in one line: what it is, how sure, how large.

    >>> words(SeenContact('square', '', {'square': 0.97}, None, (('side', 0.028),), False, 1.5, None))
    'square 97 %, side 28.0 mm, 1.50 N'
    """
    if contact is None:
        return 'not recognised: no shape comes with these taxels'
    if contact.shape == 'unknown':
        return f'unknown ({contact.reason.replace("_", " ")}){_force(contact)}'
    if contact.shape == 'none':
        return 'nothing touches'
    bound = '≥ ' if contact.size_is_bound else ''
    lengths = ''.join(f', {name.replace("_", " ")} {bound}{1e3 * length:.1f} mm' for name, length in contact.dimensions)
    return f'{contact.shape.replace("_", " ")} {contact.confidence:.0%}'.replace('%', ' %') + lengths \
        + _force(contact)


def _force(contact: SeenContact) -> str:
    return '' if np.isnan(contact.force) else f', {"≥ " if contact.force_is_bound else ""}{contact.force:.2f} N'
