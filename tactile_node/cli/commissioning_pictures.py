"""Draw the pictures of a commissioning's report with the drawing helpers of `tactile report`."""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from markupsafe import Markup

from tactile_node.commissioning.evaluation import Evaluation
from tactile_node.commissioning.movement import StopWay
from tactile_node.commissioning.plan import CommissioningPlan
from tactile_node.commissioning.taxel_survey import TaxelFinding
from tactile_node.viewing.chart import DOT_WIDTH, LINE_WIDTH, POINT_COLOURS, Frame, ticks
from tactile_node.viewing.pad_picture import taxel_map
from tactile_node.viewing.templates import shared

FRAME = Frame(760, 220, 70, 20, 12, 24)
PAD_WIDTH = 380  #: [pixels]
BLUE, ORANGE, GREEN, VIOLET = POINT_COLOURS
MARGIN = 0.08  #: margin around the points [share of their range]
TAXEL_COLOURS = {TaxelFinding.UNKNOWN: (225, 228, 234), TaxelFinding.WORKS: (46, 139, 87),
                 TaxelFinding.FAULTY: (193, 18, 31)}


class Picture(NamedTuple):
    """A picture of the report."""

    file: str     #: name of the SVG file
    caption: str
    drawing: str


class Curve(NamedTuple):
    """Points, or a line through them."""

    colour: str
    x: Sequence[float] | np.ndarray
    y: Sequence[float] | np.ndarray
    is_line: bool = False


def pictures_of(found: Evaluation, plan: CommissioningPlan) -> list[Picture]:
    """Return the pictures of the steps that are finished."""
    return [*_law(found, plan.unit), *_stops(found), *_proof(found, plan), *_pads(found, plan)]


def _law(found: Evaluation, unit: str) -> list[Picture]:
    if found.law is None:
        return []
    readings = [grip.onset.value for grip in found.grips]
    widths, line = [1e3 * grip.width for grip in found.grips], np.linspace(*found.law.readings, 60)
    residuals = [1e3 * found.law.law.gap(reading) - width for reading, width in zip(readings, widths)]
    bars = [Curve(BLUE, (reading, reading), [each + sign * 2e3 * found.law.opening(reading).deviation
                                             for sign in (-1, 1)], True)
            for reading, each in zip(readings, residuals)]
    return [Picture('opening.svg', 'Opening law (blue) and the gauge blocks (orange).', _drawn(
                [Curve(BLUE, line, [1e3 * found.law.law.gap(each) for each in line], True),
                 Curve(ORANGE, readings, widths)], f' {unit}', ' mm')),
            Picture('opening_residuals.svg', 'Law minus width of the block (orange), with two standard deviations of '
                    'the law (blue).', _drawn([Curve(VIOLET, (min(readings), max(readings)), (0, 0), True), *bars,
                                               Curve(ORANGE, readings, residuals)], f' {unit}', ' mm'))]


def _stops(found: Evaluation) -> list[Picture]:
    curves = []
    for colour, way in zip(POINT_COLOURS, StopWay):
        trials = [(number, 1e3 * trial.stopped) for number, trial in enumerate(found.trials(way), 1)
                  if trial.is_stopped]
        curves.append(Curve(colour, [each[0] for each in trials], [each[1] for each in trials]))
    if not any(len(curve.x) for curve in curves):
        return []
    return [Picture('stops.svg', 'Time from a stop to standstill in each trial: cancel (blue), goal at the present '
                    'position (orange), goal to open (green). Failed trials are left out.', _drawn(curves, '', ' ms'))]


def _proof(found: Evaluation, plan: CommissioningPlan) -> list[Picture]:
    if not found.closes:
        return []
    number = np.arange(1, len(found.closes) + 1)
    ends, limit = (number[0], number[-1]), plan.touch_force
    curves = [Curve(VIOLET, ends, (level, level), True) for level in (limit, limit + found.predicted_overshoot)]
    curves += [Curve(colour, number, [close.forces[pad] for close in found.closes])
               for pad, colour in enumerate((BLUE, GREEN))]
    peaks = Curve(ORANGE, number, [limit + close.overshoot for close in found.closes])
    return [Picture('proof.svg', 'Force of each close: largest (orange), at rest on the left pad (blue) and on the '
                    'right pad (green). The lines (violet) are the force of the stop, and the predicted largest force.',
                    _drawn([*curves, peaks], '', ' N'))]


def _pads(found: Evaluation, plan: CommissioningPlan) -> list[Picture]:
    colours = np.array([TAXEL_COLOURS[each] for each in TaxelFinding])
    return [Picture(f'{name}_pad.svg', f'Taxels of the {name} pad, as its device counts the rows and columns: working '
                    '(green), faulty (red), unknown (grey).',
                    _file(taxel_map(name, colours[taxels], plan.grid.pitch), PAD_WIDTH))
            for name, taxels in zip(('left', 'right'), found.taxels)]


def _drawn(curves: Sequence[Curve], x_unit: str, y_unit: str) -> str:
    """Return a chart of curves."""
    (x_low, x_high), (y_low, y_high) = (_range([getattr(curve, axis) for curve in curves]) for axis in ('x', 'y'))
    paths = []
    for colour, x, y, is_line in curves:
        places = zip(*FRAME.place((np.array(x) - x_low) / (x_high - x_low), (np.array(y) - y_low) / (y_high - y_low)))
        data = ''.join(f'{"L" if is_line and number else "M"}{px:.1f} {py:.1f}{"" if is_line else "h0"}'
                       for number, (px, py) in enumerate(places))
        paths.append((colour, LINE_WIDTH if is_line else 1.6 * DOT_WIDTH, Markup(data)))  # nosec B704: numbers
    x_ticks = [(FRAME.place((each - x_low) / (x_high - x_low), 0)[0], f'{each:.4g}{x_unit}')
               for each in ticks(x_low, x_high)]
    y_ticks = [(FRAME.place(0, (each - y_low) / (y_high - y_low))[1], f'{each:.4g}{y_unit}')
               for each in ticks(y_low, y_high)]
    return _file(shared().chart(FRAME, x_ticks, y_ticks, paths), FRAME.width)


def _range(values: Sequence[Sequence[float] | np.ndarray]) -> tuple[float, float]:
    """Return the range of all values with a margin."""
    everything = np.concatenate([np.array(each, float) for each in values])
    low, high = float(everything.min()), float(everything.max())
    margin = MARGIN * (high - low) or 1.0
    return low - margin, high + margin


def _file(drawing: Markup, width: float) -> str:
    """Return an SVG element of a page as the content of a file. ``width`` is in pixels."""
    box = re.search(r'viewBox="\S+ \S+ (\S+) (\S+)"', drawing)
    assert box is not None, 'the helpers give a viewBox'
    size = f'width="{width:g}" height="{width * float(box[2]) / float(box[1]):.0f}"'
    return str(drawing).replace('<svg ', f'<svg xmlns="http://www.w3.org/2000/svg" {size} ', 1)
