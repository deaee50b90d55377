"""`tactile check` reports all errors in a skin layout and its EDS, and the bus load that the skin causes."""

import argparse
import json
import re
from collections import Counter
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tactile_node.assembly.fault_text import load_text
from tactile_node.bus.bus_settings import DEFAULT_BITRATE, DEFAULT_NODE_ID
from tactile_node.bus.load import MOST_LOAD, planned_load, sweep_bits, sweep_period, tpdo_bits
from tactile_node.cli.options import add_number
from tactile_node.errors import ConfigurationError
from tactile_node.package_files import config_path
from tactile_node.skin.eds import load_eds
from tactile_node.skin.eds_rules import eds_checks
from tactile_node.skin.field_hints import field_hints
from tactile_node.skin.layout import SIDES, SkinLayout
from tactile_node.skin.layout_draft import FILL_IN
from tactile_node.skin.layout_file import read_layout
from tactile_node.skin.layout_rules import collect_errors, layout_checks
from tactile_node.yaml_section import line_of

SYNC_PERIODS = (0.02, 0.01, 0.005)  #: SYNC periods for which the bus load is reported [s]
MOST_ALIKE = 3             #: maximum number of errors with the same remedy printed in full
WIDEST_MAP = 120           #: maximum width of a printed map [columns], because a terminal would wrap a wider map
UNSORTED = ('the TPDOs {} are not in ascending order. List them in the order in which the device sends them; most '
            'devices send them by number')
MAPPED_SIGN = '#'
UNMAPPED_SIGN = '.'
DEAD_SIGN = 'x'


class Use(NamedTuple):
    """Planned use of a layout: the bit rate of the bus, the number of pads on it and the SYNC period."""

    bitrate: int = DEFAULT_BITRATE
    pads: int = 1
    sync_period: float = SYNC_PERIODS[0]  #: time between two SYNCs [s]


class CheckedLayout(NamedTuple):
    """Result of checking one layout."""

    #: checked layout, or None if the layout file cannot be read
    layout: SkinLayout | None
    #: errors that make the driver reject the layout, each with its line in the layout file (None if unknown)
    errors: list[tuple[ConfigurationError, int | None]]
    warnings: list[str]


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('layout', help='skin layout: a file, or a name in config/')
    parser.add_argument('eds', nargs='?', default='', help="EDS (default: the layout's name with .eds)")
    add_number(parser, '--bitrate', int, limits={'least': 1, 'unit': 'bit/s'}, default=DEFAULT_BITRATE,
               help='bit rate of the bus [bit/s] (default: %(default)s)')
    add_number(parser, '--pads', int, limits={'least': 1}, default=1,
               help='number of pads with this layout on the bus (default: %(default)s)')
    add_number(parser, '--sync-period', limits={'above': 0, 'unit': 's', 'remedy': '0.01 is 100 Hz.'}, metavar='S',
               default=SYNC_PERIODS[0],
               help='time between two SYNCs for which the bus load is checked [s] (default: %(default)s)')
    parser.add_argument('--json', action='store_true', help='print one JSON object instead of text')


def run(args: argparse.Namespace) -> int:
    """Print the result. Return 2 if the driver would reject the layout, 1 if there are warnings, else 0."""
    use = Use(args.bitrate, args.pads, args.sync_period)
    found = _checked(args.layout, args.eds, use)
    if args.json:
        print(json.dumps(as_json(found, use)))
    else:
        print('\n'.join(_text(found, use)))
    return 2 if found.errors else 1 if found.warnings else 0


def _checked(layout_name: str, eds: str, use: Use) -> CheckedLayout:
    """Check a skin layout and its EDS against all rules. If ``eds`` is empty, check the EDS next to the layout."""
    try:
        layout = read_layout(layout_name)
    except ConfigurationError as error:
        return CheckedLayout(None, [(error, _line(layout_name, error))], [])
    errors = collect_errors(layout_checks(layout))
    eds, dictionary = eds or layout.source.rsplit('.', 1)[0] + '.eds', None
    try:
        dictionary = load_eds(eds, DEFAULT_NODE_ID)
        errors += collect_errors(eds_checks(dictionary, layout, eds))
    except ConfigurationError as error:
        errors.append(error)
    warnings = _warnings(layout, use) + field_hints(layout, dictionary)
    return CheckedLayout(layout, [(error, _line(layout_name, error)) for error in errors], warnings)


def as_json(found: CheckedLayout, use: Use) -> dict:
    """Return the result as a JSON-compatible dict, with None for unknown values."""
    errors = [{'where': error.where, 'line': line, 'expected': error.expected, 'got': error.got,
               'remedy': error.remedy} for error, line in found.errors]
    return {'errors': errors, 'warnings': found.warnings, **(_facts(found.layout, use) if found.layout else {})}


def _facts(layout: SkinLayout, use: Use) -> dict:
    bits, kinds, loads = sweep_bits(layout), _map(layout), _loads(layout, use)
    return {'rows': layout.rows, 'cols': layout.cols, 'pitch': layout.pitch, 'unit': layout.value.unit,
            'finger_ends': [name for name, side in SIDES.items() if side in layout.finger_ends],
            'nodes': layout.nodes, 'tpdos': len(layout.tpdos), 'polled': layout.domain is not None,
            'unmapped_taxels': int((kinds == UNMAPPED_SIGN).sum()), 'dead_taxels': int((kinds == DEAD_SIGN).sum()),
            'sweep_bits': bits or None, 'pads': use.pads,
            'highest_sweep_rate': use.bitrate / (bits + (use.pads - 1) * tpdo_bits(layout)) if bits else None,
            'event_driven': layout.event_driven is not None,
            'load': {f'{1 / period:.4g} Hz': load for period, load in loads.items()} if bits else None}


