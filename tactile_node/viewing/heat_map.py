"""Draw a pad as SVG: taxels, outline, names and lengths. Row 0 is at the bottom, as in the pad frame."""

import base64
import io

import numpy as np
from markupsafe import Markup
from PIL import Image

from tactile_node.colour_map import PALETTE, STEPS, levels
from tactile_node.taxel_frame import ON_OFF_UNIT, TaxelStatus
from tactile_node.viewing.charts import outline_points, pictures, ticks
from tactile_node.viewing.states import PadState

#: length of the longer side of the taxel area [SVG units]
LONGER_SIDE = 16.0
#: scale factor and displayed unit for each unit of taxel values
SHOWN_AS = {'Pa': (1e-3, 'kPa'), 'N': (1.0, 'N'), ON_OFF_UNIT: (1.0, '')}


def heat_map(state: PadState, full_scale: float, is_old: bool = False) -> Markup:
    """Return an SVG picture of a pad. The axes show millimetres from the centre of taxel (0, 0).

    Parameters
    ----------
    state
        State of the pad.
    full_scale
        Reading shown in the brightest colour, in the unit of the pad.
    is_old
        True to draw the pad pale, because the readings are out of date.
    """
    rows, cols = state.values.shape
    pitch = 1e3 * state.pitch
    factor, name = SHOWN_AS[state.unit]
    hidden = np.isnan(state.values) & (state.status != TaxelStatus.UNMAPPED)
    outline = None if state.contact is None else state.contact.outline
    return pictures().heat_map(
        state.pad, rows, cols, LONGER_SIDE / max(rows, cols), 0.25 if is_old else 1, _png(state, full_scale),
        np.argwhere(hidden).tolist(), np.argwhere(state.status == TaxelStatus.SATURATED).tolist(),
        [(length / pitch + .5, f'{length:g}') for length in ticks(pitch * (cols - 1), 4)],
        [(rows - .5 - length / pitch, f'{length:g}') for length in ticks(pitch * (rows - 1), 4)],
        f'{factor * full_scale:g}', name, '' if outline is None else outline_points(outline, state.pitch, rows))


def _png(state: PadState, full_scale: float) -> Markup:
    """Return a PNG data URL with one pixel per taxel and row 0 at the bottom. A taxel without a value is transparent.
    """
    values = state.values[::-1]
    indices = np.where(np.isnan(values), STEPS - 1, np.minimum(levels(values, full_scale), STEPS - 2))
    picture = Image.frombytes('P', values.shape[::-1], indices.astype(np.uint8).tobytes())
    picture.putpalette(PALETTE.tobytes())
    data = io.BytesIO()
    picture.save(data, 'PNG', compress_level=1, **({'transparency': STEPS - 1} if np.isnan(values).any() else {}))
    return Markup('data:image/png;base64,' + base64.b64encode(data.getvalue()).decode())  # nosec B704: letters
