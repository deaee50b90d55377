"""Tests that a supervised node carries its actions out and logs what a user needs, in virtual time without a bus."""

import logging
import time
from collections.abc import Iterator

import pytest

from tactile_node.assembly.facts import BusFacts, PadFacts
from tactile_node.assembly.health import BusFault, Failure, NodeFault
from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.bus.device_setup import DeviceAsSet
from tactile_node.cia301.emergency import DeviceErrors
from tactile_node.errors import (
    DeviceAbsentError,
    DeviceError,
    InterruptedSetupError,
    TwoDevicesError,
    UnverifiedDeviceError,
)
from tactile_node.skin.pads import make_pad
from tactile_node.sources.bus_watch import BusCounts
from tactile_node.sources.node_monitor import NodeMonitor
from tactile_node.sources.node_state import NodeEvent
from tactile_node.sources.supervised_node import SupervisedNode

NODE = make_pad('pad', 32, 'sim8x8_16bit.yaml').nodes[0]
ROUND = 0.02  # Time between two observations [s].
REASON = {'expected': 'a device', 'got': 'another', 'remedy': 'See its manual.'}


class Device:
    """A device and its bus, as SupervisedNode uses them. TPDOs come in every round, and heartbeats every 0.1 s."""

    def __init__(self, clock: list[float], recover: bool = True):
        self.clock = clock
        self.traffic = BusMonitor([32])
        self.node = SupervisedNode(self, NodeMonitor(NODE, self.traffic, 0.5, 0.5), recover)
        self.requests: list[str] = []
        self.error: Exception | None = None  # error of each configuration
        self.state = b'\x05'
        self.beats = self.sends = True
        self.is_overloaded = False
        self.syncs = 0
        self.used = 0
        self.devices = self
        self.node.monitor.expect(clock[0])
        self.traffic.feed(0x720, self.state)
        self.node.configure(1.0)
        self.node.monitor.commanded(clock[0], self.pad)
        self.requests.clear()

    @property
    def pad(self) -> PadFacts:
        count = len(NODE.layout.tpdos)
        return PadFacts('pad', tpdos_used=self.used, used_by_node=(self.used,), syncs=self.syncs,
                        distinct_by_tpdo=((self.syncs,) * count,), fresh_by_tpdo=((self.used,) * count,))

    def facts(self) -> BusFacts:
        return BusFacts((self.pad,))

    def configure_node(self, _node: object, _timeout: float, pause: bool = True) -> DeviceAsSet:
        self.requests.append('configure' if pause else 'check')
        if self.error is not None:
            raise self.error
        return DeviceAsSet(heartbeat_ms=100)

    def start_node(self, _node: object, was_silent: bool = True) -> None:
        self.requests.append('start' if was_silent else 'start a sender')

    def read_errors(self, _node: object) -> DeviceErrors:
        self.requests.append('read errors')
        return DeviceErrors(0x09, (0x4210,))

    def run(self, seconds: float) -> 'Device':
        for _ in range(round(seconds / ROUND)):
            self.clock[0] += ROUND
            self.syncs += 1
            self.used += self.sends
            if self.beats and self.syncs % 5 == 0:
                self.traffic.feed(0x720, self.state)
            if self.node.look(self.clock[0], True, self.pad, BusCounts(self.syncs, is_overloaded=self.is_overloaded)):
                self.node.recover()
        return self

    @property
    def fault(self) -> NodeFault:
        return self.node.facts(self.clock[0]).fault


@pytest.fixture
def clock(monkeypatch, caplog) -> Iterator[list[float]]:
    caplog.set_level(logging.INFO)
    now = [1000.0]
    monkeypatch.setattr(time, 'monotonic', lambda: now[0])
    yield now


def facts(caplog) -> list[object]:
    return [record.fact for record in caplog.records if hasattr(record, 'fact')]


def test_a_well_node_is_left_alone(clock, caplog):
    device = Device(clock).run(5.0)
    assert device.fault is NodeFault.NONE and not device.requests and not caplog.records


def test_a_node_that_boots_is_configured_and_started_at_once_and_the_end_of_the_outage_is_logged(clock, caplog):
    device = Device(clock).run(2.0)
    device.traffic.feed(0x720, b'\x00')
    device.run(ROUND)
    assert device.requests == ['configure', 'start'] and facts(caplog) == [NodeFault.BOOTED]
    device.run(0.1)
    assert device.fault is NodeFault.NONE and 'gives taxels again after' in caplog.messages[-1]
    assert NodeFault.BOOTED.phrase in caplog.messages[-1]


@pytest.mark.parametrize(('error', 'is_overloaded', 'has_remedy'), [
    (DeviceAbsentError, False, True), (DeviceAbsentError, True, False), (DeviceError, True, True)])
