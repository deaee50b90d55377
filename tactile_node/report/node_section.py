"""The CANopen nodes as HTML: identity, NMT states, heartbeats, EMCYs."""

from tactile_node.cia301.nmt import state_name
from tactile_node.cia301.objects import (
    DEVICE_NAME,
    DEVICE_TYPE,
    HARDWARE_VERSION,
    IDENTITY,
    PRODUCER_HEARTBEAT_TIME,
    SOFTWARE_VERSION,
)
from tactile_node.report.bus_section import shown
from tactile_node.report.markup import Html, facts, folded, joined, paragraph, safe, table
from tactile_node.report.model import NodeFacts

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
