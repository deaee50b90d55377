"""Draw the pictures of a commissioning's report with the drawing helpers of `tactile report`."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from tactile_node.commissioning.evaluation import Evaluation
from tactile_node.commissioning.movement import StopWay
from tactile_node.commissioning.plan import CommissioningPlan
from tactile_node.commissioning.report_lines import MOST_LATENCY
from tactile_node.commissioning.taxel_survey import TaxelFinding
from tactile_node.viewing.chart import DOT_WIDTH, LINE_WIDTH, POINT_COLOURS, PlotArea, Series, ticks
from tactile_node.viewing.pad_picture import taxel_map
from tactile_node.viewing.templates import shared

FRAME = PlotArea(760, 250, 76, 20, 26, 44)
PAD_WIDTH = 380  #: [pixels]
PAD_AXES = 'column, row (up); red: faulty, grey: unknown'
BLUE, ORANGE, GREEN, VIOLET = POINT_COLOURS
GREY = '#5c6672'
LINE = np.inf  #: gap of a series that is drawn as a line
BESIDE = 0.1  #: distance by which the point of a pad is drawn beside the number of its close, so that both are visible
MARGIN = 0.08  #: margin around the points [share of their range]
TAXEL_COLOURS = {TaxelFinding.UNKNOWN: (225, 228, 234), TaxelFinding.WORKS: (46, 139, 87),
                 TaxelFinding.FAULTY: (193, 18, 31)}


def pictures_of(found: Evaluation, plan: CommissioningPlan) -> dict[str, tuple[str, str]]:
    """Return the caption and the SVG drawing of each picture of the finished steps, by the name of its file."""
    return _law(found, plan.unit) | _stops(found) | _proof(found, plan) | _pads(found, plan)


def _law(found: Evaluation, unit: str) -> dict[str, tuple[str, str]]:
    if found.law is None:
        return {}
    position = f'position of the joint [{unit}]'
    readings = np.array([grip.onset.value for grip in found.grips])
    widths, line = np.array([grip.width for grip in found.grips]), np.linspace(*found.law.readings, 60)
    misses = np.array([found.law.opening(reading).value for reading in readings]) - widths
    spreads = [2 * found.law.opening(reading).deviation for reading in readings]
    bars = [Series(BLUE, np.array((reading, reading)), 1e3 * np.array((miss - spread, miss + spread)), LINE)
            for reading, miss, spread in zip(readings, misses, spreads)]
    return {
        'opening.svg': ('Opening over the position of the joint: law (blue) and gauge blocks (orange).', _drawn(
            [Series(BLUE, line, np.array([1e3 * found.law.opening(each).value for each in line]), LINE),
             Series(ORANGE, readings, 1e3 * widths)], position, 'opening [mm]', {'law': BLUE, 'gauge blocks': ORANGE})),
        'opening_residuals.svg': (
            'Law minus width of the block (orange) over the position of the joint, with two standard deviations of the '
            'law (blue).',
            _drawn([Series(VIOLET, line, np.zeros(line.shape), LINE), *bars, Series(ORANGE, readings, 1e3 * misses)],
                   position, 'law minus width [mm]', {'law minus width of the block': ORANGE,
                                                      'two standard deviations of the law': BLUE, 'zero': VIOLET}))}


def _stops(found: Evaluation) -> dict[str, tuple[str, str]]:
    longest = max(len(found.tried(way).trials) for way in StopWay)
    curves = [Series(colour, np.array((1, longest)), np.full(2, level), LINE)
              for colour, level in ((GREY, 0.0), (VIOLET, 1e3 * MOST_LATENCY))]
    for colour, way in zip(POINT_COLOURS, StopWay):
        stopped = np.array([1e3 * trial.stopped if trial.is_stopped else np.nan for trial in found.tried(way).trials])
        known = np.isfinite(stopped)
        curves.append(Series(colour, 1 + np.flatnonzero(known), stopped[known]))
    return {'stops.svg': (
        'Time from a stop to standstill over the number of the trial: cancel (blue), goal at the present position '
        f'(orange), reverse (green). The line (violet) shows the limit of {MOST_LATENCY:g} s. Failed trials are left '
        'out.',
        _drawn(curves, 'number of the trial', 'time to standstill [ms]',
               {**{way.value: colour for colour, way in zip(POINT_COLOURS, StopWay)}, 'limit': VIOLET}))} if any(
            curve.x.size for curve in curves[2:]) else {}


def _proof(found: Evaluation, plan: CommissioningPlan) -> dict[str, tuple[str, str]]:
    if not found.closes:
        return {}
    number, limit = np.arange(1, len(found.closes) + 1), plan.touch_force
    curves = [Series(VIOLET, number, np.full(number.shape, level), LINE)
              for level in (limit, limit + found.predicted_overshoot)]
    curves += [Series(colour, number + beside, np.array([close.forces[pad] for close in found.closes]))
               for pad, (colour, beside) in enumerate(((BLUE, -BESIDE), (GREEN, BESIDE)))]
    curves.append(Series(ORANGE, number, limit + np.array([close.overshoot for close in found.closes])))
    return {'proof.svg': (
        'Force over the number of the close: largest (orange), at rest on the left pad (blue) and on the right pad '
        '(green). The lines (violet) show the force of the stop, and the predicted largest force.',
        _drawn(curves, 'number of the close', 'force [N]', {
            'largest': ORANGE, 'at rest, left': BLUE, 'at rest, right': GREEN, 'stop and prediction': VIOLET}))}


def _pads(found: Evaluation, plan: CommissioningPlan) -> dict[str, tuple[str, str]]:
    colours = np.array([TAXEL_COLOURS[each] for each in TaxelFinding])
    return {f'{name}_pad.svg': (
        f'Taxels of the {name} pad, as its device counts the rows and columns: working (green), faulty (red), unknown '
        '(grey).', _file(taxel_map(name, colours[taxels], None, axes=PAD_AXES), PAD_WIDTH))
        for name, taxels in zip(('left', 'right'), found.taxels)}


def _drawn(curves: Sequence[Series], x_title: str, y_title: str, legend: Mapping[str, str]) -> str:
    """Return a chart of curves. Unlike in `chart`, the axes begin at the smallest values, and x is not a time.

    ``legend`` gives the colour of each name.
    """
    x_low, x_high = _range([curve.x for curve in curves])
    y_low, y_high = _range([curve.y for curve in curves])

    def place(x: Any, y: Any) -> tuple[Any, Any]:
        return FRAME.place((x - x_low) / (x_high - x_low), (y - y_low) / (y_high - y_low))
    paths = [(colour, LINE_WIDTH if gap else 1.6 * DOT_WIDTH, Markup(''.join(  # nosec B704: numbers
        f'{"L" if gap and number else "M"}{x:.1f} {y:.1f}{"" if gap else "h0"}'
        for number, (x, y) in enumerate(zip(*place(xs, ys)))))) for colour, xs, ys, gap in curves]
    x_ticks = [(place(each, y_low)[0], f'{each:.4g}') for each in ticks(x_low, x_high)]
    y_ticks = [(place(x_low, each)[1], f'{each:.4g}') for each in ticks(y_low, y_high)]
    places = np.linspace(FRAME.left, FRAME.width - FRAME.right, len(legend), endpoint=False)
    names = [(x, colour, name) for x, (name, colour) in zip(places, legend.items())]
    return _file(shared().chart(FRAME, x_ticks, y_ticks, paths, x_title, y_title, names), FRAME.width)


def _range(values: Sequence[np.ndarray]) -> tuple[float, float]:
    """Return the range of all values with a margin."""
    everything = np.concatenate(values)
    margin = MARGIN * float(np.ptp(everything)) or 1.0
    return float(everything.min()) - margin, float(everything.max()) + margin


def _file(drawing: Markup, width: float) -> str:
    """Return an SVG element of a page as the content of a file. ``width`` is in pixels."""
    box = re.search(r'viewBox="\S+ \S+ (\S+) (\S+)"', drawing)
    assert box is not None, 'the helpers give a viewBox'
    size = f'width="{width:g}" height="{width * float(box[2]) / float(box[1]):.0f}"'
    return str(drawing).replace('<svg ', f'<svg xmlns="http://www.w3.org/2000/svg" {size} ', 1)