def test_an_overloaded_process_does_not_blame_the_wiring_for_a_missing_answer(clock, caplog, error, is_overloaded,
                                                                              has_remedy):
    device = Device(clock).run(2.0)
    device.error, device.is_overloaded = error('node 32', **REASON), is_overloaded
    device.traffic.feed(0x720, b'\x00')
    device.run(ROUND)
    assert 'Waiting for node 32' in caplog.messages[-1]
    assert (REASON['remedy'] in caplog.messages[-1]) is has_remedy is not ('overloaded' in caplog.messages[-1])


def test_a_check_that_is_refused_is_followed_by_a_configuration_with_a_pause(clock, caplog):
    device = Device(clock)
    device.error = DeviceError('node 32', **REASON)
    device.beats = False
    device.run(0.56)
    assert (device.fault, device.requests) == (NodeFault.NO_HEARTBEAT, ['check'])
    device.error = None
    device.run(0.12)
    assert device.requests == ['check', 'configure', 'start']
    assert 'Waiting for node 32' in caplog.messages[-1]


def test_a_sender_without_heartbeat_is_checked_while_it_sends(clock):
    device = Device(clock)
    device.beats = False
    device.run(0.56)
    assert device.requests == ['check', 'start a sender']


@pytest.mark.parametrize(('error', 'is_trusted'), [
    (UnverifiedDeviceError, False), (DeviceError, True), (InterruptedSetupError, True)])
def test_a_device_that_is_another_one_is_not_trusted(clock, error, is_trusted):
    device = Device(clock).run(2.0)
    device.sends = False
    device.error = error('node 32', **REASON)
    device.run(0.6)
    assert device.requests[0] == 'configure' and 'start' not in device.requests
    assert device.node.monitor.trust.is_trusted == is_trusted


def test_two_devices_that_answer_are_reported_and_left_alone(clock, caplog):
    device = Device(clock).run(2.0)
    device.traffic.feed(0x720, b'\x00')
    device.error = TwoDevicesError('node 32', **REASON)
    device.run(0.5)
    assert (device.fault, device.requests) == (NodeFault.TWO_SENDERS, ['configure'])
    assert facts(caplog) == [NodeFault.BOOTED, device.error, NodeFault.TWO_SENDERS]


def test_the_errors_of_a_node_that_does_not_start_are_logged_once(clock, caplog):
    device = Device(clock).run(2.0)
    device.state = b'\x7f'
    device.sends = False
    device.run(3.0)
    assert device.requests[:3] == ['start', 'start', 'read errors']
    assert facts(caplog)[:2] == [NodeFault.NOT_OPERATIONAL, DeviceErrors(0x09, (0x4210,))]
    assert sum(isinstance(fact, DeviceErrors) for fact in facts(caplog)) == 1
    device.state = b'\x05'
    device.sends = True
    device.run(0.2)
    assert device.fault is NodeFault.NONE and device.node.facts(clock[0]).device_errors is None


def test_an_absent_device_is_returned_by_configure_and_reported_once_while_it_is_absent(clock, caplog):
    device = Device(clock)
    device.error = DeviceAbsentError('node 32', **REASON)
    assert device.node.configure(1.0) is device.error
    device.beats = device.sends = False
    device.run(1.9)
    assert device.fault is NodeFault.SILENT and facts(caplog) == [NodeFault.SILENT]


def test_without_recovery_a_fault_is_logged_without_a_promise(clock, caplog):
    device = Device(clock, recover=False).run(2.0)
    device.sends = False
    device.run(1.0)
    assert device.fault is NodeFault.NO_TAXELS and not device.requests
    assert facts(caplog) == [NodeFault.NO_TAXELS] and 'The driver' not in caplog.text


def test_a_failure_of_the_bus_is_the_cause_of_the_outage(clock, caplog):
    device = Device(clock).run(2.0)
    device.node.handle(Failure(BusFault.BUS_OFF, 'by an error frame'), clock[0])
    device.node.monitor.expect(clock[0])
    device.run(0.1)
    assert device.requests == ['configure', 'start']
    assert 'Cause of the outage: the CAN controller is bus-off: by an error frame.' in caplog.messages[-1]


def test_a_stop_ends_the_outage_without_a_message(clock, caplog):
    device = Device(clock).run(2.0)
    device.sends = False
    device.run(1.0)
    device.node.handle(NodeEvent.STOPPED, clock[0])
    assert device.node.facts(clock[0]).outage_present_reason is None and 'again after' not in caplog.text


def test_an_emcy_is_logged_and_repetitions_less_and_less_often(clock, caplog):
    device = Device(clock)
    for _ in range(100):
        device.traffic.feed(0x0A0, bytes.fromhex('1042090000000000'))
        device.run(0.1)
    assert [message.split(';')[-1] for message in caplog.messages] == [' 1 EMCY in all.', ' 21 EMCY in all.',
                                                                     ' 61 EMCY in all.']
