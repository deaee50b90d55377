"""Tests for setting up devices whose SYNC or heartbeat deviates.

The driver accepts a deviating device if that is safe, and otherwise refuses the device by name.
"""

from dataclasses import replace

import pytest
from canopen import SdoAbortedError, SdoCommunicationError

from tactile_node.assembly.facts import PadFacts
from tactile_node.assembly.health import NodeFault, TpdoOrder
from tactile_node.bus.bus_devices import read_errors
from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.bus.device_setup import ABSENT_REMEDY, ALIVE_REMEDY, DeviceAsSet, DeviceSetup
from tactile_node.cia301.emergency import DeviceErrors
from tactile_node.cia301.heartbeat import Heartbeats
from tactile_node.errors import DeviceAbsentError, DeviceError, InterruptedSetupError, UnverifiedDeviceError
from tactile_node.skin.pads import make_pad
from tactile_node.sources.bus_watch import BusCounts
from tactile_node.sources.node_monitor import NodeMonitor
from tactile_node.sources.node_state import NodeState, fault_of

NODE = make_pad('pad', 32, 'sim16x16.yaml').nodes[0]
#: Abort codes of CiA 301.
READ_ONLY = 0x0601_0002
UNKNOWN = 0x0602_0000
WRONG_STATE = 0x0800_0022
SYNC, HEARTBEAT = (0x1005, 0), (0x1017, 0)


class Device:
    """Object dictionary of a configured device, as an SDO client sees it.

    Objects in ``fixed`` are read-only. For objects in ``kept``, the device accepts a write but keeps its own value.
    """

    RESPONSE_TIMEOUT = 0.3

    def __init__(self, fixed=(), kept=(), **objects):
        self.fixed, self.kept = fixed, kept
        self.written = {}
        self.objects = {(0x1018, 1): 0x5C1, (0x1018, 2): 0x16160008, (0x1018, 3): 0x10000, SYNC: 0x80, HEARTBEAT: 100}
        for i, tpdo in enumerate(NODE.layout.tpdos):
            self.objects |= {(0x1800 + i, 1): tpdo.cob_id.of(32), (0x1800 + i, 2): 1,
                             (0x1A00 + i, 0): len(tpdo.mapping)}
            self.objects |= {(0x1A00 + i, sub): mapped.entry for sub, mapped in enumerate(tpdo.mapping, 1)}

    def having(self, place, value) -> 'Device':
        self.objects[place] = value
        return self

    def upload(self, index, sub):
        value = self.objects.get((index, sub))
        if value is None:
            raise SdoAbortedError(UNKNOWN)
        return value.to_bytes(4, 'little')

    def download(self, index, sub, data):
        if (index, sub) in self.fixed or self.objects.get((index, sub)) is None:
            raise SdoAbortedError(READ_ONLY)
        if index >= 0x1A00 and (not self.objects[index - 0x200, 1] >> 31 or sub and self.objects[index, 0]):
            # CiA 301 allows a change of the mapping only while the TPDO is disabled and its mapping counts no objects.
            raise SdoAbortedError(WRONG_STATE)
        self.written[index, sub] = int.from_bytes(data, 'little')
        if (index, sub) not in self.kept:
            self.objects[index, sub] = self.written[index, sub]


def set_up(device: Device, is_interrupted=lambda: False):
    device.objects[0x1018, 2] = NODE.dictionary[0x1018][2].default
    return DeviceSetup(device, NODE, Heartbeats(), 0, is_interrupted).run(1.0, 100)


@pytest.mark.parametrize('beats', [True, False])
def test_a_device_that_only_sends_heartbeats_is_not_blamed_on_the_wiring(beats):
    heartbeats, device = Heartbeats(), Device()
    heartbeats.feed(0x720, b'\x05')  # An earlier heartbeat does not show that the wiring still works.

    def upload(index, sub):
        if beats:
            heartbeats.feed(0x720, b'\x05')
        raise SdoCommunicationError('No SDO response received')
    device.upload = upload
    with pytest.raises(DeviceAbsentError) as error:
        DeviceSetup(device, NODE, heartbeats, 0).run(0.0, 100)
    assert error.value.remedy == (ALIVE_REMEDY if beats else ABSENT_REMEDY)


