"""HTML table of the bus and pad status, with losses by reason."""

import math
from collections import deque

from markupsafe import Markup

from tactile_node.viewing.page_parts import macros
from tactile_node.viewing.states import BusFacts, NodeFacts, PadFacts

MOST_FAULTY_TAXELS = 8  #: maximum number of faulty taxels listed
OLD_STATUS_AGE = 3.0  #: age above which a status is marked as old [s]; the driver publishes a status every second
RECENT_TIME = 60.0  #: age up to which losses are shown in red [s]
NO_PAD = PadFacts('', 0, 0, 0, 0, {})


class HealthHistory:
    """History of a live bus over the last RECENT_TIME seconds, used to tell recent losses from earlier losses."""

    def __init__(self) -> None:
        self._facts: deque[tuple[float, int, BusFacts]] = deque()

    def before(self, facts: BusFacts, stamp: float) -> tuple[BusFacts, float]:
        """Add ``facts`` and return earlier facts for comparison.

        Parameters
        ----------
        facts
            Present facts.
        stamp
            Time at which ``facts`` were recorded [s].

        Returns
        -------
        BusFacts
            Facts from RECENT_TIME ago, or the oldest facts available.
        float
            Age of the returned facts at ``stamp`` [s].
        """
        expected = sum(pad.expected for pad in facts.pads)
        if self._facts and expected < self._facts[-1][1]:
            self._facts.clear()  # the driver restarted, so its counters restarted at 0
        if not self._facts or stamp > self._facts[-1][0]:  # the stamp stops advancing when the driver exits
            self._facts.append((stamp, expected, facts))
        while len(self._facts) > 1 and stamp - self._facts[1][0] >= RECENT_TIME:
            self._facts.popleft()
        return self._facts[0][2], stamp - self._facts[0][0]


def health_table(facts: BusFacts | None, age: float = 0.0, before: tuple[BusFacts, float] | None = None) -> str:
    """Return the table as HTML.

    The table does not show whether a pad is live, because the page updates the pads more often than the table.

    Parameters
    ----------
    facts
        Facts about the bus, or None if the source has none.
    age
        Age of the facts [s]. Facts older than OLD_STATUS_AGE are marked as old.
    before
        Earlier facts from `HealthHistory`, and their age [s]. Losses counted after the earlier facts are shown in red.
        If ``before`` is None, all losses are shown in red.
    """
    if facts is None:
        return '<div class="tactile-note">this source has no bus status</div>'
    load = 'not known (log)' if math.isnan(facts.load) else f'{facts.load:.0%}'
    if age > OLD_STATUS_AGE:  # the current state of the bus and its nodes is unknown
        load = 'not known'
        facts = facts._replace(failure=f'OLD: nothing newer for {age:.0f} s',
                               pads=tuple(pad._replace(nodes=()) for pad in facts.pads))
    faults = sum(bool(node.fault) for pad in facts.pads for node in pad.nodes)
    bus = facts.failure or (f'nodes with a fault: {faults}' if faults else 'no failure')
    rows = [('bus', bus, bus != 'no failure'), ('bus load', load, False)]
    earlier, span = before or (BusFacts('', 0.0, {}, ()), None)
    rows += [_counted(_words(name), str(count), count - earlier.counts.get(name, 0), span)
             for name, count in facts.counts.items()]
    before_by_pad = {pad.pad: pad for pad in earlier.pads}
    for pad in facts.pads:
        rows.append((Markup('<b>{}</b>').format(pad.pad), '', False))
        rows += _pad_rows(pad, before_by_pad.get(pad.pad, NO_PAD), span)
    return str(macros().health(rows))


def _counted(name: str, text: str, recent: int, span: float | None) -> tuple[str, str, bool]:
    """Return a counter's table row, with the ``recent`` counts of the last ``span`` [s] unless ``span`` is None."""
    return name, text if span is None else f'{text} ({recent} in {span:.0f} s)', recent > 0


def _pad_rows(pad: PadFacts, before: PadFacts, span: float | None) -> list[tuple[str, str, bool]]:
    missing = pad.expected - pad.used
    rows = [_counted('frames', f'{pad.frames_complete} complete, {pad.frames_incomplete} incomplete',
                     pad.frames_incomplete - before.frames_incomplete, span),
            _counted('TPDOs', f'{pad.used} used of {pad.expected} expected, {missing} missing',
                     missing - before.expected + before.used, span)]
    rows += [_counted(f'lost: {_words(reason)}', str(count), count - before.losses.get(reason, 0), span)
             for reason, count in pad.losses.items()]
    rows += [(f'node {node.node_id}', _node(node), bool(node.fault)) for node in pad.nodes]
    if pad.faulty_taxels:
        listed = ', '.join(f'({row}, {col}) {fault}' for row, col, fault in pad.faulty_taxels[:MOST_FAULTY_TAXELS])
        rows.append(('faulty taxels', f'{len(pad.faulty_taxels)}: {listed}', True))
    return rows


def _node(node: NodeFacts) -> str:
    """Return the state of a node as text. A fault text already includes the last NMT state and its time."""
    age = 'no heartbeat' if math.isnan(node.heartbeat_age) else f'heartbeat {node.heartbeat_age:.1f} s ago'
    return '; '.join(filter(None, (node.fault or f'{node.nmt_state}; {age}', node.emergency)))


def _words(key: str) -> str:
    return key.replace('_', ' ')
