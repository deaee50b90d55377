"""Tests that each fault is described in one sentence that contains the known details."""

from dataclasses import replace
from functools import partial
from math import nan

import pytest

from tactile_node.assembly.facts import NodeFacts
from tactile_node.assembly.fault_text import (
    failure_of,
    reaction_text,
)
from tactile_node.assembly.health import (
    BusFault,
    Failure,
    ForeignCommand,
    NodeFault,
    Overload,
    SentTpdo,
    SyncFault,
    TpdoOrder,
)
from tactile_node.cia301.emergency import DeviceErrors, decode_emergency
from tactile_node.cia301.objects import NmtState
from tactile_node.errors import (
    BusError,
    ConfigurationError,
    DeviceAbsentError,
    DeviceError,
    LogError,
    TareRefusal,
    TareRefusedError,
)


@pytest.mark.parametrize('faults', [NodeFault, BusFault, SyncFault, Overload])
def test_every_fault_has_a_phrase_of_its_own(faults):
    assert all(fault.phrase for fault in faults) and len({fault.phrase for fault in faults}) == len(faults)


@pytest.mark.parametrize('faults', [NodeFault, BusFault, SyncFault, Overload])
def test_codes_are_not_known_and_none_first_and_fit_a_uint8(faults):
    assert [fault.value for fault in faults] == list(range(len(faults)))
    assert (faults.NOT_KNOWN.value, faults.NONE.value) == (0, 1)


@pytest.mark.parametrize('fault', NodeFault)
def test_a_nodes_sentence_names_node_pad_and_fault(fault):
    text = NodeFacts('left', 32, NmtState.STOPPED, False, 0.62, fault=fault).fault_text
    if fault in (NodeFault.NOT_KNOWN, NodeFault.NONE):
        assert text == ''
    else:
        assert text.startswith(f"Node 32 (pad 'left'): {fault.phrase}") and text.endswith('.')


def test_a_nodes_sentence_tells_the_last_heartbeat():
    silent = NodeFacts('left', 32, NmtState.STOPPED, False, 0.62, fault=NodeFault.SILENT)
    assert silent.fault_text.endswith('(last heartbeat 0.6 s ago: STOPPED).')
    assert replace(silent, heartbeat_age=nan).fault_text.endswith('(no heartbeat so far).')


def test_the_sentence_about_an_ongoing_outage_gives_the_reason():
    node = NodeFacts('left', 32, NmtState.OPERATIONAL, True, 0.1, NodeFault.AWAITING_TAXELS,
                     outage_last_reason=NodeFault.BOOTED,
                     outage_present_reason=Failure(BusFault.SENDING_FAILED, 'Transmit buffer full'))
    assert node.fault_text.endswith('not back yet; the outage: the CAN bus cannot send: Transmit buffer full.')


def test_a_nodes_sentence_names_the_tpdos_and_errors_that_are_known():
    node = NodeFacts('left', 32, NmtState.PRE_OPERATIONAL, True, 0.1,
                     missing_tpdos=(SentTpdo(3, 0x1A2), SentTpdo(4, 0x1A3)), surplus_tpdos=(SentTpdo(7, 0x2A2),),
                     device_errors=DeviceErrors(0x08))
    texts = {fault: replace(node, fault=fault).fault_text for fault in NodeFault if fault.is_fault}
    assert 'TPDO 3 (COB-ID 0x1A2), TPDO 4 (COB-ID 0x1A3)' in texts.pop(NodeFault.TPDO_MISSING)
    assert 'TPDO 3 (COB-ID 0x1A2)' in texts.pop(NodeFault.NO_TAXELS)
    assert 'TPDO 7 (COB-ID 0x2A2)' in texts.pop(NodeFault.TWO_SENDERS)
    assert 'temperature' in texts.pop(NodeFault.NOT_OPERATIONAL)
    assert not any(word in text for text in texts.values() for word in ('COB-ID 0x', 'temperature'))


def test_a_failure_is_its_phrase_and_detail():
    assert str(NodeFault.BOOTED) == NodeFault.BOOTED.phrase
    assert str(Failure(BusFault.BUS_OFF, 'x.')) == str(Failure(BusFault.BUS_OFF, 'x'))
    assert str(Failure(BusFault.BUS_OFF, 'x')) == 'the CAN controller is bus-off: x'


@pytest.mark.parametrize(('kind', 'fault'), [
    (BusError, BusFault.NOT_OPENED), (LogError, BusFault.LOG_UNUSABLE), (DeviceAbsentError, BusFault.DEVICE_ABSENT),
    (DeviceError, BusFault.DEVICE_UNUSABLE), (ConfigurationError, BusFault.WRONG_CONFIGURATION),
    (partial(TareRefusedError, refusal=TareRefusal.NO_VALID_VALUES), BusFault.NOT_KNOWN)])
def test_an_error_has_its_fault(kind, fault):
    error = kind('there', expected='this', got='that', remedy='Do so.')
    assert failure_of(error) == Failure(fault, 'there: expected this, got that. Do so.')


def test_an_exception_that_is_not_ours_is_an_internal_error():
    assert failure_of(KeyError('rows')) == Failure(BusFault.INTERNAL_ERROR, "KeyError: 'rows'")


@pytest.mark.parametrize(('command', 'text'), [
    (ForeignCommand(0x81, 32), 'reset node to node 32'),
    (ForeignCommand(0x82, 0), 'reset communication to all nodes'), (ForeignCommand(0x02, 32), 'stop to node 32'),
    (ForeignCommand(0x55, 1), 'command 0x55 to node 1')])
def test_commands_by_name(command, text):
    assert str(command) == text


def test_each_fault_has_a_sentence_about_the_reaction():
    assert reaction_text(NodeFault.BOOTED) == reaction_text(NodeFault.NO_TAXELS) != reaction_text(NodeFault.NO_SYNC)
    assert 'as soon as it answers' in reaction_text(NodeFault.SILENT)


def test_an_emergency_is_decoded_and_counted():
    last = decode_emergency(bytes.fromhex('1042090000000000'), 0.0)
    node = NodeFacts('left', 32, NmtState.OPERATIONAL, True, 0.1, emcy_count=7, emcy_last=last)
    assert node.emcy_text == (
        "Node 32 (pad 'left') sends EMCY 0x4210 (device temperature), error register: generic, temperature; "
        '7 EMCY in all.')


@pytest.mark.parametrize('fault', [NodeFault.TPDO_MISSING, NodeFault.NO_TAXELS])
def test_the_text_names_both_orders_if_a_device_sends_in_another_order(fault):
    order = TpdoOrder(32, ('1', '2', '3'), ('3', '1', '2'))
    node = NodeFacts('left', 32, NmtState.OPERATIONAL, True, 0.1, fault, missing_tpdos=(SentTpdo(3, 0x1A2),),
                     tpdo_order=order)
    text = node.fault_text
    assert 'TPDO 3 (COB-ID 0x1A2); it sends its TPDOs in the order 1, 2, 3, and the layout has 3, 1, 2' in text