def _loads(layout: SkinLayout, use: Use) -> dict[float, float]:
    """Return the bus load by sweep period [s]. Without SYNC, the device sets the sweep period."""
    periods = (use.sync_period, *SYNC_PERIODS) if layout.event_driven is None else (layout.event_driven.period,)
    return {period: planned_load([layout] * use.pads, use.bitrate, period)
            for period in sorted(set(periods), reverse=True)}


def _warnings(layout: SkinLayout, use: Use) -> list[str]:
    found, unmapped = [], np.argwhere(_map(layout) == UNMAPPED_SIGN)
    if len(unmapped):
        row, col = unmapped[0]
        found.append(f'{len(unmapped)} of {layout.rows * layout.cols} taxels are in no TPDO; the first is row {row}, '
                     f'column {col}. The driver treats them as unmapped, not as part of the pad')
    written = Path(layout.source).read_text(encoding='utf-8').splitlines()
    if unfilled := [number for number, line in enumerate(written, 1) if f'# {FILL_IN}' in line]:
        found.append(f'still marked {FILL_IN}: lines {", ".join(map(str, unfilled))}')
    event, period = layout.event_driven, sweep_period(layout, use.sync_period)
    if event is None or event.is_sweeps:
        orders = [[tpdo.number for tpdo in layout.of_node(node).tpdos] for node in range(layout.nodes)]
        found += [UNSORTED.format(', '.join(str(number) for number, _ in groupby(numbers)))
                  for numbers in orders if numbers != sorted(numbers)]
    load = planned_load([layout] * use.pads, use.bitrate, use.sync_period)
    if load > MOST_LOAD:
        found.append(f'at {1 / period:.4g} sweeps a second {load_text(load, use.pads)}')
    elif event is not None and event.is_sweeps and load * period > event.sweep_time:
        found.append(f'a sweep takes {1000 * load * period:.1f} ms, but only {1000 * event.sweep_time:.1f} ms are '
                     'left for it. TPDOs that arrive later are not recognised as part of the sweep. Let the device '
                     'send less often, or use SYNC')
    return found


def _map(layout: SkinLayout) -> np.ndarray:
    """Return a map with one character per taxel, shape (rows, cols): mapped, unmapped or dead."""
    kinds = np.full((layout.rows, layout.cols), UNMAPPED_SIGN)
    inside = [(field.row, field.col) for carrier in layout.carriers for field in carrier.taxels
              if 0 <= field.row < layout.rows and 0 <= field.col < layout.cols]
    for places, kind in ((inside, MAPPED_SIGN), (layout.dead, DEAD_SIGN)):
        for row, col in places:
            if row < layout.rows and col < layout.cols:
                kinds[row, col] = kind
    return kinds


def _text(found: CheckedLayout, use: Use) -> list[str]:
    lines = [] if found.layout is None else _description(found.layout, use)
    lines += _error_lines(found.errors)
    lines += [f'WARNING: {text}.' for text in found.warnings]
    return [*lines, f'errors: {len(found.errors)}, warnings: {len(found.warnings)}']


def _error_lines(errors: list[tuple[ConfigurationError, int | None]]) -> list[str]:
    """Return the first errors for each remedy and count the rest, because every TPDO may repeat the same mistake."""
    lines, alike = [], Counter[str]()
    for error, line in errors:
        alike[error.remedy] += 1
        if alike[error.remedy] <= MOST_ALIKE:
            lines.append(f'ERROR{f" in line {line}" if line else ""}: {error}')
    return lines + [f'ERROR: {count - MOST_ALIKE} more with this remedy (--json has all): {remedy}'
                    for remedy, count in alike.items() if count > MOST_ALIKE]


def _description(layout: SkinLayout, use: Use) -> list[str]:
    facts, kinds = _facts(layout, use), _map(layout)
    carrier = 'one DOMAIN, polled by SDO' if layout.domain else f'{len(layout.tpdos)} CAN frames per sweep'
    lines = [f'{layout.source}: {layout.rows} x {layout.cols} taxels, pitch {1000 * layout.pitch:g} mm, in '
             f'{layout.value.unit}; {layout.nodes} node{"s" * (layout.nodes > 1)}, {carrier}']
    lines.append(f'finger ends together with the skin at: {", ".join(facts["finger_ends"]) or "no side"}; where the '
                 'finger extends beyond the skin, the force of a contact at that edge is a lower bound')
    if facts['load']:
        loads = ', '.join(f'{load:.0%} at {rate}' for rate, load in facts['load'].items())
        if layout.event_driven:
            loads += ' without SYNC' if layout.event_driven.is_sweeps else ' by event timer, more when values change'
        pads = f' with {use.pads} pads' if use.pads > 1 else ''
        lines.append(f'bus load at {use.bitrate / 1e6:g} Mbit/s{pads}: {loads}; highest rate '
                     f'{facts["highest_sweep_rate"]:.0f} sweeps per second')
    if layout.cols <= WIDEST_MAP:
        signs = f'{MAPPED_SIGN} taxel, {UNMAPPED_SIGN} unmapped, {DEAD_SIGN} dead'
        lines += [f'map ({signs}), row 0 first:', *map(''.join, kinds)]
    return lines


def _line(layout_name: str, error: ConfigurationError) -> int | None:
    """Return the line number of the key named in the error, or None if the error is not about the layout file."""
    key = re.search(r'key "(.+)"', error.where)
    return line_of(Path(config_path(layout_name)), key[1]) if key and '.eds' not in error.where else None
