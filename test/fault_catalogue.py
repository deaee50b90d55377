"""The faults a driver on a factory floor meets: each function injects one and states what the user sees.

`python test/fault_catalogue.py [NAME ...]` prints them as a table, with the times measured. Every FaultBench also
checks, as it ends, that all taxels published as valid were right and that no sequence number or stamp came twice.
"""

import ctypes
import errno
import functools
import itertools
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import can
import numpy as np
from can_bench import TooSlowError, is_overloaded
from canopen import SdoAbortedError, SdoCommunicationError
from fault_bench import TIMEOUT, FaultBench
from stalls import STALLING, StallBench, stall

from tactile_node.assembly.frame_source import LossReason
from tactile_node.assembly.health import BusFault, ForeignCommand, NodeFault, Overload, SentTpdo, SyncFault
from tactile_node.cia301.emergency import DeviceErrors, Emergency
from tactile_node.cia301.objects import NmtState
from tactile_node.conditioning.tare import ContactGuard, TaredPad
from tactile_node.errors import BusError, DeviceAbsentError, DeviceError, TareRefusedError, TwoDevicesError
from tactile_node.simulator.device import SimulatedDevice
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.sources.supervisor import Supervisor
from tactile_node.taxel_frame import TaxelFrame

ALLOWED = 1.0  # s from the end of a cause until taxels come again
KEEPS_UP = 0.02  # s by which a process beside the faults may wake up late
ALL_TPDOS = range(1, 17)  # of the pad of 8x8 taxels
COB_IDS = [0x1A0 + 0x100 * (i // 4) + i % 4 for i in range(16)]
FAULTS: list[Callable[[str], FaultBench | StallBench]] = []


def fault(*nodes: tuple[int, ...], is_running: bool = True, **settings: Any) -> Callable:
    """Make a fault of the catalogue of what injects it into a bench, whose driver runs; the channel is the test's."""
    def listed(inject: Callable[[FaultBench], None]) -> Callable[[str], FaultBench]:
        @functools.wraps(inject)
        def injected(channel: str) -> FaultBench:
            with FaultBench(channel, *nodes, **settings) as bench:
                if is_running:
                    bench.run().cause()
                inject(bench)
            return bench
        FAULTS.append(injected)
        return injected
    return listed


def uniform(seed: int, low: float, high: float, rows: int, cols: int) -> Callable[[float], np.ndarray]:
    """Return a source of taxels that stay as they are."""
    values = np.random.default_rng(seed).uniform(low, high, (rows, cols))
    return lambda _time: values


def _switch_off(bench: FaultBench, device: SimulatedDevice, missing: int, *faults: object, **kind: Any) -> TaxelFrame:
    """Wait until a fault is logged and a frame after that lacks so many CAN frames; return that one."""
    device.power_off()
    bench.detect(*faults, **kind)
    reported = len(bench.kept)

    def lacking() -> TaxelFrame | None:
        return next((frame for _, frame in bench.kept[reported:] if frame.missing_can_frames == missing), None)
    bench.wait(lambda: lacking() is not None, 'frames without its taxels')
    return lacking()


def _waits_for(bench: FaultBench, node: str) -> bool:
    return any(isinstance(fact, DeviceAbsentError) and node in fact.where for fact in bench.log.facts)


def _switch_on(bench: FaultBench, device: SimulatedDevice) -> None:
    device.boot()
    bench.end_of_cause().recover()


@fault()
def power_cycled_in_mid_stream(bench: FaultBench) -> None:
    """The device is configured and started again; a sentence names it, the outage is counted."""
    bench.power_cycle()
    bench.end_of_cause().detect(NodeFault.BOOTED)
    bench.recover()
    bench.wait(lambda: bench.node().outages.count == 1 and bench.node().boots == 1, 'outage not counted')


@fault()
def absent_then_back(bench: FaultBench) -> None:
    """The device is reported as silent, its taxels are NaN; it is used again as soon as it boots."""
    _switch_off(bench, bench.device, 16, NodeFault.SILENT)
    _switch_on(bench, bench.device)


@fault(is_running=False)
def absent_at_configure_then_late(bench: FaultBench) -> None:
    """configure logs what it waits for, and continues when the device answers."""
    bench.device.power_off()
    starter = threading.Thread(target=bench.run)
    bench.cause()
    starter.start()
    bench.wait(lambda: _waits_for(bench, 'node 32'), 'waits in silence')
    bench.device.boot()
    bench.end_of_cause().recover()
    starter.join()


@fault((32, 64))
def one_of_two_pads_lost(bench: FaultBench) -> None:
    """Only that pad is reported as silent; the other continues, frame by frame."""
    bench.wait_for_whole('pad64')
    bench.cause()
    bench.device.power_off()
    bench.detect(NodeFault.SILENT)
    assert bench.node().fault is NodeFault.SILENT
    bench.assert_no_outage('pad64')
    bench.wait_for_whole('pad64', bench.kept[-1][1].stamp)
    bench.device.boot()
    bench.end_of_cause().recover('pad32', 'pad64')
    bench.assert_no_outage('pad64')


@fault()
def boot_up_message_lost(bench: FaultBench) -> None:
    """A device that booted unheard sends nothing by itself: it is found by a request, and configured."""
    bench.adapter.lost_ids = {0x720}
    bench.power_cycle()
    bench.wait(lambda: bytes(1) in bench.adapter.lost, 'boot-up not lost')
    bench.adapter.lost_ids = set()
    bench.end_of_cause().detect(NodeFault.NO_HEARTBEAT, NodeFault.SILENT)  # by chance taxels are missing too
    bench.recover()


@fault()
def another_device_comes_back(bench: FaultBench) -> None:
    """A device of another vendor is refused, reported by its identity; what it sends is published as NaN."""
    bench.device.power_off()
    bench.device.lie(0x1018, 1, (0x99).to_bytes(4, 'little'))
    bench.device.boot()
    bench.detect(kind=lambda fact: isinstance(fact, DeviceError) and '0x1018' in fact.where and '0x99' in fact.got)
    used, seen = bench.driver.statistics().pads['pad32'].used, len(bench.kept)
    bench.send(0x620, '23001801A0010000')  # another master lets it send TPDO 1
    bench.wait(lambda: bench.send(0x000, '0120') or bench.driver.statistics().pads['pad32'].used > used,
               'it does not send')
    bench.wait(lambda: len(bench.kept) > seen + 2, 'no frames')
    assert all(np.isnan(frame.values).all() for _, frame in bench.kept[seen:])
    assert bench.node().fault.is_fault and bench.node().distrusted > 0
    bench.device.power_off()
    _switch_on(bench, bench.device)


def _command(bench: FaultBench, command: ForeignCommand) -> None:
    bench.send(0x000, bytes(command).hex())
    bench.end_of_cause().detect(command)
    bench.recover()
    health = bench.driver.health()
    assert (health.foreign_commands, health.last_command) == (1, command) and bench.node().outages.count <= 1


@fault()
def reset_by_another_master(bench: FaultBench) -> None:
    """The other master's command is reported; the device is configured and started again."""
    _command(bench, ForeignCommand(0x81, 32))


@fault()
def all_reset_by_another_master(bench: FaultBench) -> None:
    """A reset of all nodes is reported and recovered from like one of a single node."""
    _command(bench, ForeignCommand(0x82, 0))


@fault()
def stopped_by_another_master(bench: FaultBench) -> None:
    """The command and the state STOPPED are reported; the device is started again."""
    _command(bench, ForeignCommand(0x02, 32))
    assert NodeFault.NOT_OPERATIONAL in bench.log.facts


def _lists_errors(message: can.Message) -> list[can.Message]:
    """Answers of a hot device: error register 0x09; one error 0x4210, with 0x0005 of the maker."""
    answers = {'011000': '4F01100009000000', '031000': '4F03100001000000', '031001': '4303100110420500'}
    answer = answers.get(bytes(message.data[1:4]).hex()) if message.arbitration_id == 0x5A0 else None
    return [message if answer is None else _with_data(message, bytes.fromhex(answer))]


@fault()
def refuses_operational(bench: FaultBench) -> None:
    """A device that stays PRE-OPERATIONAL is an error on /diagnostics for as long as it does, with its own errors."""
    bench.device.refuses_start = True
    bench.cause()
    bench.send(0x000, '8020')
    bench.detect(NodeFault.NOT_OPERATIONAL)
    bench.wait(lambda: (bench.node().state, bench.node().fault) == (
                   NmtState.PRE_OPERATIONAL, NodeFault.NOT_OPERATIONAL),
               'not reported')
    bench.adapter.tamper = _lists_errors
    bench.detect(DeviceErrors(0x09, (0x0005_4210,)))
    assert bench.node().device_errors == DeviceErrors(0x09, (0x0005_4210,))
    bench.adapter.tamper = None
    bench.device.refuses_start = False
    bench.end_of_cause().recover()


@fault()
def adapter_unplugged(bench: FaultBench) -> None:
    """The bus is reported as failed with the reason, opened again until it works; the outage is counted."""
    bench.adapter.is_plugged = False
    bench.detect(BusFault.RECEPTION_FAILED, BusFault.SENDING_FAILED)
    bench.wait(lambda: any(isinstance(fact, BusError) and fact.got == 'no such device' for fact in bench.log.facts),
               'does not log what it waits for')
    assert bench.driver.failure.fault in (BusFault.RECEPTION_FAILED, BusFault.SENDING_FAILED)
    bench.repair()
    bench.wait(lambda: bench.driver.failure is None, 'failure stays')
    assert bench.driver.health().outages.count == bench.node().outages.count == 1


@fault()
def sending_fails(bench: FaultBench) -> None:
    """A bus on which nothing can be sent is opened again until it works."""
    bench.adapter.can_send = False
    bench.detect(BusFault.SENDING_FAILED)
    assert 'Transmit buffer full' in bench.driver.failure.detail
    bench.wait(lambda: bench.adapter.opened > 3, 'the bus is not tried again')
    bench.repair()


@fault()
def bus_off(bench: FaultBench) -> None:
    """The controller's error frame is reported as bus-off, the bus opened again."""
    bench.send_error(0x040, bytes(8))
    bench.end_of_cause().detect(BusFault.BUS_OFF)
    bench.recover()
    assert bench.adapter.opened == 2


@fault()
def error_frames(bench: FaultBench) -> None:
    """Error frames are counted; error-passive is reported until it ends; the taxels continue."""
    for flags in (0x30, 0x10):
        bench.send_error(0x004, [0, flags, 0, 0, 0, 0, 9, 130])
    bench.wait(lambda: bench.driver.health().is_error_passive, 'not reported')
    bench.wait(lambda: bench.driver.health().error_counters == (9, 130), 'counters not reported')
    bench.wait(lambda: bench.driver.statistics().can_frames['error'] == 2, 'not counted')
    bench.send_error(0x004, [0, 0x40, 0, 0, 0, 0, 0, 0])
    bench.wait(lambda: not bench.driver.health().is_error_passive, 'it stays')
    bench.wait_for_whole('pad32', bench.kept[-1][1].stamp)
    assert bench.driver.failure is None
    bench.assert_no_outage()


@fault()
def heartbeat_lost_while_taxels_flow(bench: FaultBench) -> None:
    """It is reported; no taxel is lost by it, and it counts as no outage."""
    bench.adapter.lost_ids = {0x720}
    bench.detect(NodeFault.NO_HEARTBEAT)
    bench.wait_for_whole('pad32', bench.kept[-1][1].stamp)
    bench.repair()
    bench.assert_no_outage()


@fault()
def heartbeat_switched_off_by_another_master(bench: FaultBench) -> None:
    """It is reported, and switched on again while the taxels flow."""
    bench.send(0x620, '2B17100000000000')  # 0x1017 = 0
    bench.end_of_cause().detect(NodeFault.NO_HEARTBEAT)
    bench.recover()
    bench.assert_no_outage()


@fault()
def taxels_lost_while_heartbeat_flows(bench: FaultBench) -> None:
    """A node that is OPERATIONAL without taxels is reported as such."""
    bench.adapter.lost_ids = set(COB_IDS)
    bench.detect(NodeFault.NO_TAXELS)
    bench.repair()
    bench.wait(lambda: bench.node().outages.count == 1, 'outage not counted')


def _write(bench: FaultBench, *requests: str) -> None:
    for request in requests:
        bench.send(0x620, request)
        time.sleep(0.005)
    bench.end_of_cause().detect(NodeFault.RECONFIGURED)
    bench.recover()


@fault()
def tpdos_switched_off_by_another_master(bench: FaultBench) -> None:
    """The missing taxels are reported, and the configuration is written again."""
    _write(bench, *(f'23{number - 1:02X}1801{can_id & 0xFF:02X}{can_id >> 8:02X}0080'
                    for number, can_id in zip(ALL_TPDOS, COB_IDS)))


@fault()
def tpdo_remapped_by_another_master(bench: FaultBench) -> None:
    """Another master exchanges the taxels of TPDO 1: none of its values is given, and the mapping is written again."""
    _write(bench, '23001801A0010080',                                      # TPDO 1 off
           '2F001A0000000000', '23001A0110043071', '23001A0210033071',     # sub 4 and 3 in place of 1 and 2
           '23001A0310023071', '23001A0410013071', '2F001A0004000000', '23001801A0010000')
    assert bench.node().distrusted > 0


@fault()
def tpdo_slowed_down_by_another_master(bench: FaultBench) -> None:
    """Another master lets TPDO 1 answer every second SYNC: it is reported, and written again."""
    _write(bench, '2F00180202000000')


@fault()
def one_tpdo_switched_off_by_another_master(bench: FaultBench) -> None:
    """One of sixteen TPDOs is off: the others flow, it is reported, and switched on again."""
    _write(bench, '23021801A2010080')


@fault()
def one_tpdo_switched_off_unseen(bench: FaultBench) -> None:
    """One of sixteen TPDOs is off and no write was seen: it is named, and switched on while the others flow."""
    bench.adapter.lost_ids = {0x620}
    bench.send(0x620, '23021801A2010080')
    bench.wait(lambda: NodeFault.TPDO_MISSING in bench.log.facts or bench.node().outages.count, 'not logged')
    bench.assert_no_outage()  # an outage would have switched it on
    bench.detect(NodeFault.TPDO_MISSING)
    bench.end_of_cause().recover()  # the repair begins at the report: until then no one could know of the fault
    bench.assert_no_outage()
    assert NodeFault.RECONFIGURED not in bench.log.facts


@fault()
def one_tpdo_never_arrives(bench: FaultBench) -> None:
    """One TPDO stays away though it is configured: it is named by number and COB-ID; asking does not fill the bus."""
    bench.adapter.lost_ids = {0x1A2}
    bench.detect(NodeFault.TPDO_MISSING)
    assert bench.node().missing_tpdos == (SentTpdo(3, 0x1A2),)
    checks: list[float] = []

    def has_checked(times: int) -> bool:
        checks.extend(message.timestamp for message in bench.heard()
                      if message.arbitration_id == 0x620 and message.data[:4] == bytes.fromhex('40181003'))
        return len(checks) >= times
    bench.wait(lambda: has_checked(5), 'not asked again')
    pauses = np.diff(checks)  # at least 0.1, 0.2, 0.4 ... s: the device is asked ever more rarely, however busy we are
    assert (pauses[1:4] >= 0.1 * 2.0 ** np.arange(3)).all(), pauses
    bench.assert_no_outage()
    assert bench.node().fault is NodeFault.TPDO_MISSING
    bench.repair()


def _one_of_two_devices(bench: FaultBench, since: int) -> None:
    """Nothing is valid of what was published from ``since`` on."""
    bench.wait(lambda: len(bench.kept) > since + 20, 'no frames')
    assert all(np.isnan(frame.values).all() for _, frame in bench.kept[since:])


def _second_device(bench: FaultBench) -> SkinSimulator:
    second = SkinSimulator(bench.pads, {'pad32': lambda t: np.full((8, 8), 3.0)})
    second.start('virtual', bench.channel)
    return second


def _alone_again(bench: FaultBench) -> None:
    bench.wait(lambda: bench.node().fault is not NodeFault.TWO_SENDERS, 'fault stays')
    bench.end_of_cause().recover()


@fault()
def two_devices_with_one_node_id(bench: FaultBench) -> None:
    """A second device of our node-ID is switched on: no value is given while both send, both are left alone."""
    second = _second_device(bench)
    bench.detect(NodeFault.TWO_SENDERS)
    seen = len(bench.kept)
    bench.send(0x000, '0120')  # another master starts both
    bench.wait(lambda: all(one.devices[32].operational for one in (bench.simulator, second)), 'not started')
    bench.heard()
    time.sleep(3.0)
    assert bench.node().fault is NodeFault.TWO_SENDERS
    assert not [message for message in bench.heard() if message.arbitration_id in (0x000, 0x620)]
    assert all(one.devices[32].operational for one in (bench.simulator, second))
    _one_of_two_devices(bench, seen)
    second.stop()
    _alone_again(bench)  # as the bench ends, it finds each value that is not of the first device


@fault(is_running=False)
def two_devices_from_the_start(bench: FaultBench) -> None:
    """Two devices answer when the driver configures: it refuses, with both named, before any value is given."""
    second = _second_device(bench)
    bench.cause()
    bench.driver.open()
    try:
        bench.driver.configure()
        raise AssertionError('configure() is content')
    except TwoDevicesError as error:
        assert 'node 32' in error.where
    bench.detected = time.monotonic() - bench._begun
    requests = sum(message.arbitration_id == 0x620 and message.data[0] != 0x80 for message in bench.heard())
    bench.wait(lambda: bench.driver.statistics().can_frames.get('sdo', 0) >= 2 * requests,
               'not answered by both')  # a late answer to these would count for the next request about its object
    second.stop()
    bench.end_of_cause()
    bench.driver.configure()
    bench.driver.start()
    bench.recover()


@fault()
def second_sender_of_a_tpdo(bench: FaultBench) -> None:
    """Another node sends on one of our COB-IDs: it is named, and no value is given until it stops."""
    sender = bench.repeat(0x1A2, 0.017, bytes(8))
    bench.detect(NodeFault.TWO_SENDERS)
    assert bench.node().surplus_tpdos == (SentTpdo(3, 0x1A2),)
    recognised = len(bench.kept)
    _one_of_two_devices(bench, recognised + 1)
    sender.stop()
    del bench.kept[:recognised + 1]  # what came before it was recognised may hold the other's values
    _alone_again(bench)


@fault()
def replaced_by_two_devices(bench: FaultBench) -> None:
    """Two devices of our node-ID come after a silence: no backlog of one, so no value is given while both send."""
    bench.device.power_off()
    bench.detect(NodeFault.SILENT)
    silent = len(bench.kept)
    time.sleep(1.0)
    second = _second_device(bench)
    bench.device.boot()
    bench.wait(lambda: bench.node().fault is NodeFault.TWO_SENDERS, 'not recognised')
    _one_of_two_devices(bench, silent)
    second.stop()
    _alone_again(bench)


@fault()
def second_heartbeat_of_a_node_id(bench: FaultBench) -> None:
    """Another device, which sends no taxels, has our node-ID: its heartbeats betray it; no value is given."""
    sender = bench.repeat(0x720, 0.1, b'\x05')
    bench.detect(NodeFault.TWO_SENDERS)
    assert bench.node().surplus_tpdos == ()
    _one_of_two_devices(bench, len(bench.kept) + 1)
    sender.stop()
    _alone_again(bench)


@fault()
def two_masters_fight(bench: FaultBench) -> None:
    """Another master switches a TPDO off again and again: it is reported rarely, and answered ever more rarely."""
    bench.send(0x620, '23021801A2010080')
    bench.detect(NodeFault.RECONFIGURED)
    for _ in range(40):
        bench.send(0x620, '23021801A2010080')
        time.sleep(0.1)
    outages = bench.node().outages
    assert outages.count < 10 and sum(fact is NodeFault.RECONFIGURED for fact in bench.log.error_facts) < 4
    bench.wait(lambda: bench.node().fault is NodeFault.NONE, 'given up')
    bench.end_of_cause().recover()


@fault()
def second_sync_producer(bench: FaultBench) -> None:
    """SYNC of another device while the driver produces it: it is reported by name until it ends."""
    bench.is_clock_true = False  # taxels sampled at its SYNC have the stamp of ours
    producer = bench.repeat(0x080, 0.05)
    bench.detect(SyncFault.SECOND_PRODUCER)
    assert bench.driver.health().sync.fault is SyncFault.SECOND_PRODUCER and bench.driver.health().sync.foreign > 0
    time.sleep(2.0)
    assert NodeFault.TWO_SENDERS not in bench.log.facts  # TPDOs for its SYNC are no second sender's
    producer.stop()
    bench.end_of_cause().recover()
    bench.wait(lambda: bench.driver.health().sync.fault is SyncFault.NONE, 'fault stays')


@fault(produce_sync=False, sync_period=0.02, is_running=False)
def sync_producer_of_another_period(bench: FaultBench) -> None:
    """The device that produces SYNC has another period than sync_period: both are reported; the taxels flow."""
    producer = bench.repeat(0x080, 0.04)
    bench.run().cause()
    bench.detect(SyncFault.OTHER_PERIOD)
    period = bench.driver.health().sync.period
    bench.wrong_durations += [] if abs(period - 0.04) < 0.01 else [f'a period of {period:.3f} s']
    producer.stop()
    bench.repeat(0x080, 0.02)
    bench.end_of_cause().recover()
    bench.wait(lambda: bench.driver.health().sync.fault is SyncFault.NONE, 'fault stays')


@fault()
def transmission_type_ignored(bench: FaultBench) -> None:
    """A device confirms the transmission type and keeps another: it is refused, not run with half of its frames."""
    _disturb_configuration(bench, _reads('4F001802', '02000000'), '0x1800 sub 2', '0x02')


@fault(produce_sync=False, is_running=False)
def sync_of_another_producer_stops(bench: FaultBench) -> None:
    """It is reported that SYNC is missing; the device is left alone."""
    producer = bench.repeat(0x080, 0.02)
    bench.run().cause()
    producer.stop()
    bench.detect(NodeFault.NO_SYNC)
    assert bench.node().is_operational
    bench.repeat(0x080, 0.02)
    bench.end_of_cause().recover()


@fault()
def emcy_storm(bench: FaultBench) -> None:
    """The first EMCY is reported decoded, all are counted, few are reported, the last is kept; the taxels continue."""
    for i in range(2000):
        bench.send(0x0A0, f'1042 09 {i:010X}')
    bench.detect(kind=lambda fact: isinstance(fact, Emergency) and (fact.code, fact.register) == (0x4210, 0x09))
    bench.wait(lambda: bench.node().emergencies == 2000, 'not all counted')
    bench.wait_for_whole('pad32', bench.kept[-1][1].stamp)
    assert bench.last_emergency.manufacturer[-1] == 1999 & 0xFF
    assert sum(isinstance(fact, Emergency) for fact in bench.log.error_facts) < 10


@fault()
def short_emcy(bench: FaultBench) -> None:
    """An EMCY without all of its bytes is reported with what it holds."""
    for data in ('', '10', '1042', '104209'):
        bench.send(0x0A0, data)
    bench.wait(lambda: bench.node().emergencies == 4, 'not counted')
    bench.detect(kind=lambda fact: isinstance(fact, Emergency))
    assert (bench.last_emergency.code, bench.last_emergency.register) == (0x4210, 9)
    bench.wait_for_whole('pad32', bench.kept[-1][1].stamp)


@fault()
def emcy_until_it_is_reset(bench: FaultBench) -> None:
    """An error stays a warning until the device resets it, all of its errors, or starts again."""

    def has(code: int | None, count: int) -> None:
        bench.wait(lambda: bench.node().emergencies == count, 'not counted')
        active = bench.node().active_emergency
        assert (active.code if active else None) == code
    for count, (data, code) in enumerate((('1042090000000000', 0x4210), ('0000080000000000', 0x4210),
                                          ('0000000000000000', None), ('3081110000000000', 0x8130)), 1):
        bench.send(0x0A0, data)
        has(code, count)
    bench.power_cycle()
    bench.end_of_cause().recover()
    has(None, 4)


@fault()
def foreign_frames(bench: FaultBench) -> None:
    """Devices of other makers, node guarding with its toggle bit and empty heartbeats disturb nothing."""
    for can_id, data in ((0x555, '01'), (0x720, '85'), (0x720, ''), (0x733, '00'), (0x0B3, '10'), (0x000, '01'),
                         (0x000, '0133'), (0x000, '')):
        bench.send(can_id, data)
    bench.other.send(can.Message(arbitration_id=0x720, is_extended_id=False, is_remote_frame=True))
    bench.other.send(can.Message(arbitration_id=0x1A0, is_extended_id=True, data=bytes(8)))
    bench.wait(lambda: bench.driver.statistics().can_frames.get('foreign') == 2, 'not counted')
    bench.wait_for_whole('pad32', bench.kept[-1][1].stamp)
    assert not bench.complaints and (bench.node().state, bench.node().fault) == (
        NmtState.OPERATIONAL, NodeFault.NONE)


@fault((32, 64), boot_timeout=0.3, is_running=False)
def absent_pad_of_two(bench: FaultBench) -> None:
    """The pad that is there works; the other is reported as not answering, and joins as soon as it boots."""
    bench.simulator.devices[64].power_off()
    bench.cause()
    bench.run()
    bench.detect(kind=lambda fact: isinstance(fact, DeviceAbsentError) and 'node 64' in fact.where)
    bench.wait(lambda: bench.node('pad64').fault.is_fault, 'fault not reported')
    assert all(np.isnan(frame.values).all() for name, frame in bench.kept if name == 'pad64')
    bench.simulator.devices[64].boot()
    bench.end_of_cause().recover('pad64')


def _tamper(bench: FaultBench, tamper: Callable, seen: Callable[[FaultBench], int]) -> None:
    """Let TPDOs pass ``tamper`` until ``seen`` has counted a few."""
    bench.adapter.tamper = lambda message: tamper(message) if message.arbitration_id in COB_IDS else [message]
    bench.wait(lambda: seen(bench) >= 20, 'not counted')
    bench.detected = time.monotonic() - bench._begun
    bench.repair()
    bench.assert_no_outage()


def _pad(bench: FaultBench):
    return bench.driver.statistics().pads['pad32']


@fault()
def tpdos_lost(bench: FaultBench) -> None:
    """Every seventh TPDO lost: its taxels are NaN and STALE, the TPDOs missing are counted and reported as WARN."""
    numbers = itertools.count()
    _tamper(bench, lambda message: [message] if next(numbers) % 7 else [], lambda bench: _pad(bench).missing)


@fault()
def tpdos_duplicated(bench: FaultBench) -> None:
    """Each TPDO twice: the second is lost and counted as duplicate, the taxels continue."""
    _tamper(bench, lambda message: [message, message],
            lambda bench: _pad(bench).losses[LossReason.DUPLICATE])


@fault()
def tpdos_reordered(bench: FaultBench) -> None:
    """Pairs of TPDOs exchanged: the earlier one is lost as out of order, never mixed in."""
    held: list[can.Message] = []

    def exchange(message: can.Message) -> list[can.Message]:
        held.append(message)
        return [held.pop(), held.pop()] if len(held) == 2 else []
    _tamper(bench, exchange, lambda bench: _pad(bench).losses[LossReason.OUT_OF_ORDER])


@fault()
def short_tpdos(bench: FaultBench) -> None:
    """A byte less than mapped: the TPDO is lost as short, its taxels are NaN."""
    def cut(message: can.Message) -> list[can.Message]:
        return [_with_data(message, message.data[:-1])] if message.arbitration_id == COB_IDS[3] else [message]
    _tamper(bench, cut, lambda bench: _pad(bench).losses[LossReason.SHORT])


@fault()
def over_long_tpdos(bench: FaultBench) -> None:
    """A byte more than mapped (here: than CAN allows): lost as over-long, the bus continues."""
    def lengthen(message: can.Message) -> list[can.Message]:
        return [_with_data(message, message.data + b'1')] if message.arbitration_id == COB_IDS[3] else [message]
    _tamper(bench, lengthen, lambda bench: _pad(bench).losses[LossReason.OVER_LONG])


def _with_data(message: can.Message, data: bytes) -> can.Message:
    return can.Message(timestamp=message.timestamp, arbitration_id=message.arbitration_id, is_extended_id=False,
                       data=data, dlc=len(data), check=False)


def _disturb_configuration(bench: FaultBench, tamper: Callable[[can.Message], list], where: str, got: str) -> None:
    """Start the device again while its SDO answers pass ``tamper``; until that ends its taxels are NaN."""
    bench.adapter.tamper = lambda message: tamper(message) if message.arbitration_id == 0x5A0 else [message]
    bench.power_cycle()
    bench.detect(kind=lambda fact: isinstance(fact, DeviceError) and where in fact.where and got in fact.got)
    seen = len(bench.kept)
    bench.wait(lambda: len(bench.kept) > seen + 2, 'no frames')
    assert all(np.isnan(frame.values).all() for _, frame in bench.kept[seen:])
    bench.repair()


def _reads(answer: str, value: str) -> Callable[[can.Message], list[can.Message]]:
    """Tamper with the ``answer`` to a read, by its first four bytes: it gives ``value``."""
    def tamper(message: can.Message) -> list[can.Message]:
        is_meant = bytes(message.data[:4]) == bytes.fromhex(answer)
        return [_with_data(message, bytes.fromhex(answer + value)) if is_meant else message]
    return tamper


@fault()
def sdo_aborted_in_configuration(bench: FaultBench) -> None:
    """The device refuses its TPDO: object and abort code are reported, it is tried again until it agrees."""
    def abort(message: can.Message) -> list[can.Message]:  # CiA 301: 0x60 confirms a download; 0x80 aborts it
        is_tpdo = bytes(message.data[1:3]) == bytes.fromhex('0018')
        if message.data[0] == 0x60 and is_tpdo:
            message = _with_data(message, b'\x80' + bytes(message.data[1:4]) + bytes.fromhex('22000008'))
        return [message]
    _disturb_configuration(bench, abort, 'object 0x1800', '0x08000022')


@fault()
def sdo_timeout_in_mid_configuration(bench: FaultBench) -> None:
    """The device falls silent amid its configuration: the object without an answer is reported, it is tried again."""
    _disturb_configuration(
        bench, lambda message: [] if bytes(message.data[1:3]) == bytes.fromhex('001A') else [message],
        'object 0x1A00 sub', 'No SDO response')


@fault()
def device_that_lies_about_its_mapping(bench: FaultBench) -> None:
    """It confirms each write and keeps another mapping: what was written and what is read back are reported."""
    _disturb_configuration(bench, _reads('43001A01', '10020020'), '0x1A00', '20000210')


@fault(queue_limit=100)
def queue_overrun(bench: FaultBench) -> None:
    """A consumer that hangs is reported as overload: frames are lost and counted, the device is left alone."""
    bench.heard()
    bench.hold.clear()
    bench.wait(lambda: bench.driver.statistics().queue_overruns > 50, 'not counted')
    bench.detect(Overload.BEHIND, Overload.DROPPED)
    bench.wait(lambda: bench.driver.statistics().queue_overruns > 1500, 'not counted')
    bench.end_of_cause()
    bench.hold.set()
    bench.recover()
    assert not [message for message in bench.heard() if message.arbitration_id in (0x000, 0x620)]
    assert not any(isinstance(fact, NodeFault) for fact in bench.log.facts)
    bench.wait(lambda: bench.driver.health().overload is Overload.NONE, 'it stays')


@fault()
def process_stalled(bench: FaultBench) -> None:
    """This process does not run for 1.2 s: that is reported, and the device, which was well, is left alone."""
    time.sleep(0.1)
    bench.heard()
    for _ in range(2):
        ctypes.PyDLL(None).usleep(1_200_000)  # keeps the interpreter's lock: no thread runs
        bench.end_of_cause()
        bench.detect(Overload.STALLED)
        bench.recover()
    assert not [message for message in bench.heard() if message.arbitration_id in (0x000, 0x620)]
    assert not any(isinstance(fact, NodeFault) for fact in bench.log.facts) and bench.node().outages.count == 0
    assert bench.driver.health().stalls >= 2


@fault()
def wall_clock_set_back(bench: FaultBench) -> None:
    """An hour back: the jump is counted and reported as WARN, stamps never go back, no TPDO is late for it."""
    _set_clock(bench, -3600.0)


@fault()
def wall_clock_set_forward(bench: FaultBench) -> None:
    """An hour on: the jump is counted and reported as WARN, stamps follow at once."""
    _set_clock(bench, 3600.0)


def _set_clock(bench: FaultBench, seconds: float) -> None:
    bench.is_clock_true = False
    real, time.time = time.time, lambda: real() + seconds
    try:
        bench.wait(lambda: bench.driver.statistics().clock_jumps == 1, 'not counted')
        bench.detected = time.monotonic() - bench._begun
        stamp = bench.kept[-1][1].stamp
        bench.wait(lambda: sum(frame.stamp > stamp and not frame.missing_can_frames
                               for _, frame in bench.kept[-20:]) > 5, 'no whole frames')
        ahead = bench.kept[-1][1].stamp - time.time()
        assert abs(ahead - max(-seconds, 0)) < 5
    finally:
        time.time = real


@fault(is_running=False)
def disk_full_while_recording(bench: FaultBench) -> None:
    """The recording ends with its reason logged, what it lacks is counted; the taxels continue."""
    with tempfile.TemporaryDirectory() as folder:
        bench.driver = Supervisor(replace(bench.settings, record=f'{folder}/x.log'), bench.pads, bench.keep)
        bench.run().cause()
        with open('/dev/full', 'wb') as full:
            os.dup2(full.fileno(), bench.driver._bus._record._file.writer.file.fileno())
        bench.detect(kind=lambda fact: isinstance(fact, OSError) and fact.errno == errno.ENOSPC)
        before = bench.driver.statistics().unrecorded
        bench.wait_for_whole('pad32', bench.kept[-1][1].stamp)
        bench.wait(lambda: bench.driver.statistics().unrecorded > before, 'not counted')
        assert sum(isinstance(fact, OSError) for fact in bench.log.facts) == 1
        assert bench.driver.failure is None and bench.adapter.opened == 1


@fault(is_running=False)
def fails_while_inactive(bench: FaultBench) -> None:
    """Bus and device are made ready again; activate then works as ever."""
    bench.driver.open()
    bench.driver.configure()
    bench.cause()
    bench.adapter.is_plugged = False
    bench.detect(BusFault.RECEPTION_FAILED, BusFault.SENDING_FAILED)
    bench.power_cycle()
    bench.adapter.is_plugged = True
    bench.end_of_cause()
    bench.wait(lambda: bench.driver.failure is None and bench.node().fault is NodeFault.NONE, 'not ready')
    assert not bench.kept
    bench.driver.start()
    bench.recover()
    assert bench.kept[0][1].sequence == 0


@fault()
def guarded_by_another_master(bench: FaultBench) -> None:
    """Node guarding: requests and answers with the toggle bit change no state, count as no boot, lose no taxel."""
    for answer in ('05', '85') * 50:
        bench.other.send(can.Message(arbitration_id=0x720, is_extended_id=False, is_remote_frame=True, dlc=1))
        bench.send(0x720, answer)
    bench.wait(lambda: bench.driver.statistics().can_frames.get('remote') == 100, 'not counted')
    bench.wait_for_whole('pad32', bench.kept[-1][1].stamp)
    assert not bench.complaints and (bench.node().state, bench.node().boots) == (NmtState.OPERATIONAL, 0)


@fault()
def other_makers_device_at_work(bench: FaultBench) -> None:
    """A busy device of another maker: its PDOs, SDOs, EMCY, boot-ups, its own SYNC and TIME disturb nothing."""
    theirs = ((0x185, '0102030405060708'), (0x285, 'FF'), (0x605, '4018100100000000'), (0x585, '4318100100000001'),
              (0x085, '0010010000000000'), (0x705, '00'), (0x705, '7F'), (0x090, ''), (0x100, '000000000000'),
              (0x205, '00'), (0x7E5, '0400000000000000'))
    for times in range(1, 101):
        for can_id, data in theirs:
            bench.send(can_id, data)
        # Else a busy interpreter, which the simulated device shares, would have ever more to do
        bench.wait(lambda: bench.driver.statistics().can_frames.get('time', 0) == times, 'not counted')  # noqa: B023
    bench.wait(lambda: bench.driver.statistics().can_frames.get('foreign', 0) == 400, 'not counted')
    bench.end_of_cause().recover()
    counts = bench.driver.statistics()
    assert (counts.can_frames['emcy'], counts.can_frames['time']) == (200, 100)  # 0x090 is in the range of EMCY
    assert not bench.complaints and bench.node().emergencies == 0
    bench.assert_no_outage()
    assert counts.pads['pad32'].losses[LossReason.UNKNOWN_ROW] == 0


@fault(is_running=False)
def refuses_operational_from_the_start(bench: FaultBench) -> None:
    """activate fails with an error that names which state the device is in; the bus stays open for another try."""
    bench.device.refuses_start = True
    bench.driver.open()
    bench.driver.configure()
    bench.adapter.tamper = _lists_errors
    bench.cause()
    try:
        bench.driver.start()
        raise AssertionError('start() is content')
    except DeviceError as error:
        assert error.expected == 'OPERATIONAL after NMT start' and 'PRE-OPERATIONAL' in error.got, error
        assert str(DeviceErrors(0x09, (0x0005_4210,))) in error.got, error
    bench.detected = time.monotonic() - bench._begun
    bench.device.refuses_start = False
    bench.end_of_cause()
    bench.driver.start()
    bench.recover()
    second = max(i for i, (_, frame) in enumerate(bench.kept) if frame.sequence == 0)
    assert all(np.isnan(frame.values).all() for _, frame in bench.kept[:second])
    del bench.kept[:second]  # with each start sequence numbers begin again


@fault()
def tare_under_load(bench: FaultBench) -> None:
    """A tare while something presses is refused with the taxel that is pressed most; the zero stays as it was."""
    pad, seen, outcome = TaredPad(ContactGuard.of_unit('N')), len(bench.kept), []

    def tare() -> None:
        try:
            pad.tare(10, 0.5, TIMEOUT)
        except TareRefusedError as error:
            outcome.append(str(error))
    asking = threading.Thread(target=tare)
    asking.start()
    while asking.is_alive():
        for _, frame in bench.kept[seen:]:
            pad.feed(frame)
            seen += 1
        asking.join(0.01)
    bench.detected = time.monotonic() - bench._begun
    last = 63  # Coded: the last taxel reads most
    assert f'row {last // 8}, column {last % 8}' in outcome[0] and pad.offset is None


@fault((32, 35), source=uniform(1, 100, 1000, 12, 8), layout='nodes2_12x8_12bit.yaml')
def one_of_a_pads_nodes_lost(bench: FaultBench) -> None:
    """Of a pad made of two nodes, only the lost one's taxels are NaN; it is reported, and used again when it boots."""
    second = bench.simulator.devices[35]
    values = _switch_off(bench, second, 12, NodeFault.SILENT).values
    first, lost = bench.driver.health().nodes['pad32']
    assert (lost.node_id, lost.fault, first.fault) == (35, NodeFault.SILENT, NodeFault.NONE)
    assert np.isfinite(values[:6]).all() and np.isnan(values[6:]).all()
    _switch_on(bench, second)


@fault(source=uniform(2, 100, 1000, 16, 10), layout='domain16x10_16bit.yaml')
def polled_pad_power_cycled(bench: FaultBench) -> None:
    """A pad read by SDO block upload: its polls fail, are counted and reported; it is configured again as it boots."""
    _switch_off(bench, bench.device, 1,
                kind=lambda fact: isinstance(fact, (SdoAbortedError, SdoCommunicationError)))
    _switch_on(bench, bench.device)


@fault(source=uniform(3, 100, 1000, 16, 10), layout='domain16x10_16bit.yaml')
def polled_uploads_damaged(bench: FaultBench) -> None:
    """Segments of the uploads are damaged on the bus: the CRC reveals it, those frames are NaN, no value is wrong."""
    count = itertools.count()

    def damage(message: can.Message) -> list[can.Message]:
        if message.arbitration_id == 0x5A0 and message.data[0] < 0x80 and next(count) % 100 == 0:
            data = bytearray(message.data)
            data[5] ^= 1
            message = _with_data(message, bytes(data))
        return [message]
    bench.adapter.tamper = damage
    bench.detect(kind=lambda fact: isinstance(fact, SdoCommunicationError) and 'CRC' in str(fact))
    bench.wait(lambda: bench.driver.statistics().pads['pad32'].losses[LossReason.BROKEN] > 5, 'not counted')
    bench.repair()
    scale, values = bench.pads[0].layout.value.scale, bench.source(0.0)
    for _, frame in bench.kept:
        assert np.isnan(frame.values).all() or np.abs(frame.values - values).max() <= 0.5 * scale + 1e-3


@fault((32, 64), source=uniform(4, 1e3, 9e4, 16, 16), layout='sim16x16.yaml')
def adapter_of_two_large_pads_unplugged(bench: FaultBench) -> None:
    """Two pads of 16x16 taxels, 64 TPDOs to be checked again: both are back."""
    bench.wait_for_whole('pad64')
    bench.adapter.is_plugged = False
    bench.detect(BusFault.RECEPTION_FAILED, BusFault.SENDING_FAILED)
    bench.repair('pad32', 'pad64')


@fault((32, 64), source=uniform(4, 1e3, 9e4, 16, 16), layout='sim16x16.yaml')
def two_large_pads_power_cycled(bench: FaultBench) -> None:
    """Two pads of 16x16 taxels lose their supply together: 64 TPDOs are written again."""
    bench.wait_for_whole('pad64')
    for device in bench.simulator.devices.values():
        device.power_off()
    for device in bench.simulator.devices.values():
        device.boot()
    bench.end_of_cause().detect(NodeFault.BOOTED)
    bench.recover('pad32', 'pad64')


FAULTS += [stall(part, seconds) for seconds in (0.3, 2.0) for part in STALLING]
LONG_FAULTS = [stall(part, seconds) for seconds in (1.0, 5.0, 10.0, 30.0) for part in STALLING]
#: Those that `make test` injects, one for each mechanism, and why it is this one; `make faults` injects all.
ESSENTIAL = {
    'power_cycled_in_mid_stream': 'BOOTED: the boot-up message starts the recovery',
    'absent_at_configure_then_late': 'DeviceAbsentError: configure waits',
    'one_of_two_pads_lost': 'SILENT, while the other pad goes on',
    'boot_up_message_lost': 'a device that sends nothing is found by a request',
    'another_device_comes_back': 'the identity is checked, the taxels are distrusted',
    'stopped_by_another_master': 'ForeignCommand, from any master',
    'refuses_operational': 'NOT_OPERATIONAL that stays, with DeviceErrors',
    'adapter_unplugged': 'RECEPTION_FAILED: the bus is opened again',
    'sending_fails': 'SENDING_FAILED, while reception works',
    'bus_off': 'BUS_OFF, by an error frame',
    'heartbeat_switched_off_by_another_master': 'NO_HEARTBEAT, repaired while the taxels flow',
    'taxels_lost_while_heartbeat_flows': 'NO_TAXELS',
    'tpdo_remapped_by_another_master': 'RECONFIGURED, by a write that was seen',
    'one_tpdo_switched_off_unseen': 'TPDO_MISSING, repaired while the others flow',
    'two_devices_from_the_start': 'TwoDevicesError, by two SDO answers',
    'second_sender_of_a_tpdo': 'TWO_SENDERS, by surplus TPDOs',
    'second_sync_producer': 'SECOND_PRODUCER',
    'sync_producer_of_another_period': 'OTHER_PERIOD',
    'sync_of_another_producer_stops': 'NO_SYNC',
    'emcy_until_it_is_reset': 'Emergency, from its begin to its reset',
    'tpdos_duplicated': 'LossReason.DUPLICATE',
    'tpdos_reordered': 'LossReason.OUT_OF_ORDER',
    'short_tpdos': 'LossReason.SHORT',
    'over_long_tpdos': 'LossReason.OVER_LONG',
    'sdo_aborted_in_configuration': 'DeviceError: a write that the device refuses',
    'queue_overrun': 'BEHIND and DROPPED',
    'wall_clock_set_back': 'the stamps go on while the wall clock goes back',
    'polled_uploads_damaged': 'LossReason.BROKEN, of a polled pad',
    'adapter_stalls_for_0.3_s': 'LossReason.LATE: a backlog of one device',
    'driver_stalls_for_2_s': 'STALLED: the driver blames no node'}


class Beside:
    """A process that only sleeps: how late it wakes up shows whether the machine keeps up. Use with ``with``."""

    PROGRAM = ('import select, sys, time\n'
               'worst = 0.0\n'
               'while True:\n'
               '    before = time.monotonic()\n'
               '    is_asked = select.select([sys.stdin], [], [], 0.005)[0]\n'
               '    worst = max(worst, time.monotonic() - before - 0.005)\n'
               '    if is_asked:\n'
               '        if not sys.stdin.readline():\n'
               '            break\n'
               '        print(worst, flush=True)\n'
               '        worst = 0.0\n')

    def __enter__(self) -> 'Beside':
        self._process = subprocess.Popen([sys.executable, '-c', self.PROGRAM], text=True, stdin=subprocess.PIPE,
                                         stdout=subprocess.PIPE)
        return self

    def __exit__(self, *_: object) -> None:
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()

    def latest(self) -> float:
        """Return by how much it woke up late at worst since the last call [s]."""
        print(file=self._process.stdin, flush=True)
        return float(self._process.stdout.readline())


def main(names: list[str]) -> int:
    """Print the catalogue, or those of it with these ``names``, each injected now.

    Returns 1 if taxels came too late or a duration was wrong, unless the machine did not keep up meanwhile.
    """
    listed = {each.__name__: each for each in FAULTS + LONG_FAULTS}
    if not listed.keys() >= set(names):
        sys.exit(f'Expected names of faults, got {", ".join(set(names) - listed.keys())}. There are:\n'
                 + '\n'.join(listed))
    chosen = [listed[name] for name in names] or list(listed.values())
    print(f'{"fault":42} {"logged [s]":>10} {"again [s]":>9}  what the user sees')
    failed, not_measured = [], []
    with Beside() as beside:
        for each in chosen:
            beside.latest()
            try:
                bench = each(f'catalogue {each.__name__}')
            except TooSlowError as error:
                not_measured.append(each.__name__)
                print(f'{each.__name__.replace("_", " "):42} this machine did not keep up: {error}', flush=True)
                continue
            late = beside.latest()
            times = [f'{time:.2f}' if time is not None else '-' for time in (bench.detected, bench.publishing_again)]
            print(f'{each.__name__.replace("_", " "):42} {times[0]:>10} {times[1]:>9}  {each.__doc__}', flush=True)
            wrong = [*bench.wrong_durations, *(['taxels too late'] if (bench.publishing_again or 0) > ALLOWED else [])]
            if wrong and (late > KEEPS_UP or is_overloaded()):
                not_measured.append(each.__name__)
                print(f'{"":42} this machine did not keep up: {", ".join(wrong)}; a process beside it woke up '
                      f'{late:.3f} s late, load average {os.getloadavg()[0]:.1f}', flush=True)
            elif wrong:
                failed.append(f'{each.__name__} ({", ".join(wrong)})')
    print(f'{len(chosen)} faults, taxels again within {ALLOWED:g} s'
          + (f', but for {", ".join(failed)}' if failed else '')
          + (f'; this machine did not keep up with {", ".join(not_measured)}' if not_measured else ''))
    return int(bool(failed))


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
