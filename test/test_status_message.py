"""The status message says what /diagnostics says, field by field; a late subscriber gets it."""

import math

import pytest

pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')

from rclpy.qos import DurabilityPolicy  # noqa: E402

from tactile_node.assembly.router import BusStatistics  # noqa: E402
from tactile_node.frames.health import BusHealth, NodeHealth, Outages  # noqa: E402
from tactile_node.frames.losses import LossReason, PadStatistics  # noqa: E402
from tactile_node.ros.diagnostics import BusDiagnostics  # noqa: E402
from tactile_node.ros.qos import STATUS_QOS  # noqa: E402
from tactile_node.ros.status_message import status_message  # noqa: E402
from tactile_skin.msg import SkinStatus  # noqa: E402

pytestmark = pytest.mark.ros


def message(late=0, **health):
    pad = PadStatistics(9, 1, 320, 319 + late, 318, 0, {LossReason.LATE: late, LossReason.SHORT: 1})
    counts = BusStatistics({'left': pad}, {'tpdo': 320, 'error': 4}, queue_overruns=2, clock_jumps=3)
    node = NodeHealth(32, 'OPERATIONAL', True, None, boots=1, outages=Outages(2, 1.5, 'power cycle'))
    state = BusHealth(nodes={'left': (node,)}, load=0.25, **health)
    return status_message(BusDiagnostics('driver', 'can0').message(counts, state), counts, state)


def test_counts_and_state_are_in_their_fields():
    found = message(late=5)
    assert (found.error_frames, found.queue_overruns, found.clock_jumps, found.bus_load) == (4, 2, 3, 0.25)
    pad, = found.pads
    node, = pad.nodes
    assert (pad.pad, node.node_id, node.nmt_state, node.boots) == ('left', 32, 'OPERATIONAL', 1)
    assert (pad.frames_complete, pad.frames_incomplete, pad.tpdos_expected, pad.tpdos_used) == (9, 1, 320, 318)
    assert dict(zip(pad.drop_reasons, pad.drop_counts)) == {'late': 5, 'short': 1}
    assert math.isnan(node.heartbeat_age) and node.outage_last_reason == 'power cycle'


def test_level_is_the_worst_and_failure_is_told():
    assert message().level == SkinStatus.WARN
    failed = message(failure='unplugged')
    assert failed.level == SkinStatus.ERROR and failed.failure == 'unplugged'


def test_late_subscribers_get_it():
    assert STATUS_QOS.durability == DurabilityPolicy.TRANSIENT_LOCAL
