"""Table of the counts of a bus and its pads, with losses by reason, for the page of the view and for the report."""

import math
from collections.abc import Mapping

from markupsafe import Markup

from tactile_node.assembly.facts import BUS_LOSSES, BusFacts, NodeFacts, PadFacts, losses_in, pad_counts
from tactile_node.viewing.levels import OLD_STATUS_AGE, levels_of
from tactile_node.viewing.templates import shared

#: name, text, and True if the row reports a problem
Row = tuple[str, str, bool]

MOST_FAULTY_TAXELS = 8  #: maximum number of faulty taxels listed
RECENT_TIME = 60.0  #: age up to which losses are shown in red [s]


def counts_table(facts: BusFacts | None, age: float = 0.0, before: tuple[BusFacts, float] | None = None) -> str:
    """Return the table as HTML.

    The table does not show whether a pad is live, because the page updates the pads more often than the table.

    Parameters
    ----------
    facts
        Facts about the bus or a SkinStatus message, or None if the source has none.
    age
        Age of the facts [s]. Facts older than OLD_STATUS_AGE are marked as old.
    before
        Earlier facts from a `FactsHistory`, and their age [s]. Losses counted after the earlier facts are shown in red.
        If ``before`` is None, all losses are shown in red.
    """
    if facts is None:
        return '<div class="tactile-note">this source has no bus status</div>'
    is_old = age > OLD_STATUS_AGE  # then the current state of the bus and its nodes is unknown
    faults = sum(bool(node.fault_text) for pad in facts.pads for node in pad.nodes)
    if is_old:
        bus, load = f'OLD: nothing newer for {age:.0f} s', 'not known'
    else:
        bus = str(facts.failure or (f'nodes with a fault: {faults}' if faults else 'no failure'))
        load = 'not known (log)' if math.isnan(facts.bus_load) else f'{facts.bus_load:.0%}'
    rows: list[Row] = [('bus', bus, bus != 'no failure'), ('bus load', load, False)]
    rows += [] if is_old else levels_of(facts)
    earlier, span = before or (BusFacts(), None)
    rows += [_counted(_words(name), str(count), count - getattr(earlier, name), span)
             for name in BUS_LOSSES if (count := getattr(facts, name))]
    before_by_pad = {pad.pad: pad_counts(pad) for pad in earlier.pads}
    for pad in facts.pads:
        counts = recent = pad_counts(pad)
        if pad.pad in before_by_pad:
            recent = counts.copy()
            recent.subtract(before_by_pad[pad.pad])
        rows += [(Markup('<b>{}</b>').format(pad.pad), '', False), _frame_row(counts, recent, span),
                 *tpdo_rows(counts, recent, span), *([] if is_old else _node_rows(pad)), *_taxel_rows(pad)]
    return str(shared().facts(rows))


def tpdo_rows(counts: Mapping[str, int], recent: Mapping[str, int], span: float | None = None) -> list[Row]:
    """Return the rows about the TPDOs of a pad: used, missing, and lost for each reason.

    Parameters
    ----------
    counts
        Counts of the pad from `pad_counts`.
    recent
        Counts since the earlier facts with which the table is compared. Losses among them are shown in red.
    span
        Age of the earlier facts [s], or None if there are none.
    """
    expected, used = counts['tpdos_expected'], counts['tpdos_used']
    lost_recently = losses_in(recent)
    return [_counted('TPDOs', f'{counts["tpdos_received"]} received, {used} used of {expected} expected, '
                     f'{expected - used} missing', recent['tpdos_expected'] - recent['tpdos_used'], span),
            *(_counted(f'lost: {_words(reason)}', str(count), lost_recently.get(reason, 0), span)
              for reason, count in losses_in(counts).items())]


def _counted(name: str, text: str, recent: int, span: float | None) -> Row:
    """Return a counter's table row, with the ``recent`` counts of the last ``span`` [s] unless ``span`` is None."""
    return name, text if span is None else f'{text} ({recent} in {span:.0f} s)', recent > 0


def _frame_row(counts: Mapping[str, int], recent: Mapping[str, int], span: float | None) -> Row:
    return _counted('frames', f'{counts["frames_complete"]} complete, {counts["frames_incomplete"]} incomplete',
                    recent['frames_incomplete'], span)


def _node_rows(pad: PadFacts) -> list[Row]:
    return [(f'node {node.node_id}', _node(node), bool(node.fault_text)) for node in pad.nodes]


def _taxel_rows(pad: PadFacts) -> list[Row]:
    """Return the row about faulty taxels. Only a SkinStatus message lists them, because only the driver knows them."""
    faulty = getattr(pad, 'faulty_taxels', ())
    if not faulty:
        return []
    listed = ', '.join(f'({taxel.row}, {taxel.col}) {taxel.fault}' for taxel in faulty[:MOST_FAULTY_TAXELS])
    return [('faulty taxels', f'{len(faulty)}: {listed}', True)]


def _node(node: NodeFacts) -> str:
    """Return the state of a node as text. A fault text already includes the last NMT state and its time."""
    age = 'no heartbeat' if math.isnan(node.heartbeat_age) else f'heartbeat {node.heartbeat_age:.1f} s ago'
    return '; '.join(filter(None, (node.fault_text or f'{node.nmt_state_text}; {age}', str(node.emcy_last or ''))))


def _words(key: str) -> str:
    return key.replace('_', ' ')
