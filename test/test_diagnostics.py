"""Tests that /diagnostics never reports OK while data is being discarded."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from diagnosed import diagnosed
from diagnostic_msgs.msg import DiagnosticStatus

from tactile_node.assembly.facts import BusFacts, LossReason, NodeFacts, PadFacts
from tactile_node.assembly.health import (
    BusFault,
    Failure,
    ForeignCommand,
    NodeFault,
    Overload,
    SyncFault,
)
from tactile_node.cia301.emergency import decode_emergency
from tactile_node.cia301.objects import NmtState
from tactile_node.conditioning.conditioned_pad import PadCondition
from tactile_node.conditioning.tared_pad import ZeroState
from tactile_node.conditioning.taxel_faults import FaultyTaxels, TaxelFault
from tactile_node.ros.diagnostics import BusDiagnostics, faults_text

pytestmark = pytest.mark.ros

OK, WARN, ERROR, STALE = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR, DiagnosticStatus.STALE)


def seen(frames=10, late=0, overruns=0, nodes=(), **bus):
    """Return facts about a bus with one pad."""
    pad = PadFacts('left', frames_complete=frames, tpdos_expected=32 * frames, tpdos_received=32 * frames + late,
                   tpdos_used=32 * frames, losses={LossReason.LATE: late}, nodes=nodes)
    return BusFacts((pad,), can_frames={'tpdo': 32 * frames + late}, queue_overruns=overruns, **bus)


WELL = NodeFacts('left', 32, NmtState.OPERATIONAL, True, 0.05)


def each_second():
    """Return diagnostics whose clock advances by one second with each evaluation."""
    return BusDiagnostics('/gripper/driver', 'can0', steady=itertools.count(100.0).__next__)


def value_of(status, key):
    value, = (item.value for item in status.values if item.key == key)
    return value


def levels(diagnostics, facts):
    return [status.level for status in diagnosed(diagnostics, facts).status]


def healthy_but(frames=10, **changes):
    return seen(frames, nodes=(replace(WELL, **changes),))


def test_losses_before_the_first_message_are_reported():
    assert levels(each_second(), seen(late=3, overruns=2)) == [WARN, WARN]


def test_the_level_covers_the_time_since_the_previous_message():
    diagnostics = each_second()
    assert levels(diagnostics, seen(frames=10)) == [OK, OK]
    assert levels(diagnostics, seen(frames=20, late=1)) == [OK, WARN]
    assert levels(diagnostics, seen(frames=30, late=1)) == [OK, OK]
    assert levels(diagnostics, seen(frames=30, late=1)) == [OK, STALE]


def test_a_loss_stays_reported_for_a_second_however_often_the_state_is_evaluated():
    """A loss must stay visible to a reader that sees only the latest message."""
    clock = itertools.count(100.0, 1 / 16)
    diagnostics = BusDiagnostics('driver', 'can0', steady=clock.__next__)
    found = [levels(diagnostics, seen(frames=10 + i, late=int(i >= 30)))[1] for i in range(60)]
    assert found == [OK] * 30 + [WARN] * 16 + [OK] * 14


def test_statuses_have_the_nodes_full_name():
    names = [status.name for status in diagnosed(each_second(), seen()).status]
    assert names == ['/gripper/driver: bus', '/gripper/driver: left']


def test_a_dead_bus_is_an_error_with_its_reason():
    failure = Failure(BusFault.RECEPTION_FAILED, 'unplugged')
    status = diagnosed(each_second(), seen(failure=failure)).status[0]
    assert (status.level, status.message, status.hardware_id) == (ERROR, str(failure), 'can0')
    assert value_of(status, 'fault') == 'RECEPTION_FAILED'


@pytest.mark.parametrize('changes, level, text', [
    ({}, OK, '20 taxel frames'),
    ({'fault': NodeFault.SILENT}, ERROR, NodeFault.SILENT.phrase),
    ({'state': NmtState.STOPPED, 'operational': False}, ERROR, 'STOPPED'),
    ({'outages': 1, 'outage_seconds': 0.3, 'outage_last_reason': NodeFault.BOOTED}, WARN, NodeFault.BOOTED.phrase),
    ({'emcy_count': 1, 'emcy_last': decode_emergency(bytes.fromhex('1042090000000000'), 0.0)}, WARN, '0x4210'),
    ({'frames_distrusted': 3}, WARN, '3 taxel frames'),
])
def test_a_pad_is_ok_only_while_its_node_is(changes, level, text):
    diagnostics = each_second()
    diagnosed(diagnostics, healthy_but())
    pad = diagnosed(diagnostics, healthy_but(frames=30, **changes)).status[1]
    assert pad.level == level and text in pad.message
    assert value_of(pad, 'fault') == changes.get('fault', NodeFault.NONE).name


def test_an_error_a_device_still_has_stays_reported_until_it_reports_its_end():
    diagnostics = each_second()
    fault, gone = (decode_emergency(bytes.fromhex(text), 0.0) for text in ('1042090000000000', '0000000000000000'))
    found = [levels(diagnostics, healthy_but(frames=10 * (i + 1), emcy_count=count, emcy_last=last,
                                             emcy_active=active))[1]
             for i, (count, last, active) in enumerate([(0, None, None), (1, fault, fault), (1, fault, fault),
                                                        (2, gone, None), (2, gone, None), (2, gone, fault)])]
    assert found == [OK, WARN, WARN, WARN, OK, WARN]


@pytest.mark.parametrize('bus, level', [
    ({}, OK), ({'error_passive': True}, WARN),
    ({'outages': 1, 'outage_seconds': 0.2, 'outage_last_reason': Failure(BusFault.BUS_OFF)}, WARN),
    ({'foreign_nmt_commands': 1, 'foreign_nmt_last': ForeignCommand(2, 32)}, WARN),
    ({'sync_fault': SyncFault.NONE, 'foreign_syncs': 3}, OK), ({'overload': Overload.NONE, 'stalls': 3}, OK),
    ({'sync_fault': SyncFault.SECOND_PRODUCER, 'foreign_syncs': 3}, WARN),
    ({'sync_fault': SyncFault.OTHER_PERIOD, 'sync_period': 0.04}, WARN),
    ({'overload': Overload.STALLED}, WARN)])
def test_the_bus_is_ok_only_while_nothing_happens_to_it(bus, level):
    assert levels(each_second(), seen(**bus))[0] == level


def test_values_of_a_node_are_reported_by_name():
    last = decode_emergency(bytes.fromhex('3081110000000000'), 0.0)
    facts = healthy_but(heartbeat_age=0.25, emcy_count=4, emcy_last=last, outages=2, outage_seconds=1.5)
    pad = diagnosed(each_second(), replace(facts, bus_load=0.305)).status
    values = {item.key: item.value for status in pad for item in status.values}
    assert values['bus_load_percent'] == '30.5'
    assert (values['nmt_state'], values['heartbeat_age_s'], values['outages'], values['outage_seconds']) == (
        'OPERATIONAL', '0.25', '2', '1.50')
    assert values['emcy_count'] == '4' and 'heartbeat error' in values['emcy_last']


@pytest.mark.parametrize('zero', [zero for zero in ZeroState if zero is not ZeroState.VALID])
def test_a_pad_whose_zero_is_not_valid_is_an_error_with_its_reason(zero):
    diagnostics, no_faults = each_second(), FaultyTaxels(np.zeros((1, 1), np.uint8))
    conditions = {'left': PadCondition(no_faults, zero=zero)}
    status = diagnosed(diagnostics, healthy_but(), conditions).status[1]
    assert status.level == ERROR and zero.phrase in status.message
    conditions = {'left': PadCondition(no_faults)}
    assert diagnosed(diagnostics, healthy_but(frames=20), conditions).status[1].level == OK


def test_faulty_taxels_are_reported_and_bounded():
    kinds = np.zeros((12, 12), np.uint8)
    kinds[3, 4], kinds[0], kinds[1, 1:11] = TaxelFault.DEAD, TaxelFault.STUCK, TaxelFault.STUCK
    assert faults_text(FaultyTaxels(kinds)).startswith('dead: (3, 4); stuck: (0, 0), (0, 1)')
    assert faults_text(FaultyTaxels(kinds)).endswith('(1, 8) and 2 more')