def of_another_layout(**options) -> Device:
    """Return a device whose first two TPDOs map taxels of another row.

    The two TPDOs are event-driven and have other COB-IDs.
    """
    device = Device(**options).having(SYNC, 0x81)
    for i in (0, 1):
        device.having((0x1800 + i, 1), 0x4000_01D0 + i).having((0x1800 + i, 2), 255).having((0x1A00 + i, 0), 2)
        device.having((0x1A00 + i, 1), 0x210F_0108).having((0x1A00 + i, 2), 0x210F_0208)
    return device


def records(device: Device) -> dict:
    """Return all objects that determine what the device sends and when."""
    return {place: value for place, value in device.objects.items() if place == SYNC or place[0] >= 0x1800}


def test_the_serial_number_is_read_if_the_device_has_one():
    assert set_up(Device().having((0x1018, 4), 4711)).serial_number == 4711
    assert set_up(Device()).serial_number is None


def test_a_device_of_another_layout_is_set_up():
    device = of_another_layout()
    set_up(device)
    assert records(device) == records(Device()) | {  # The setup keeps the NO_RTR bit in the COB-IDs of the device.
        (0x1800 + i, 1): 0x4000_0000 + NODE.layout.tpdos[i].cob_id.of(32) for i in (0, 1)}


@pytest.mark.parametrize('options', [
    {'fixed': [(0x1A00, 0)]}, {'fixed': [(0x1A01, 0)]}, {'fixed': [(0x1A01, 2)]}, {'kept': [(0x1A01, 1)]},
    {'fixed': [(0x1801, 2)]}, {'kept': [(0x1801, 2)]}], ids=str)
def test_a_device_that_refuses_its_setup_keeps_its_settings(options):
    """A device that refused its setup was once left with disabled or half-written TPDOs."""
    device = of_another_layout(**options)
    before = records(device)
    with pytest.raises(UnverifiedDeviceError):
        set_up(device)
    after = records(device)
    assert device.written and {place: after[place] for place in before if after[place] != before[place]
                               and place[1] <= 2} == {}


def test_an_interrupted_setup_is_undone():
    device = of_another_layout()
    before = records(device)
    with pytest.raises(InterruptedSetupError):
        set_up(device, is_interrupted=lambda: (0x1A01, 0) in device.written)
    assert (0x1A01, 0) in device.written and all(records(device)[place] == before[place] for place in before
                                                 if place[1] <= 2)


def test_a_device_that_cannot_be_restored_is_reported(caplog):
    """The device accepts only the first write to each object, so its old values cannot be restored."""
    device = of_another_layout(fixed=[(0x1A00, 0)])
    download = device.download

    def once(index, sub, data):
        if (index, sub) in device.written:
            raise SdoCommunicationError('no answer')
        download(index, sub, data)
    device.download = once
    with pytest.raises(UnverifiedDeviceError, match='0x1A00'):
        set_up(device)
    assert [record.fact for record in caplog.records if hasattr(record, 'fact')] == [(0x1800, 2)]


def test_another_device_is_not_trusted():
    with pytest.raises(UnverifiedDeviceError, match='0x1018'):
        set_up(Device().having((0x1018, 1), 0x99))


@pytest.mark.parametrize('now', [0x80, 0x8000_0080, 0x4000_0080, 0xC000_0080])
def test_a_device_with_our_sync_is_left_alone_also_as_producer(now):
    device = Device(fixed=[SYNC]).having(SYNC, now)
    set_up(device)
    assert SYNC not in device.written


@pytest.mark.parametrize(('now', 'written'), [(0x81, 0x80), (0x8000_0081, 0x8000_0080), (0x2000_0080, 0x80)])
def test_another_sync_cob_id_is_written(now, written):
    device = Device().having(SYNC, now)
    set_up(device)
    assert device.written[SYNC] == written


def test_a_device_that_produces_sync_on_another_cob_id_is_refused():
    """CiA 301 does not allow a device to change its SYNC COB-ID while the device produces SYNC.

    The driver would mistake a SYNC with another COB-ID for another kind of CAN frame.
    """
    device = Device().having(SYNC, 0x4000_0081)
    with pytest.raises(DeviceError, match='0x081'):
        set_up(device)
    assert SYNC not in device.written


