"""End-to-end tests for skins without SYNC.

The tests check the simulated device byte by byte, and then the driver, a replay of its log, and its faults.
"""

import time

import can
import numpy as np
import pytest
from can_bench import INTERFACE, Bench, SkinMaster, channel_of, other_bus
from fault_bench import FaultBench
from waiting import wait_until

from tactile_node.assembly.health import NodeFault
from tactile_node.bus.bus_settings import BusSettings
from tactile_node.bus.skin_bus import SkinBus
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.simulator.tpdo_records import ConfiguredTpdo, EventSchedule
from tactile_node.skin.layout_file import load_layout
from tactile_node.skin.pads import make_pad

SWEEPS, SNAPSHOTS = 'event12x8_8bit.yaml', 'event8x8_16bit.yaml'
SHAPES = {SWEEPS: (12, 8), SNAPSHOTS: (8, 8)}


def counting(layout):
    """Return a source whose value is the same in all taxels and differs from scan to scan."""
    scans, scale = iter(range(10 ** 6)), load_layout(layout).value.scale
    return lambda t: np.full(SHAPES[layout], scale * (1 + next(scans) % 200))


def still(layout):
    rows, cols = SHAPES[layout]
    values = load_layout(layout).value.scale * np.arange(rows * cols).reshape(rows, cols)
    return lambda t: values


def schedule(**times):
    tpdo = ConfiguredTpdo(0x181, every=255, length=8, pieces=(), whole=0, **times)
    return EventSchedule([tpdo, tpdo._replace(can_id=0x182, event_timer=0.0)], 10.0)


def sent_at(plan, times, data=lambda now: b''):
    return [now for now in times if [tpdo.can_id for tpdo in plan.due(now, lambda _, at=now: data(at))] == [0x181]]


def test_a_scan_is_sent_at_each_event_timer_and_missed_scans_are_not_sent_later():
    plan = schedule(event_timer=0.5)
    assert sent_at(plan, [10, 10.25, 10.5, 10.75, 14.25, 14.5, 14.75]) == [10, 10.5, 14.25, 14.75]


def test_changes_are_sent_after_the_inhibit_time_and_what_is_unchanged_after_the_event_timer():
    plan = schedule(event_timer=1.0, inhibit_time=0.25, is_on_change=True)
    assert sent_at(plan, [10, 10.125, 10.5, 11, 11.125]) == [10, 11]
    assert sent_at(plan, [11.25, 11.375, 11.5, 11.625], data=str) == [11.25, 11.5]


class Device(SkinMaster):
    """One simulated pad with node 32, and the CANopen master of the pad."""

    def take(self, can_id, count):
        found = []
        while len(found) < count:
            message = self.bus.recv(60)
            found += [message] if message.arbitration_id == can_id else []
        return found

    def is_silent(self):
        while (message := self.bus.recv(0.15)) is not None:
            if message.arbitration_id < 0x580:
                return False
        return True


@pytest.fixture
def device():
    with Device('event_wire', SNAPSHOTS, still(SNAPSHOTS)) as device:
        yield device


@pytest.mark.bus
def test_the_device_sends_by_its_event_timer_and_only_while_operational(device):
    """The master gives TPDO 1 the transmission type 254 (sub 2) and an event timer of 20 ms (sub 5), and enables it.

    The master sends no SYNC.
    """
    for request in ('2F001802FE000000', '2B00180514000000', '23001801A0010000'):
        assert device.sdo(request).startswith('60')
    assert device.is_silent()
    device.send(0x000, '0120')
    frames = device.take(0x1A0, 6)
    assert {frame.data.hex() for frame in frames} == {'0000010002000300'}
    assert frames[-1].timestamp - frames[0].timestamp > 4 * 0.02
    device.send(0x000, '0220')
    time.sleep(0.05)
    while device.bus.recv(0) is not None:
        pass
    assert device.is_silent()
    device.send(0x000, '0120')
    device.take(0x1A0, 2)
    device.simulator.devices[32].power_off()
    while device.bus.recv(0) is not None:
        pass
    assert device.is_silent()


