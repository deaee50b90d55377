"""/diagnostics is never OK while data is being discarded."""

import pytest

pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')

from diagnostic_msgs.msg import DiagnosticStatus  # noqa: E402

from tactile_node.canbus.assembler import PadStatistics  # noqa: E402
from tactile_node.canbus.router import BusStatistics  # noqa: E402
from tactile_node.ros.diagnostics import BusDiagnostics  # noqa: E402

OK, WARN, ERROR, STALE = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR, DiagnosticStatus.STALE)


def statistics(frames=10, late=0, overruns=0):
    pad = PadStatistics(frames, 0, 32 * frames, 32 * frames + late, 32 * frames, 0, {'late': late})
    return BusStatistics({'left': pad}, {'tpdo': 32 * frames + late}, queue_overruns=overruns)


def levels(diagnostics, *arguments):
    return [status.level for status in diagnostics.message(*arguments).status]


def test_what_was_lost_before_the_first_message_is_told():
    assert levels(BusDiagnostics('driver', 'can0'), statistics(late=3, overruns=2), None) == [WARN, WARN]


def test_the_level_speaks_of_the_time_since_the_message_before():
    diagnostics = BusDiagnostics('driver', 'can0')
    assert levels(diagnostics, statistics(frames=10), None) == [OK, OK]
    assert levels(diagnostics, statistics(frames=20, late=1), None) == [OK, WARN]
    assert levels(diagnostics, statistics(frames=30, late=1), None) == [OK, OK]
    assert levels(diagnostics, statistics(frames=30, late=1), None) == [OK, STALE]


def test_a_dead_bus_is_an_error_with_its_reason():
    status = BusDiagnostics('driver', 'can0').message(statistics(), 'unplugged').status[0]
    assert (status.level, status.message, status.hardware_id) == (ERROR, 'unplugged', 'can0')