@pytest.mark.parametrize(('device', 'period'), [
    (Device(), 100), (Device().having(HEARTBEAT, 0), 100),
    (Device(fixed=[HEARTBEAT]).having(HEARTBEAT, 500), 500),
    (Device(kept=[HEARTBEAT]).having(HEARTBEAT, 250), 250),
    (Device(fixed=[HEARTBEAT]).having(HEARTBEAT, 0), 0),
    (Device().having(HEARTBEAT, None), None)], ids=['set', 'written', 'read-only', 'limited', 'none', 'missing'])
def test_the_heartbeat_time_is_the_one_that_the_device_has(device, period):
    assert set_up(device).heartbeat_ms == period


def test_errors_are_read_as_far_as_the_device_has_them():
    device = Device().having((0x1001, 0), 0x09).having((0x1003, 0), 2).having((0x1003, 1), 0x0005_4210).having(
        (0x1003, 2), 0x0000_8130)
    assert read_errors(device) == DeviceErrors(0x09, (0x0005_4210, 0x8130))
    assert read_errors(Device().having((0x1001, 0), 0)) == DeviceErrors(0)
    assert read_errors(Device()) == DeviceErrors(None)


def monitored(heartbeat_time: float | None) -> tuple[NodeMonitor, BusMonitor, PadFacts]:
    """Return the monitors of a configured, running node and of its bus, and the facts of its pad.

    The heartbeat timeout and the data timeout are 0.5 s.
    """
    bus = BusMonitor([32])
    node = NodeMonitor(NODE, bus, 0.5, 0.5)
    node.configured(node.trust.setup, 0.0, DeviceAsSet(heartbeat_ms=None if heartbeat_time is None
                                                       else round(1000 * heartbeat_time)))
    pad = PadFacts(used_by_node=(0,), distinct_by_tpdo=((0,) * 32,),
                   fresh_by_tpdo=((0,) * 32,))
    return node, bus, pad


@pytest.mark.parametrize(('heartbeat_time', 'silence', 'fault'), [
    (0.1, 0.4, NodeFault.NONE), (0.1, 0.7, NodeFault.SILENT), (1.0, 2.8, NodeFault.NONE), (1.0, 3.2, NodeFault.SILENT)])
def test_a_device_with_its_own_heartbeat_time_may_be_silent_for_three_of_them(heartbeat_time, silence, fault):
    node, bus, pad = monitored(heartbeat_time)
    bus.feed(0x720, b'\x05')
    heard = bus.heartbeats.of(32).heard
    assert fault_of(node.look(heard + silence, False, pad, BusCounts(0))) is fault


def test_a_heartbeat_time_that_cannot_be_read_is_measured(monkeypatch):
    node, bus, pad = monitored(None)
    for heard in (100.0, 101.0, 101.05, 102.0):  # A change of state causes the extra heartbeat at 101.05 s.
        monkeypatch.setattr('tactile_node.cia301.heartbeat.time.monotonic', lambda now=heard: now)
        bus.feed(0x720, b'\x05')
    assert fault_of(node.look(104.7, False, pad, BusCounts(0))) is NodeFault.NONE
    assert fault_of(node.look(105.1, False, pad, BusCounts(0))) is NodeFault.SILENT


def test_the_order_of_its_tpdos_is_reported_with_the_node():
    node, _, pad = monitored(0.1)
    order = TpdoOrder(32, ('1', '2', '3'), ('3', '1', '2'))
    node.look(0.0, True, replace(pad, orders=(order,)), BusCounts(0))
    assert node.facts(0.0, NodeState()).tpdo_order == order
    node.look(0.1, True, replace(pad, orders=(None,)), BusCounts(0))
    assert node.facts(0.1, NodeState()).tpdo_order is None


def test_a_silence_during_an_overload_of_this_process_is_not_a_fault_at_once():
    node, bus, pad = monitored(0.1)
    bus.feed(0x720, b'\x05')
    heard = bus.heartbeats.of(32).heard
    node.commanded(heard, pad)
    assert fault_of(node.look(heard + 2.0, True, pad, BusCounts(0, is_overloaded=True))) is NodeFault.NONE
    assert fault_of(node.look(heard + 2.0, True, pad, BusCounts(0))) is NodeFault.SILENT
    assert fault_of(node.look(heard + 60.0, True, pad, BusCounts(0, is_overloaded=True))) is not NodeFault.NONE
