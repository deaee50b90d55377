"""Every field of the status message agrees with /diagnostics.

A subscriber that starts late still receives the status message.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from diagnosed import diagnosed, status_of

from tactile_node.assembly.facts import BusFacts, LossReason, NodeFacts, PadFacts
from tactile_node.assembly.health import (
    BusFault,
    Failure,
    NodeFault,
    Overload,
    SyncFault,
)
from tactile_node.cia301.objects import NmtState
from tactile_node.conditioning.conditioned_pad import PadCondition
from tactile_node.conditioning.tared_pad import ZeroState
from tactile_node.conditioning.taxel_faults import FaultyTaxels, TaxelFault
from tactile_node.ros.diagnostics import BusDiagnostics
from tactile_node.ros.status_message import PrimaryState
from tactile_skin.msg import FaultyTaxel, NodeStatus, PadStatus, SkinStatus

pytestmark = pytest.mark.ros


WELL = PadFacts('left', frames_complete=9, tpdos_expected=320, tpdos_received=320, tpdos_used=320)


def message(late=0, fault=NodeFault.NONE, **bus):
    node = NodeFacts('left', 32, NmtState.OPERATIONAL, True, boots=1, fault=fault, outages=2, outage_seconds=1.5,
                     outage_last_reason=NodeFault.BOOTED)
    pad = PadFacts('left', frames_complete=9, frames_incomplete=1, tpdos_expected=320, tpdos_received=319 + late,
                   tpdos_used=318, losses={LossReason.LATE: late, LossReason.SHORT: 1}, nodes=(node,))
    facts = BusFacts((pad,), error_frames=4, queue_overruns=2, clock_jumps=3, bus_load=0.25, **bus)
    return status_of(facts)


def test_counts_and_state_are_in_their_fields():
    found = message(late=5, fault=NodeFault.NO_SYNC)
    assert (found.error_frames, found.queue_overruns, found.clock_jumps, found.bus_load) == (4, 2, 3, 0.25)
    pad, = found.pads
    node, = pad.nodes
    assert (pad.pad, node.node_id, node.nmt_state, node.boots) == ('left', 32, NodeStatus.NMT_OPERATIONAL, 1)
    assert node.nmt_state_text == 'OPERATIONAL'
    assert (pad.frames_complete, pad.frames_incomplete, pad.tpdos_expected, pad.tpdos_used) == (9, 1, 320, 318)
    assert dict(zip(pad.loss_reasons, pad.loss_counts)) == {'late': 5, 'short': 1}
    assert dict(zip(pad.loss_codes, pad.loss_counts)) == {PadStatus.LOSS_LATE: 5, PadStatus.LOSS_SHORT: 1}
    assert math.isnan(node.heartbeat_age) and node.outage_last_reason == NodeFault.BOOTED.phrase
    assert node.fault == NodeStatus.FAULT_NO_SYNC and NodeFault.NO_SYNC.phrase in node.fault_text


def test_sync_overload_and_an_active_error_are_in_their_fields():
    found = message(sync_fault=SyncFault.OTHER_PERIOD, sync_period=0.5, overload=Overload.BEHIND, stalls=2)
    assert (found.sync_fault, found.sync_period) == (SkinStatus.SYNC_FAULT_OTHER_PERIOD, 0.5)
    assert (found.overload, found.stalls) == (SkinStatus.OVERLOAD_BEHIND, 2)
    assert math.isnan(message().sync_period) and message(foreign_syncs=7).foreign_syncs == 7
    assert message().pads[0].nodes[0].emcy_active == ''


def test_level_is_the_worst_of_bus_and_pads():
    assert message().level == SkinStatus.WARN
    assert message(fault=NodeFault.NO_SYNC).level == SkinStatus.ERROR


def test_a_failure_has_its_code_and_text():
    well, failure = message(), Failure(BusFault.BUS_OFF, 'restart-ms')
    assert (well.fault, well.failure) == (SkinStatus.FAULT_NONE, '')
    failed = message(failure=failure)
    assert (failed.level, failed.fault, failed.failure) == (
        SkinStatus.ERROR, SkinStatus.FAULT_BUS_OFF, str(failure))


def test_the_lifecycle_state_has_the_numbers_of_lifecycle_msgs():
    numbers = {name: getattr(SkinStatus, name) for name in ('UNCONFIGURED', 'INACTIVE', 'ACTIVE', 'FINALIZED')}
    assert numbers | {'NOT_KNOWN': SkinStatus.LIFECYCLE_NOT_KNOWN} == PrimaryState.__members__
    assert SkinStatus().lifecycle_state == SkinStatus.LIFECYCLE_NOT_KNOWN


@pytest.mark.parametrize(('state', 'number'), [
    (None, NodeStatus.NMT_NOT_KNOWN), (0x00, NodeStatus.NMT_BOOT_UP), (0x04, NodeStatus.NMT_STOPPED),
    (0x05, NodeStatus.NMT_OPERATIONAL), (0x7F, NodeStatus.NMT_PRE_OPERATIONAL), (0x33, NodeStatus.NMT_UNDEFINED)])
def test_nmt_states_have_their_numbers_and_0_is_not_known(state, number):
    facts = BusFacts((replace(WELL, nodes=(NodeFacts('left', 32, state, True),)),))
    node, = status_of(facts).pads[0].nodes
    assert node.nmt_state == number and (node.nmt_state == 0) == (state is None)


def test_a_faulty_taxel_has_its_code():
    kinds = np.zeros((2, 2), np.uint8)
    kinds[1, 0] = TaxelFault.STUCK
    facts = BusFacts((WELL,))
    conditions = {'left': PadCondition(FaultyTaxels(kinds))}
    sent = diagnosed(BusDiagnostics('driver', 'can0'), facts, conditions)
    assert [item.value for item in sent.status[1].values if item.key == 'faulty_taxels'] == ['stuck: (1, 0)']
    taxel, = status_of(facts, conditions).pads[0].faulty_taxels
    assert (taxel.row, taxel.col, taxel.code, taxel.fault) == (1, 0, FaultyTaxel.STUCK, 'stuck')


def test_a_pad_has_the_state_of_its_zero():
    facts = BusFacts((WELL,))
    conditions = {'left': PadCondition(FaultyTaxels(np.zeros((2, 2), np.uint8)), zero=ZeroState.DEVICE_HAS_RESTARTED)}
    assert status_of(facts, conditions).pads[0].zero_state == PadStatus.ZERO_DEVICE_HAS_RESTARTED
    assert status_of(facts).pads[0].zero_state == PadStatus.ZERO_NOT_KNOWN
