"""Render the report as a single HTML page from report.html, without scripts or external content."""

import math
import platform
from collections.abc import Iterator
from importlib import metadata
from typing import Any

import numpy as np
from markupsafe import Markup

from tactile_node.assembly.fault_text import node_label
from tactile_node.cia301.objects import (
    DEVICE_NAME,
    HARDWARE_VERSION,
    PRODUCER_HEARTBEAT_TIME,
    SOFTWARE_VERSION,
)
from tactile_node.colour_map import value_colours
from tactile_node.contact.press import SMALLEST_CONTACT
from tactile_node.logs.damage import damage_lines, utc
from tactile_node.package_files import package_version
from tactile_node.shape.recognition import Shape, ShapeClass
from tactile_node.taxel_frame import TaxelStatus
from tactile_node.viewing.chart import Series, chart
from tactile_node.viewing.contact_text import force_text, shape_text, size_text
from tactile_node.viewing.counts_table import tpdo_rows
from tactile_node.viewing.findings import findings
from tactile_node.viewing.model import Ends, LoadCurve, NodeReport, PadReport, Report
from tactile_node.viewing.node_record import OBJECTS
from tactile_node.viewing.pad_picture import pad_picture, reading, taxel_map
from tactile_node.viewing.taxel_record import FAULTS, Mark, TaxelHealth, marks_of, no_value_share
from tactile_node.viewing.templates import environment
from tactile_node.viewing.touch import MOST_PICTURES, MOST_TOUCHES, ReportedTouch
from tactile_node.viewing.touch_finder import RECOGNITION_PERIOD

TEXT_OBJECTS = DEVICE_NAME, HARDWARE_VERSION, SOFTWARE_VERSION
#: palette of Okabe and Ito, whose colours remain distinct for colour-blind readers
SHAPE_COLOURS: dict[ShapeClass, str] = {
    Shape.CIRCLE: '#0072b2', Shape.SQUARE: '#d55e00', Shape.RECTANGLE: '#009e73',
    Shape.RIGHT_TRIANGLE: '#cc79a7', Shape.ISOSCELES_TRIANGLE: '#e69f00', Shape.UNKNOWN: '#777777'}
TAUGHT_COLOUR = '#56b4e9'  #: colour of all shapes that `tactile teach` has added
FORCE_COLOUR = '#444444'
LOAD_COLOUR = '#0072b2'
MARK_LEGEND = {Mark.GOOD: ('#2e8b57', 'values in every frame, and they change'),
         Mark.NEVER_CHANGED: ('#b9d8c4', 'never changed (normal for an untouched, quiet taxel)'),
         Mark.SATURATED: ('#f2c14e', 'at the end of its range at times'),
         Mark.SOME_MISSING: ('#f78154', 'no value in some frames'),
         Mark.NO_VALUE: ('#8d3b72', 'no value in any frame'), Mark.FLICKERING: ('#5f7fff', 'flickers'),
         Mark.STUCK: ('#c1121f', 'stuck'), Mark.DEAD: ('#1d1d1d', 'dead'), Mark.UNMAPPED: ('#ececec', 'no taxel')}
MOST_EVENTS = 5  #: maximum number of events listed for a touch
MOST_LISTED_TAXELS = 20  #: maximum number of taxels listed
LIBRARIES = ('python-can', 'canopen', 'numpy', 'scipy', 'rosbags', 'mcap')


def page_of(report: Report) -> str:
    """Return the page. All text from the recording is escaped."""
    begin = report.recording.begin
    functions = {function.__name__: function for function in (
        utc, node_label, force_text, health_pictures, identity_of, load_chart, load_text,
        mark_counts, shape_text, count_text, moves_of, size_text, touch_charts, touch_picture, tpdo_rows,
        worst_taxels)}
    return environment().get_template('report.html').render(
        functions, report=report, recording=report.recording, begin=begin, end=report.recording.end, bus=report.bus,
        versions=versions(),
        at=lambda stamp, digits=3: f'{stamp - begin:.{digits}f}', found=findings(report),
        missing=[('missing', line) for line in damage_lines(report.recording.damages)],
        smallest_contact=SMALLEST_CONTACT, most_touches=MOST_TOUCHES,
        most_pictures=MOST_PICTURES, sample_period=f'{RECOGNITION_PERIOD:g}')


def versions() -> tuple[tuple[str, str], ...]:
    """Return names and versions of the software that makes the report, skipping libraries that are not installed."""
    found = []
    for name in LIBRARIES:
        try:
            found.append((name, metadata.version(name)))
        except metadata.PackageNotFoundError:
            continue
    return (('tactile_skin', package_version()), ('Python', platform.python_version()), *found,
            ('system', f'{platform.system()} {platform.machine()}'))


def count_text(ends: Ends) -> str:
    """Return the total number of entries as text, with the number listed if some are omitted."""
    listed = len(ends)
    return f'{ends.count}' if ends.count == listed else (
        f'{ends.count}, of which the first and last {listed} are listed')


def moves_of(touch: ReportedTouch, begin: float) -> str:
    """Return the first MOST_EVENTS events of the touch as text."""
    said = [f'{event.kind.name.lower()} at {event.stamp - begin:.2f} s' for event in touch.events[:MOST_EVENTS]]
    return ', '.join((*said, *(['...'] if len(touch.events) > MOST_EVENTS else []))) or 'no event'


