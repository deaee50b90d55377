"""Tests that each counter is one row of a table.

The status, /diagnostics, the view and the reference must contain exactly the counters of the tables.
"""

import sys
from pathlib import Path

import pytest

pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')
pytest.importorskip('jinja2')

from diagnosed import diagnosed  # noqa: E402
from diagnostic_msgs.msg import DiagnosticStatus  # noqa: E402

from tactile_node.assembly import counters  # noqa: E402
from tactile_node.assembly.counters import Counter  # noqa: E402
from tactile_node.assembly.frame_source import BusStatistics, LossReason, PadStatistics  # noqa: E402
from tactile_node.assembly.health import BusHealth, NodeHealth  # noqa: E402
from tactile_node.cia301.objects import NmtState  # noqa: E402
from tactile_node.ros.diagnostics import BusDiagnostics  # noqa: E402
from tactile_node.ros.status_message import status_message  # noqa: E402
from tactile_node.viewing.counts_table import counts_table  # noqa: E402
from tactile_node.viewing.states import facts_of, facts_of_status  # noqa: E402
from tactile_skin.msg import NodeStatus, PadStatus, SkinStatus  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'tools'))
from reference import counters as page  # noqa: E402

pytestmark = pytest.mark.ros

COUNTS = BusStatistics({'left': PadStatistics(complete=0, incomplete=0, expected=0, received=0, used=0, pending=0,
                                              losses=dict.fromkeys(LossReason, 0))}, {})
HEALTH = BusHealth(nodes={'left': (NodeHealth(32, NmtState.OPERATIONAL, True, 0.1),)})
#: Name of a table, one of its rows, and the place of the row in the messages: 0 for the bus, 1 for its pad, and 2 for
#: the pad's node.
ROWS = (('BUS_LOSSES', 'poll_overruns', 0), ('BUS_EVENTS', 'stalls', 0), ('PAD_COUNTERS', 'tpdos_used', 1),
        ('NODE_COUNTERS', 'boots', 2))


def sent():
    """Return the diagnostics and the status of a bus with one pad and one node."""
    diagnostics = diagnosed(BusDiagnostics('driver', 'can0'), COUNTS, HEALTH)
    return diagnostics, status_message(diagnostics, COUNTS, HEALTH)


def counted(name, place):
    """Return the value of a counter in /diagnostics (None if it is missing) and in the status.

    The third value is True if the reference contains the counter.
    """
    diagnostics, status = sent()
    part = (status, status.pads[0], status.pads[0].nodes[0])[place]
    values = {pair.key: pair.value for pair in diagnostics.status[min(place, 1)].values}
    return values.get(name), getattr(part, name), f'| `{name}` |' in page.markdown()


@pytest.mark.parametrize(('table', 'name', 'place'), ROWS)
def test_a_counter_is_added_or_removed_everywhere_at_once(monkeypatch, table, name, place):
    others = tuple(row for row in getattr(counters, table) if row.name != name)
    monkeypatch.setattr(counters, table, others)
    assert counted(name, place) == (None, 0, False)
    monkeypatch.setattr(counters, table, (*others, Counter(name, 'a new one', lambda source: 77)))
    assert counted(name, place) == ('77', 77, True)
    assert f'| `{name}` | a new one |' in page.markdown()


def test_a_loss_of_the_bus_warns_and_is_in_the_view(monkeypatch):
    assert not facts_of(COUNTS, HEALTH).counts
    # The previous counts of the bus contain no such loss.
    lost = Counter('poll_overruns', '', lambda bus: 77 * (bus is COUNTS))
    monkeypatch.setattr(counters, 'BUS_LOSSES', (lost,))
    diagnostics, status = sent()
    assert diagnostics.status[0].level == DiagnosticStatus.WARN and lost.name in diagnostics.status[0].message
    for facts in (facts_of(COUNTS, HEALTH), facts_of_status(status)):
        assert facts.counts == {lost.name: 77} and 'poll overruns</td><td>77' in counts_table(facts)


@pytest.mark.parametrize(('message', 'tables'), [
    (SkinStatus, (counters.BUS_LOSSES, counters.BUS_EVENTS)), (PadStatus, (counters.PAD_COUNTERS,)),
    (NodeStatus, (counters.NODE_COUNTERS,))])
def test_the_fields_of_a_message_that_count_are_the_rows_that_have_one(message, tables):
    fields = {name for name, kind in message.get_fields_and_field_types().items() if kind in ('uint32', 'uint64')}
    assert fields == {row.name for table in tables for row in table if row.is_field}
