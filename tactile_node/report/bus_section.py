"""The bus and its CANopen nodes as HTML: load, gaps, NMT commands; identity, NMT states, heartbeats, EMCYs."""

import numpy as np

from tactile_node.cia301.nmt import state_name
from tactile_node.cia301.objects import (
    DEVICE_NAME,
    DEVICE_TYPE,
    HARDWARE_VERSION,
    IDENTITY,
    PRODUCER_HEARTBEAT_TIME,
    SOFTWARE_VERSION,
)
from tactile_node.frames.fault_text import command_text
from tactile_node.frames.health import ForeignCommand
from tactile_node.report.charts import Points, chart, thinned
from tactile_node.report.markup import Html, facts, folded, joined, paragraph, safe, table
from tactile_node.report.model import BusFacts, BusLoad, NodeFacts
from tactile_node.report.pad_section import gap_table

LOAD = '#0072b2'


def bus_section(bus: BusFacts, begin: float, end: float) -> Html:
    parts = [Html('<h2>Bus</h2>'), facts([('channel', ', '.join(bus.channels) or None)]), Html('<h3>Load</h3>')]
    parts.append(paragraph(None) if bus.load is None else _load(bus.load, begin, end))
    parts.append(Html('<h3>CAN frames by service</h3>'))
    parts.append(paragraph(None) if bus.can_frames is None else table(
        ('service', 'CAN frames'), sorted(bus.can_frames.items())))
    parts.append(Html('<h3>Gaps without any CAN frame</h3>'))
    if bus.gaps is None:
        parts.append(paragraph(None))
    elif not bus.gaps:
        parts.append(paragraph('None of half a second or longer.'))
    else:
        parts.append(folded(f'{bus.gap_count} of half a second or longer, the {len(bus.gaps)} longest',
                            gap_table(bus.gaps, begin), is_open=len(bus.gaps) <= 5))
    parts.append(Html('<h3>NMT commands</h3>'))
    if bus.commands is None:
        parts.append(paragraph(None))
    else:
        rows = [(f'{each.stamp - begin:.3f}', command_text(ForeignCommand(each.command, each.node_id)))
                for each in bus.commands]
        parts.append(folded(f'Commands: {shown(bus.command_count, len(rows))}', table(('at [s]', 'command'), rows),
                            is_open=0 < len(rows) <= 10))
    if bus.reported is not None:
        parts += [Html('<h3>Reported by the driver</h3>'),
                  table(('at [s]', 'change'), ((f'{each.stamp - begin:.3f}', each.text) for each in bus.reported))
                  if bus.reported else paragraph('No warning, error or change.')]
    return joined(parts)


def shown(count: int | None, listed: int) -> str:
    """How many there are, and how many are listed."""
    return f'{count}' if count == listed else f'{count}, of which the first and last {listed} are listed'


def _load(load: BusLoad, begin: float, end: float) -> Html:
    if load.shares is not None:
        values, unit, text = 100 * load.shares, '%', f'mean {load.mean:.1%}, at most {load.shares.max():.1%}'
    else:
        assert load.bit_rates is not None
        values, unit = load.bit_rates / 1e3, 'kbit/s'
        text = (f'mean {load.mean / 1e3:.1f} kbit/s, at most {values.max():.1f} kbit/s. The bit rate is not in this '
                'recording; with --bitrate the load is a share of it')
    keep = thinned(values, keep_highest=True)
    line = Points(LOAD, load.stamps[keep] - begin + load.window / 2, values[keep])
    return joined([Html(chart([line], [], end=end - begin, top=1.1 * float(np.max(values, initial=0.0)), unit=unit)),
                   paragraph(f'Over {load.window:g} s, with bit stuffing at its worst: {text}.', 'note')])


TEXTS = DEVICE_NAME, HARDWARE_VERSION, SOFTWARE_VERSION
NAMES = {(IDENTITY, 1): 'vendor (0x1018:1)', (IDENTITY, 2): 'product (0x1018:2)', (IDENTITY, 3): 'revision (0x1018:3)',
         (IDENTITY, 4): 'serial number (0x1018:4)', (DEVICE_TYPE, 0): 'device type (0x1000)',
         (DEVICE_NAME, 0): 'device name (0x1008)', (HARDWARE_VERSION, 0): 'hardware version (0x1009)',
         (SOFTWARE_VERSION, 0): 'software version (0x100A)',
         (PRODUCER_HEARTBEAT_TIME, 0): 'heartbeat time read [ms] (0x1017)'}


def nodes_section(nodes: tuple[NodeFacts, ...] | None, begin: float) -> Html:
    if nodes is None:
        return joined([Html('<h2>Nodes</h2>'), paragraph(None)])
    parts = [Html('<h2>Nodes</h2>')]
    for node in nodes:
        parts += [Html(f'<h3>Node {node.node_id} <small>(0x{node.node_id:02X})</small> '
                       f'{safe(f"pad {node.pad}" if node.pad is not None else "of no pad")}</h3>'), _node(node, begin)]
    return joined(parts)


def _node(node: NodeFacts, begin: float) -> Html:
    identity = [(name, ' then '.join(_value(key[0], value) for value in node.objects[key])
                 if key in node.objects else None) for key, name in NAMES.items()]
    pause = None if node.longest_pause is None else f'{1e3 * node.longest_pause:.0f} ms'
    parts = [facts([*identity, ('heartbeats', node.heartbeats or None), ('longest time between two', pause)])]
    parts.append(_events('NMT states', ('at [s]', 'state'), node.nmt_count,
                         [(f'{change.stamp - begin:.3f}', state_name(change.state)) for change in node.nmt]))
    parts.append(_events('EMCY', ('at [s]', 'message'), node.emergency_count,
                         [(f'{each.stamp - begin:.3f}', getattr(each, 'text', None) or str(each))
                          for each in node.emergencies]))
    return joined(parts)


def _events(name: str, header: tuple[str, ...], count: int | None, rows: list[tuple[str, str]]) -> Html:
    """An absence of messages is only that: a device may have sent some before the recording began."""
    if count is None or not rows:
        return paragraph(Html(f'{safe(name)}: {safe(None)}'))
    return folded(f'{name}: {shown(count, len(rows))}', table(header, rows), is_open=len(rows) <= 20)


def _value(index: int, data: bytes) -> str:
    if index in TEXTS:
        return data.decode('utf-8', 'replace').rstrip('\0')
    number = int.from_bytes(data, 'little')
    return str(number) if index == PRODUCER_HEARTBEAT_TIME else f'0x{number:X}'