@pytest.mark.bus
def test_the_inhibit_time_is_refused_while_the_tpdo_exists(device):
    """CiA 301 forbids a change of the inhibit time while bit 31 of the COB-ID is 0.

    The abort code 0x08000022 means "because of the present device state".
    """
    assert device.sdo('2B00180364000000').startswith('60')
    assert device.sdo('23001801A0010000').startswith('60')
    assert device.sdo('2B00180332000000') == '8000180322000008'


@pytest.mark.bus
@pytest.mark.parametrize('layout', [SWEEPS, SNAPSHOTS])
def test_a_node_that_goes_quiet_has_no_taxels_and_is_never_without_sync(layout):
    with FaultBench(f'event_quiet{layout}', layout=layout, source=still(layout)) as bench:
        bench.run()
        bench.adapter.tamper = lambda message: [] if 0x180 <= message.arbitration_id < 0x580 else [message]
        bench.detect(NodeFault.NO_TAXELS)
        bench.repair()
        bench.device.power_off()
        bench.detect(NodeFault.SILENT)
        bench.device.boot()
        bench.end_of_cause().recover()
        assert NodeFault.NO_SYNC not in bench.log.facts


@pytest.mark.bus
def test_values_from_before_a_node_was_configured_again_are_not_given(tmp_path):
    """Another master may have changed the range of the node.

    A TPDO that has not been received since the new configuration is STALE, whatever the value of max_age.
    """
    path = load_layout(SNAPSHOTS).source
    (tmp_path / 'old.yaml').write_text(open(path).read().replace('max_age: 0.15', 'max_age: 60'))
    (tmp_path / 'old.eds').write_text(open(path.replace('.yaml', '.eds')).read())
    with FaultBench('event_again', layout=str(tmp_path / 'old.yaml'), source=still(SNAPSHOTS)) as bench:
        bench.run()
        bench.adapter.lost_ids = {0x1A1}
        bench.send(0x620, '2B00180533000000')
        bench.detect(NodeFault.RECONFIGURED)
        bench.wait(lambda: bench.node().fault is NodeFault.NONE, 'fault stays')
        since = len(bench.kept)
        bench.wait(lambda: len(bench.kept) >= since + 10, 'no frames')
        frames = [frame for _, frame in bench.kept[since:]]
        assert all(np.isnan(frame.values[0, 4:]).all() for frame in frames)
        assert not np.isnan(frames[-1].values[0, :4]).any() and not np.isnan(frames[-1].values[1:]).any()
        bench.repair()


@pytest.mark.bus
def test_while_the_driver_is_stopped_nothing_is_given():
    """Without SYNC, a device that another master starts sends TPDOs even while the driver is stopped."""
    with Bench('event_stopped', SWEEPS, source=still(SWEEPS)) as bench:
        bench.run()
        bench.take_whole(2)
        bench.driver.stop()
        bus = other_bus('event_stopped')
        time.sleep(0.1)
        bench.forget()
        received = bench.driver.facts().can_frames['tpdo']
        bus.send(can.Message(arbitration_id=0x000, is_extended_id=False, data=b'\x01\x20'))
        assert wait_until(lambda: bench.driver.facts().can_frames['tpdo'] > received + 40)
        assert bench.frames.empty()
        bus.shutdown()


@pytest.mark.bus
def test_pads_with_and_without_sync_on_one_bus():
    pads = (make_pad('synced', 64, 'sim16x16.yaml'), make_pad('event', 32, SNAPSHOTS))
    simulator = SkinSimulator(pads, {'synced': lambda t: np.zeros((16, 16)), 'event': still(SNAPSHOTS)})
    frames = []
    driver = SkinBus(BusSettings(INTERFACE, channel_of('event_mixed')), pads, lambda *given: frames.append(given))
    simulator.start(INTERFACE, channel_of('event_mixed'))
    driver.open()
    driver.configure()
    driver.start()
    assert wait_until(lambda: min([name for name, frame in list(frames) if not frame.missing_can_frames].count(pad)
                                  for pad in ('synced', 'event')) > 3)
    driver.close()
    simulator.stop()
    assert {name for name, frame in frames if frame.tpdo_ages is not None} == {'event'}
    counts = driver.facts()
    assert driver.sync.sent > 3
    assert all(pad.tpdos_received == pad.tpdos_used + pad.tpdos_pending + sum(pad.losses.values())
               for pad in counts.pads)
