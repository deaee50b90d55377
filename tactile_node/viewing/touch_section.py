"""The touches of a pad as HTML: pictures, a table, and confidence and force over time."""

import math

import numpy as np

from tactile_node.contact.neighbours import SMALLEST_CONTACT
from tactile_node.shape.recognition import Shape, ShapeClass
from tactile_node.viewing.charts import (
    Html,
    Points,
    chart,
    colour_bar,
    facts,
    folded,
    grid,
    heat_cells,
    joined,
    legend_of,
    outline,
    paragraph,
    safe,
    table,
    thinned,
)
from tactile_node.viewing.model import PadFacts
from tactile_node.viewing.touch import MOST_TOUCHES, PICTURED, Touch
from tactile_node.viewing.touch_finder import RECOGNITION_PERIOD

#: Okabe and Ito: distinct with every kind of colour vision
COLOURS: dict[ShapeClass, str] = {
    Shape.CIRCLE: '#0072b2', Shape.SQUARE: '#d55e00', Shape.RECTANGLE: '#009e73',
    Shape.RIGHT_TRIANGLE: '#cc79a7', Shape.ISOSCELES_TRIANGLE: '#e69f00', Shape.UNKNOWN: '#777777'}
TAUGHT = '#56b4e9'  #: shapes that `tactile teach` has added, all of them
FORCE = '#444444'


def touch_section(pad: PadFacts, begin: float, end: float) -> Html:
    """``begin`` and ``end`` of the recording: times are given from its begin."""
    if not pad.touches:
        return paragraph(f'No touch in this recording{_small(pad)}.')
    pictured = [(number, touch) for number, touch in enumerate(pad.touches, 1) if touch.picture is not None]
    left_out = (f' {pad.touches_left_out} more, beyond the first {MOST_TOUCHES}, are not listed.'
                if pad.touches_left_out else '')
    shown = '' if len(pictured) == len(pad.touches) else (
        f' Pictures are of the {PICTURED} longest; {len(pad.touches) - len(pictured)} others are in the table alone.')
    cards = Html(''.join(_card(number, touch, pad, begin) for number, touch in pictured))
    return joined([
        paragraph(f'{len(pad.touches)} touches{_small(pad)}.{left_out}{shown}'), _chart(pad, begin, end),
        Html(f'<div class="cards">{cards}</div>'),
        folded(f'All {len(pad.touches)} touches as a table', _table(pad, begin))])


def name_of(touch: Touch) -> str:
    """The shape, and why it is unknown."""
    name = touch.shape.value.replace('_', ' ')
    return f'{name}: {touch.reason.name.lower().replace("_", " ")}' if touch.shape is Shape.UNKNOWN else name


def _small(pad: PadFacts) -> str:
    return (f', and {pad.small_frames} frames with contacts of fewer than {SMALLEST_CONTACT} taxels alone (noise, or '
            'an edge)' if pad.small_frames else '')


def _card(number: int, touch: Touch, pad: PadFacts, begin: float) -> str:
    picture = touch.picture
    assert picture is not None
    top = float(np.nanmax(picture.values, initial=0.0))
    content = heat_cells(picture.values, top)
    if picture.fit is not None:
        content += outline(picture.fit.outline, pad.pitch, pad.rows)
    rows = [('time', f'{touch.begin - begin:.2f} ... {touch.end - begin:.2f} s ({touch.frames} frames)'),
            ('size', _size(touch)), ('force', _force(touch)), ('area', f'{touch.taxels} taxels'),
            ('strongest', f'at {picture.stamp - begin:.2f} s')]
    return (f'<figure><figcaption><b>{number}. {safe(name_of(touch))}</b> '
            f'<span class="share">{touch.confidence:.0%}</span></figcaption>'
            f'{grid(pad.rows, pad.cols, content, f"touch {number}")}{colour_bar(reading(top, pad.unit))}'
            f'{facts(rows)}</figure>')


def _size(touch: Touch) -> str:
    if not touch.dimensions:
        return 'no outline'
    bound = ' (a bound: at the edge, partly hidden or saturated)' if touch.size_is_bound else ''
    lengths = ', '.join(f'{name.replace("_", " ")} {1e3 * length:.1f}' for name, length in touch.dimensions)
    return f'{lengths} mm{bound}'


def _force(touch: Touch) -> str:
    """On/off taxels give none."""
    return 'not known' if math.isnan(touch.force) else f'{"≥ " if touch.force_is_bound else ""}{touch.force:.2f} N'


def reading(value: float, unit: str) -> str:
    """
    >>> reading(81200.0, 'Pa'), reading(0.25, 'N')
    ('81.2 kPa', '0.25 N')
    """
    return f'{value / 1e3:.1f} kPa' if unit == 'Pa' else f'{value:.2f} N' if unit == 'N' else f'{value:g} (on/off)'


def _table(pad: PadFacts, begin: float) -> Html:
    return table(('', 'begin [s]', 'end [s]', 'frames', 'shape', 'confidence', 'size', 'force', 'taxels', ''), (
        (number, f'{touch.begin - begin:.3f}', f'{touch.end - begin:.3f}', touch.frames, name_of(touch),
         f'{touch.confidence:.0%}', _size(touch), _force(touch), touch.taxels,
         'the recording ends within it' if touch.is_open else '') for number, touch in enumerate(pad.touches, 1)))


def _chart(pad: PadFacts, begin: float, end: float) -> Html:
    stamps = np.array([sample.stamp for sample in pad.samples]) - begin
    confidence = np.array([sample.confidence for sample in pad.samples])
    force = np.array([sample.force for sample in pad.samples])
    shapes = np.array([sample.shape.value for sample in pad.samples])
    keep = thinned(confidence, keep_highest=False)
    colours = {shape: COLOURS.get(shape, TAUGHT) for shape in (*COLOURS, *dict.fromkeys(s.shape for s in pad.samples))}
    dots = [Points(colour, stamps[chosen], confidence[chosen]) for shape, colour in colours.items()
            if len(chosen := keep[shapes[keep] == shape.value])]
    legend = legend_of((colour, shape.value.replace('_', ' ')) for shape, colour in colours.items()
                       if (shapes == shape.value).any())
    charts = [Html('<h4>Confidence by shape</h4>'), legend, Html(chart([], dots, end=end - begin, top=1.0, unit=''))]
    known = np.flatnonzero(np.isfinite(force))
    if len(known):
        known = known[thinned(force[known], keep_highest=True)]
        charts += [Html('<h4>Force on the contact</h4>'),
                   Html(chart([], [Points(FORCE, stamps[known], force[known])], end=end - begin,
                              top=1.1 * float(force[known].max()), unit='N'))]
    return joined([*charts, paragraph(
        f'Recognised again from the taxel frames by this version, every {RECOGNITION_PERIOD:g} s of a touch, without '
        'tare and calibration. Seconds from the begin of the recording.', 'note')])
