"""State of bus and pads as a table (HTML): what is lost, by reason."""

import math
from html import escape

from tactile_node.view.states import BusFacts, NodeFacts, PadFacts

MOST_TAXELS = 8  #: faulty taxels that are listed
OLD_STATUS = 3.0  #: from which age on a status is marked as old; one comes each second [s]


def health_table(facts: BusFacts | None, age: float = 0.0) -> str:
    """Return the table; it says so where nothing is known, or where ``facts`` are old by their ``age`` [s]."""
    if facts is None:
        return '<div class="tactile-note">no status of a bus comes from this source</div>'
    load = 'not known (log)' if math.isnan(facts.load) else f'{facts.load:.0%}'
    rows = [('status', f'OLD: nothing newer for {age:.0f} s', True)] if age > OLD_STATUS else []
    rows += [('bus', escape(facts.failure or 'no failure'), bool(facts.failure)), ('bus load', load, False)]
    rows += [(_words(name), str(count), True) for name, count in facts.counts.items()]
    for pad in facts.pads:
        rows += _pad_rows(pad)
    return f'<table class="tactile-health">{"".join(map(_row, rows))}</table>'


def _pad_rows(pad: PadFacts) -> list[tuple[str, str, bool]]:
    lost = sum(pad.losses.values())
    missing = pad.expected - pad.used
    rows = [(f'<b>{escape(pad.pad)}</b>', '', False),
            ('frames', f'{pad.frames_complete} complete, {pad.frames_incomplete} incomplete',
             bool(pad.frames_incomplete)),
            ('TPDOs', f'{pad.used} used of {pad.expected} expected, {missing} missing', missing > 0)]
    rows += [(f'lost: {_words(reason)}', str(count), True) for reason, count in pad.losses.items()]
    if not lost:
        rows.append(('lost', 'none', False))
    rows += [(f'node {node.node_id}', _node(node), bool(node.fault)) for node in pad.nodes]
    if pad.faulty_taxels:
        listed = ', '.join(f'({row}, {col}) {escape(fault)}' for row, col, fault in pad.faulty_taxels[:MOST_TAXELS])
        rows.append(('faulty taxels', f'{len(pad.faulty_taxels)}: {listed}', True))
    return rows


def _node(node: NodeFacts) -> str:
    age = 'no heartbeat' if math.isnan(node.heartbeat_age) else f'heartbeat {node.heartbeat_age:.1f} s ago'
    return '; '.join(escape(part) for part in (node.nmt_state, age, node.fault, node.emergency) if part)


def _words(key: str) -> str:
    return escape(key.replace('_', ' '))


def _row(row: tuple[str, str, bool]) -> str:
    name, text, is_bad = row
    return f'<tr{" class=bad" * is_bad}><td>{name}</td><td>{text}</td></tr>'
