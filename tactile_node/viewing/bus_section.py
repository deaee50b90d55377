"""The bus and its CANopen nodes as HTML: load, gaps, NMT commands; identity, NMT states, heartbeats, EMCYs."""

import numpy as np

from tactile_node.assembly.fault_text import command_text, node_label
from tactile_node.assembly.health import ForeignCommand
from tactile_node.cia301.objects import (
    DEVICE_NAME,
    DEVICE_TYPE,
    HARDWARE_VERSION,
    IDENTITY,
    PRODUCER_HEARTBEAT_TIME,
    SOFTWARE_VERSION,
    state_name,
)
from tactile_node.taxel_frame import TaxelStatus
from tactile_node.viewing.charts import (
    Html,
    Points,
    cells,
    chart,
    colour_bar,
    facts,
    folded,
    grid,
    heat_cells,
    joined,
    legend_of,
    paragraph,
    safe,
    table,
    thinned,
)
from tactile_node.viewing.model import BusFacts, BusLoad, Gap, NodeFacts, PadFacts, TaxelHealth
from tactile_node.viewing.status_record import Mark, marks_of, no_value_share
from tactile_node.viewing.touch_section import reading, touch_section

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


MARKS = {Mark.GOOD: ('#2e8b57', 'values in every frame, which change'),
         Mark.NEVER_CHANGED: ('#b9d8c4', 'never changed (nor does an untouched, quiet taxel)'),
         Mark.SATURATED: ('#f2c14e', 'at the end of its range at times'),
         Mark.SOME_MISSING: ('#f78154', 'no value in some frames'),
         Mark.NO_VALUE: ('#8d3b72', 'no value in any frame'), Mark.FLICKERING: ('#5f7fff', 'flickers'),
         Mark.STUCK: ('#c1121f', 'stuck'), Mark.DEAD: ('#1d1d1d', 'dead'), Mark.UNMAPPED: ('#ececec', 'no taxel')}
WORST = 20  #: taxels listed


def pad_section(pad: PadFacts, begin: float, end: float) -> Html:
    parts = [Html(f'<h2>Pad {safe(pad.name)}</h2>'), _properties(pad)]
    if pad.are_of_others:
        return joined([*parts, _left_out(pad)])
    parts += [Html('<h3>Touches</h3>'), touch_section(pad, begin, end), Html('<h3>Taxels</h3>')]
    parts += [paragraph(None)] if pad.health is None else [_health(pad.health, pad.unit), _worst(pad.health)]
    return joined([*parts, folded(f'Gaps without a taxel frame ({pad.gap_count})', gap_table(pad.gaps, begin))])


def _left_out(pad: PadFacts) -> Html:
    found = pad.contradiction
    if found is None:
        return paragraph(f'Not heard: its nodes. Heard: {", ".join(map(str, pad.strangers))}, with some of the same '
                         'COB-IDs. The taxels may be of these and are left out. Give the right --node-id, or '
                         '--any-device.', 'problem')
    return paragraph(
        f'{node_label(found.pad, found.node_id)}, object 0x{found.object_index:04X}: expected {found.expected}, got '
        f'{found.got} by the SDO answers in the log. Its taxels would be in wrong places and are left out. Give the '
        'layout and EDS of the device that was recorded, or --any-device.', 'problem')


def gap_table(gaps: tuple[Gap, ...], begin: float) -> Html:
    return table(('after [s]', 'for [s]'), ((f'{gap.begin - begin:.3f}', f'{gap.seconds:.3f}') for gap in gaps))


def _properties(pad: PadFacts) -> Html:
    statistics = pad.statistics
    sent = None if statistics is None else (
        f'{statistics.expected} expected, {statistics.received} received, {statistics.used} used')
    lost = None if pad.losses is None else (
        ', '.join(f'{count} {reason.replace("_", " ")}' for reason, count in pad.losses) or 'none')
    period = None if pad.period is None else f'{1e3 * pad.period:.1f} ms'
    return facts([
        ('taxels', f'{pad.rows} x {pad.cols}, pitch {1e3 * pad.pitch:g} mm, values in {pad.unit}'),
        ('node-IDs', ', '.join(map(str, pad.node_ids)) or None), ('layout', pad.layout),
        ('SHA-256 of the layout', pad.layout_sha256),
        ('taxel frames', f'{pad.frames}, {pad.incomplete} of them incomplete, {pad.lost_frames} missing by their '
                         'sequence'),
        ('median period', period), ('TPDOs, or SDO uploads', sent), ('lost CAN frames by reason', lost)])


def _health(health: TaxelHealth, unit: str) -> Html:
    marks, share = marks_of(health), no_value_share(health)
    rows, cols = marks.shape
    top = float(np.nanmax(health.highest, initial=0.0))
    pictures = [('State', cells([(colour, marks == mark) for mark, (colour, _) in MARKS.items()]), ''),
                ('Highest value', heat_cells(health.highest, top), colour_bar(reading(top, unit)))]
    worst = float(np.nanmax(share, initial=0.0))
    if worst > 0:
        pictures.append(('Frames without a value', heat_cells(share, worst), colour_bar(f'{worst:.1%}')))
    legend = legend_of((colour, f'{text}: {(marks == mark).sum()}') for mark, (colour, text) in MARKS.items()
                       if (marks == mark).any())
    figures = ''.join(f'<figure><figcaption><b>{name}</b></figcaption>{grid(rows, cols, content, name)}{bar}</figure>'
                      for name, content, bar in pictures)
    return joined([legend, Html(f'<div class="cards">{figures}</div>'),
                   paragraph('Row 0 is at the bottom, column 0 at the left. Dead, stuck and flickering taxels are '
                             'found by what they send in several touches; without touches none is found.', 'note')])


def _worst(health: TaxelHealth) -> Html:
    """The taxels that most often had no value."""
    share = np.nan_to_num(no_value_share(health))
    marks = marks_of(health)
    odd = [place for place in np.argsort(-share, axis=None, kind='stable')
           if share.flat[place] > 0 or marks.flat[place] in (Mark.FLICKERING, Mark.STUCK, Mark.DEAD)]
    if not odd:
        return paragraph('Every taxel had a value in every frame.')
    rows = []
    for place in odd[:WORST]:
        row, col = divmod(int(place), share.shape[1])
        counts = ', '.join(f'{health.by_status[status, row, col]} {status.name.lower().replace("_", " ")}'
                           for status in TaxelStatus if health.by_status[status, row, col])
        rows.append((row, col, MARKS[Mark(int(marks.flat[place]))][1], f'{share.flat[place]:.1%}', counts))
    more = f' (the worst {WORST} of {len(odd)})' if len(odd) > WORST else f' ({len(odd)})'
    return folded('Taxels without a value, or faulty' + more,
                  table(('row', 'column', 'state', 'without a value', 'frames by status'), rows))
