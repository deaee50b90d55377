"""Tests that each counter is declared once.

The status, /diagnostics, the view and the reference must contain exactly the counters of the facts.
"""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')
pytest.importorskip('jinja2')

from diagnosed import diagnosed, status_of  # noqa: E402
from diagnostic_msgs.msg import DiagnosticStatus  # noqa: E402

from tactile_node.assembly.facts import BUS_LOSSES, BusFacts, NodeFacts, PadFacts, meanings  # noqa: E402
from tactile_node.ros.diagnostics import BusDiagnostics  # noqa: E402
from tactile_node.viewing.counts_table import counts_table  # noqa: E402
from tactile_skin.msg import NodeStatus, PadStatus, SkinStatus  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'tools'))
from reference import counters as page  # noqa: E402

pytestmark = pytest.mark.ros

#: Classes of facts, and the messages that are filled from them.
MESSAGES = {BusFacts: SkinStatus, PadFacts: PadStatus, NodeFacts: NodeStatus}
COUNTERS = [(kind, name) for kind in MESSAGES for name in meanings(kind)]
#: Counters that are on /diagnostics, but not in the status.
WITHOUT_FIELD = {'frames_withheld', 'tpdos_padded'}


def counted(kind, name):
    """Return facts about a bus with one pad and one node, in which one counter is 77 and all others are 0."""
    node = NodeFacts('left', 32, **{name: 77} if kind is NodeFacts else {})
    pad = PadFacts('left', nodes=(node,), **{name: 77} if kind is PadFacts else {})
    return BusFacts((pad,), **{name: 77} if kind is BusFacts else {})


@pytest.mark.parametrize(('kind', 'name'), COUNTERS)
def test_a_counter_is_in_all_outputs(kind, name):
    facts = counted(kind, name)
    diagnostics, status = diagnosed(BusDiagnostics('driver', 'can0'), facts), status_of(facts)
    place = list(MESSAGES).index(kind)
    values = {pair.key: pair.value for pair in diagnostics.status[min(place, 1)].values}
    assert values[name] == '77'
    part = (status, status.pads[0], status.pads[0].nodes[0])[place]
    assert name in WITHOUT_FIELD or getattr(part, name) == 77
    assert f'| `{name}` | {meanings(kind)[name]} |' in page.markdown()


@pytest.mark.parametrize('name', BUS_LOSSES)
def test_a_loss_of_the_bus_warns_and_is_in_the_view(name):
    facts, row = counted(BusFacts, name), f'{name.replace("_", " ")}</td><td>77'
    diagnostics = diagnosed(BusDiagnostics('driver', 'can0'), facts)
    assert diagnostics.status[0].level == DiagnosticStatus.WARN and name in diagnostics.status[0].message
    assert row in counts_table(facts) and row in counts_table(status_of(facts))
    assert row not in counts_table(replace(facts, **{name: 0}))


@pytest.mark.parametrize('kind', MESSAGES)
def test_the_fields_of_a_message_that_count_are_the_counters(kind):
    fields = {name for name, type_ in MESSAGES[kind].get_fields_and_field_types().items()
              if type_ in ('uint32', 'uint64')}
    assert fields == meanings(kind).keys() - WITHOUT_FIELD