def touch_picture(touch: ReportedTouch) -> Markup:
    """Draw the frame in which ``touch`` pressed hardest, with the outline."""
    assert touch.picture is not None
    return pad_picture(touch.picture, _top(touch.picture.values))


def touch_charts(pad: PadReport, begin: float, end: float) -> tuple[list[tuple[str, str]], Markup, Markup | str]:
    """Return the shape legend, the confidence chart and the force chart, which is '' if the force is not known."""
    stamps = np.array([sample.stamp for sample in pad.samples]) - begin
    confidence = np.array([sample.confidence for sample in pad.samples])
    force = np.array([sample.force for sample in pad.samples])
    shapes = np.array([sample.shape.value for sample in pad.samples])
    found: Iterator[ShapeClass] = (sample.shape for sample in pad.samples)
    colours = dict.fromkeys((*SHAPE_COLOURS, *found), TAUGHT_COLOUR) | SHAPE_COLOURS
    places = {shape: np.flatnonzero(shapes == shape.value) for shape in colours}
    legend = [(colours[shape], shape.value.replace('_', ' ')) for shape in colours if len(places[shape])]
    dots = [Series(colours[shape], stamps[chosen], confidence[chosen]) for shape, chosen in places.items()]
    forces = chart([Series(FORCE_COLOUR, stamps, force)], 0.0, end - begin, 'N') if np.isfinite(force).any() else ''
    return legend, chart(dots, 0.0, end - begin, ''), forces


def mark_counts(health: TaxelHealth) -> list[tuple[str, str]]:
    marks = marks_of(health)
    return [(colour, f'{text}: {(marks == mark).sum()}') for mark, (colour, text) in MARK_LEGEND.items()
            if (marks == mark).any()]


def health_pictures(pad: PadReport, health: TaxelHealth) -> list[tuple[str, Markup]]:
    """Return titled maps of the taxels' states, highest values and fractions of frames without a value."""
    share = no_value_share(health)
    top, worst = _top(health.highest), float(np.nanmax(share, initial=0.0))
    colours = np.array([list(bytes.fromhex(colour[1:])) for colour, _ in MARK_LEGEND.values()])
    maps = [('State', colours[marks_of(health)], None),
            ('Highest value', value_colours(health.highest, top), reading(top, pad.unit))]
    if worst > 0:
        maps.append(('Frames without a value', value_colours(share, worst), (f'{100 * worst:.3g}', '%')))
    return [(name, taxel_map(name, taxels, pad.pitch, top=text)) for name, taxels, text in maps]


def _top(values: np.ndarray) -> float:
    """Return the highest of ``values``, or 1 if none is above 0."""
    return float(np.nanmax(values, initial=0.0)) or 1.0


def worst_taxels(health: TaxelHealth) -> tuple[list[tuple[Any, ...]], int]:
    """Return table rows for the worst taxels, and the total number of taxels with faults or missing values."""
    share, marks, rows = np.nan_to_num(no_value_share(health)), marks_of(health), []
    odd = [place for place in np.argsort(-share, axis=None, kind='stable')
           if share.flat[place] > 0 or marks.flat[place] in FAULTS]
    for place in odd[:MOST_LISTED_TAXELS]:
        row, col = divmod(int(place), share.shape[1])
        counts = ', '.join(f'{health.by_status[status, row, col]} {status.name.lower().replace("_", " ")}'
                           for status in TaxelStatus if health.by_status[status, row, col])
        rows.append((row, col, MARK_LEGEND[Mark(int(marks[row, col]))][1], f'{share[row, col]:.1%}', counts))
    return rows, len(odd)


def load_chart(load: LoadCurve, begin: float, end: float) -> Markup:
    values, unit = _load_values(load)
    line = Series(LOAD_COLOUR, load.stamps - begin + load.window / 2, values, gap=math.inf)
    return chart([line], 0.0, end - begin, unit)


def load_text(load: LoadCurve) -> str:
    if load.shares is not None:
        return f'mean {load.mean:.1%}, at most {load.shares.max():.1%}'
    values, _ = _load_values(load)
    return (f'mean {load.mean / 1e3:.1f} kbit/s, at most {values.max():.1f} kbit/s. The recording does not contain the '
            'bit rate; give --bitrate to see the load as a percentage')


def _load_values(load: LoadCurve) -> tuple[np.ndarray, str]:
    if load.shares is not None:
        return 100 * load.shares, '%'
    assert load.bit_rates is not None
    return load.bit_rates / 1e3, 'kbit/s'


def identity_of(node: NodeReport) -> list[tuple[str, str | None]]:
    """Return names and values of the objects that identify the device, from its SDO responses."""
    return [(name, ' then '.join(_value(key[0], value) for value in node.objects[key]) if key in node.objects else None)
            for key, name in OBJECTS.items()]


def _value(index: int, data: bytes) -> str:
    if index in TEXT_OBJECTS:
        return data.decode('utf-8', 'replace').rstrip('\0')
    number = int.from_bytes(data, 'little')
    return str(number) if index == PRODUCER_HEARTBEAT_TIME else f'0x{number:X}'
