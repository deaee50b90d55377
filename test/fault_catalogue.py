"""The faults that a driver meets on a factory floor.

Each function injects one fault, and its docstring states what the user sees.

`python test/fault_catalogue.py [NAME ...]` injects the faults and prints a table with the measured times. Every
FaultBench also checks at its end that all valid taxels were correct, and that no sequence number or stamp occurred
twice.
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

from tactile_node.assembly.facts import LossReason
from tactile_node.assembly.health import BusFault, ForeignCommand, NodeFault, Overload, SentTpdo, SyncFault
from tactile_node.cia301.emergency import DeviceErrors, Emergency
from tactile_node.cia301.objects import NmtState
from tactile_node.conditioning.tare import ContactGuard
from tactile_node.conditioning.tared_pad import TaredPad
from tactile_node.errors import BusError, DeviceAbsentError, DeviceError, TareRefusedError, TwoDevicesError
from tactile_node.simulator.device import SimulatedDevice
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.sources.supervisor import Supervisor
from tactile_node.taxel_frame import TaxelFrame

ALLOWED = 1.0  # time limit from the end of the cause until taxels are published again [s]
KEEPS_UP = 0.02  # largest wake-up delay of a sleeping process while the machine keeps up [s]
ALL_TPDOS = range(1, 17)  # TPDO numbers of the pad of 8x8 taxels
COB_IDS = [0x1A0 + 0x100 * (i // 4) + i % 4 for i in range(16)]
FAULTS: list[Callable[[str], FaultBench | StallBench]] = []


def fault(*nodes: tuple[int, ...], is_running: bool = True, **settings: Any) -> Callable:
    """Add a fault to the catalogue.

    The decorated function injects the fault into a bench, by default with a running driver.
    """
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
    """Return a source of random taxel values that do not change with time."""
    values = np.random.default_rng(seed).uniform(low, high, (rows, cols))
    return lambda _time: values


def _switch_off(bench: FaultBench, device: SimulatedDevice, missing: int, *faults: object, **kind: Any) -> TaxelFrame:
    """Switch ``device`` off, wait for a logged fault, and return the next frame that lacks ``missing`` TPDOs."""
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
    """The driver configures and starts the device again, logs the restart, and counts the outage."""
    bench.power_cycle()
    bench.end_of_cause().detect(NodeFault.BOOTED)
    bench.recover()
    bench.wait(lambda: bench.node().outages == 1 and bench.node().boots == 1, 'outage not counted')


@fault()
def absent_then_back(bench: FaultBench) -> None:
    """The driver reports the device as silent and publishes NaN. The driver uses the device again after its boot."""
    _switch_off(bench, bench.device, 16, NodeFault.SILENT)
    _switch_on(bench, bench.device)


@fault(is_running=False)
def absent_at_configure_then_late(bench: FaultBench) -> None:
    """During configure, the driver logs the absent device, and continues when this device answers."""
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
    """The driver reports only the lost pad as silent. The other pad continues without losing a frame."""
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
    """The boot-up message is lost. The driver finds the silent device through a request and configures it."""
    bench.adapter.lost_ids = {0x720}
    bench.power_cycle()
    bench.wait(lambda: bytes(1) in bench.adapter.lost, 'boot-up not lost')
    bench.adapter.lost_ids = set()
    # The fault is SILENT if taxels are missing as well.
    bench.end_of_cause().detect(NodeFault.NO_HEARTBEAT, NodeFault.SILENT)
    bench.recover()


@fault()
def another_device_comes_back(bench: FaultBench) -> None:
    """The driver refuses a device of another vendor, reports its identity, and publishes NaN for its taxels."""
    bench.device.power_off()
    bench.device.lie(0x1018, 1, (0x99).to_bytes(4, 'little'))
    bench.device.boot()
    bench.detect(kind=lambda fact: isinstance(fact, DeviceError) and '0x1018' in fact.where and '0x99' in fact.got)
    used, seen = bench.driver.facts().pad('pad32').tpdos_used, len(bench.kept)
    bench.send(0x620, '23001801A0010000')  # another master enables the device's TPDO 1
    bench.wait(lambda: bench.send(0x000, '0120') or bench.driver.facts().pad('pad32').tpdos_used > used,
               'it does not send')
    bench.wait(lambda: len(bench.kept) > seen + 2, 'no frames')
    assert all(np.isnan(frame.values).all() for _, frame in bench.kept[seen:])
    assert bench.node().fault.is_fault and bench.node().frames_distrusted > 0
    bench.device.power_off()
    _switch_on(bench, bench.device)


def _command(bench: FaultBench, command: ForeignCommand) -> None:
    bench.send(0x000, bytes(command).hex())
    bench.end_of_cause().detect(command)
    bench.recover()
    facts = bench.driver.facts()
    assert (facts.foreign_nmt_commands, facts.foreign_nmt_last) == (1, command) and bench.node().outages <= 1


@fault()
def reset_by_another_master(bench: FaultBench) -> None:
    """The driver reports the other master's command, then configures and starts the device again."""
    _command(bench, ForeignCommand(0x81, 32))


@fault()
def all_reset_by_another_master(bench: FaultBench) -> None:
    """The driver reports the reset of all nodes, and recovers as it does after the reset of a single node."""
    _command(bench, ForeignCommand(0x82, 0))


@fault()
def stopped_by_another_master(bench: FaultBench) -> None:
    """The driver reports the command and the state STOPPED, and starts the device again."""
    _command(bench, ForeignCommand(0x02, 32))
    assert NodeFault.NOT_OPERATIONAL in bench.log.facts


def _lists_errors(message: can.Message) -> list[can.Message]:
    """Return the message, or the response of an overheated device (register 0x09, error 0x4210, maker 0x0005)."""
    answers = {'011000': '4F01100009000000', '031000': '4F03100001000000', '031001': '4303100110420500'}
    answer = answers.get(bytes(message.data[1:4]).hex()) if message.arbitration_id == 0x5A0 else None
    return [message if answer is None else _with_data(message, bytes.fromhex(answer))]


@fault()
def refuses_operational(bench: FaultBench) -> None:
    """While a device stays PRE-OPERATIONAL, /diagnostics reports an error and lists the errors of the device."""
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
    """The driver reports the failed bus and the reason, reopens the bus until it works, and counts the outage."""
    bench.adapter.is_plugged = False
    bench.detect(BusFault.RECEPTION_FAILED, BusFault.SENDING_FAILED)
    bench.wait(lambda: any(isinstance(fact, BusError) and fact.got == 'no such device' for fact in bench.log.facts),
               'does not log what it waits for')
    assert bench.driver.failure.fault in (BusFault.RECEPTION_FAILED, BusFault.SENDING_FAILED)
    bench.repair()
    bench.wait(lambda: bench.driver.failure is None, 'failure stays')
    assert bench.driver.facts().outages == bench.node().outages == 1


@fault()
def sending_fails(bench: FaultBench) -> None:
    """If the driver cannot send on the bus, it reopens the bus until sending works again."""
    bench.adapter.can_send = False
    bench.detect(BusFault.SENDING_FAILED)
    assert 'Transmit buffer full' in bench.driver.failure.detail
    bench.wait(lambda: bench.adapter.opened > 3, 'the bus is not tried again')
    bench.repair()


@fault()
def bus_off(bench: FaultBench) -> None:
    """The driver reports the controller's error frame as bus-off, and reopens the bus."""
    bench.send_error(0x040, bytes(8))
    bench.end_of_cause().detect(BusFault.BUS_OFF)
    bench.recover()
    assert bench.adapter.opened == 2


@fault()
def error_frames(bench: FaultBench) -> None:
    """The driver counts error frames, and reports error-passive while that state lasts. The taxels continue."""
    for flags in (0x30, 0x10):
        bench.send_error(0x004, [0, flags, 0, 0, 0, 0, 9, 130])
    bench.wait(lambda: bench.driver.facts().error_passive, 'not reported')
    bench.wait(lambda: bench.driver.facts().rx_error_count == 130, 'receive errors not reported')
    assert bench.driver.facts().tx_error_count == 9
    bench.wait(lambda: bench.driver.facts().can_frames['error'] == 2, 'not counted')
    bench.send_error(0x004, [0, 0x40, 0, 0, 0, 0, 0, 0])
    bench.wait(lambda: not bench.driver.facts().error_passive, 'it stays')
    bench.wait_for_whole('pad32', bench.kept[-1][1].stamp)
    assert bench.driver.failure is None
    bench.assert_no_outage()


@fault()
def heartbeat_lost_while_taxels_flow(bench: FaultBench) -> None:
    """The driver reports the missing heartbeat. No taxel is lost, and no outage is counted."""
    bench.adapter.lost_ids = {0x720}
    bench.detect(NodeFault.NO_HEARTBEAT)
    bench.wait_for_whole('pad32', bench.kept[-1][1].stamp)
    bench.repair()
    bench.assert_no_outage()


@fault()
def heartbeat_switched_off_by_another_master(bench: FaultBench) -> None:
    """The driver reports the missing heartbeat and switches it on again. No taxel is lost."""
    bench.send(0x620, '2B17100000000000')  # 0x1017 = 0
    bench.end_of_cause().detect(NodeFault.NO_HEARTBEAT)
    bench.recover()
    bench.assert_no_outage()


@fault()
def taxels_lost_while_heartbeat_flows(bench: FaultBench) -> None:
    """The driver reports that the node is OPERATIONAL but sends no taxels."""
    bench.adapter.lost_ids = set(COB_IDS)
    bench.detect(NodeFault.NO_TAXELS)
    bench.repair()
    bench.wait(lambda: bench.node().outages == 1, 'outage not counted')


def _write(bench: FaultBench, *requests: str) -> None:
    for request in requests:
        bench.send(0x620, request)
        time.sleep(0.005)
    bench.end_of_cause().detect(NodeFault.RECONFIGURED)
    bench.recover()


@fault()
def tpdos_switched_off_by_another_master(bench: FaultBench) -> None:
    """The driver reports the missing taxels, and writes the configuration again."""
    _write(bench, *(f'23{number - 1:02X}1801{can_id & 0xFF:02X}{can_id >> 8:02X}0080'
                    for number, can_id in zip(ALL_TPDOS, COB_IDS)))


@fault()
def tpdo_remapped_by_another_master(bench: FaultBench) -> None:
    """Another master swaps taxels in TPDO 1. The driver publishes no wrong taxel, and restores the mapping."""
    _write(bench, '23001801A0010080',                                      # switch TPDO 1 off
           '2F001A0000000000', '23001A0110043071', '23001A0210033071',     # sub-indices 4 and 3 instead of 1 and 2
           '23001A0310023071', '23001A0410013071', '2F001A0004000000', '23001801A0010000')
    assert bench.node().frames_distrusted > 0


@fault()
def tpdo_slowed_down_by_another_master(bench: FaultBench) -> None:
    """Another master makes TPDO 1 answer only every second SYNC. The driver reports and restores TPDO 1."""
    _write(bench, '2F00180202000000')


@fault()
def one_tpdo_switched_off_by_another_master(bench: FaultBench) -> None:
    """One of sixteen TPDOs is off. The driver reports the TPDO and switches it on. The other TPDOs continue."""
    _write(bench, '23021801A2010080')


@fault()
def one_tpdo_switched_off_unseen(bench: FaultBench) -> None:
    """One TPDO was switched off while the driver could not see it. The driver names the TPDO and switches it on."""
    bench.adapter.lost_ids = {0x620}
    bench.send(0x620, '23021801A2010080')
    bench.wait(lambda: NodeFault.TPDO_MISSING in bench.log.facts or bench.node().outages, 'not logged')
    bench.assert_no_outage()  # recovery from an outage would have switched the TPDO on as well
    bench.detect(NodeFault.TPDO_MISSING)
    # The repair starts with the report, because the driver does not know of the fault any earlier.
    bench.end_of_cause().recover()
    bench.assert_no_outage()
    assert NodeFault.RECONFIGURED not in bench.log.facts


@fault()
def one_tpdo_never_arrives(bench: FaultBench) -> None:
    """A configured TPDO never arrives. The driver names the TPDO, and checks it less and less often."""
    bench.adapter.lost_ids = {0x1A2}
    bench.detect(NodeFault.TPDO_MISSING)
    assert bench.node().missing_tpdos == (SentTpdo(3, 0x1A2),)
    checks: list[float] = []

    def has_checked(times: int) -> bool:
        checks.extend(message.timestamp for message in bench.heard()
                      if message.arbitration_id == 0x620 and message.data[:4] == bytes.fromhex('40181003'))
        return len(checks) >= times
    bench.wait(lambda: has_checked(5), 'not asked again')
    pauses = np.diff(checks)  # the pauses grow to at least 0.1, 0.2, 0.4 ... s, even on a busy machine
    assert (pauses[1:4] >= 0.1 * 2.0 ** np.arange(3)).all(), pauses
    bench.assert_no_outage()
    assert bench.node().fault is NodeFault.TPDO_MISSING
    bench.repair()


def _one_of_two_devices(bench: FaultBench, since: int) -> None:
    """Assert that all values published from frame ``since`` on are NaN."""
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
    """A second device has our node-ID. The driver publishes no value while both send, and commands neither device."""
    second = _second_device(bench)
    bench.detect(NodeFault.TWO_SENDERS)
    seen = len(bench.kept)
    bench.send(0x000, '0120')  # another master starts both devices
    bench.wait(lambda: all(one.devices[32].operational for one in (bench.simulator, second)), 'not started')
    bench.heard()
    time.sleep(3.0)
    assert bench.node().fault is NodeFault.TWO_SENDERS
    assert not [message for message in bench.heard() if message.arbitration_id in (0x000, 0x620)]
    assert all(one.devices[32].operational for one in (bench.simulator, second))
    _one_of_two_devices(bench, seen)
    second.stop()
    _alone_again(bench)  # at the end, the bench checks that every valid value came from the first device


@fault(is_running=False)
def two_devices_from_the_start(bench: FaultBench) -> None:
    """Two devices answer during configure. The driver names the node and refuses to start."""
    second = _second_device(bench)
    bench.cause()
    bench.driver.open()
    is_content = True
    try:
        bench.driver.configure()
    except TwoDevicesError as error:
        is_content = False
        assert 'node 32' in error.where
    bench.detected = time.monotonic() - bench._begun
    heard = bench.heard()
    requests = sum(message.arbitration_id == 0x620 and message.data[0] != 0x80 for message in heard)
    if is_content:
        # on a busy machine, the second device may answer only after the driver has configured the first one
        answers = sum(message.arbitration_id == 0x5A0 for message in heard)
        raise (TooSlowError if answers < 2 * requests - 1 else AssertionError)(
            f'configure() is content, with {answers} answers to {requests} requests')
    bench.wait(lambda: bench.driver.facts().can_frames.get('sdo', 0) >= 2 * requests,
               # The driver would mistake a late response for the response to its next request for this object.
               'not answered by both')
    second.stop()
    bench.end_of_cause()
    bench.driver.configure()
    bench.driver.start()
    bench.recover()


@fault()
def second_sender_of_a_tpdo(bench: FaultBench) -> None:
    """Another node sends on one of our COB-IDs. The driver names the COB-ID, and publishes no value while both send."""
    sender = bench.repeat(0x1A2, 0.017, bytes(8))
    bench.detect(NodeFault.TWO_SENDERS)
    assert bench.node().surplus_tpdos == (SentTpdo(3, 0x1A2),)
    recognised = len(bench.kept)
    _one_of_two_devices(bench, recognised + 1)
    sender.stop()
    del bench.kept[:recognised + 1]  # earlier frames may contain values of the other node
    _alone_again(bench)


@fault()
def replaced_by_two_devices(bench: FaultBench) -> None:
    """Two devices with our node-ID appear after a silence. The driver reports two senders and publishes NaN."""
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
    """Another device with our node-ID sends heartbeats. The driver reports two senders and publishes no value."""
    sender = bench.repeat(0x720, 0.1, b'\x05')
    bench.detect(NodeFault.TWO_SENDERS)
    assert bench.node().surplus_tpdos == ()
    _one_of_two_devices(bench, len(bench.kept) + 1)
    sender.stop()
    _alone_again(bench)


@fault()
def two_masters_fight(bench: FaultBench) -> None:
    """Another master keeps switching a TPDO off. The driver reports and repairs the TPDO less and less often."""
    bench.send(0x620, '23021801A2010080')
    bench.detect(NodeFault.RECONFIGURED)
    for _ in range(40):
        bench.send(0x620, '23021801A2010080')
        time.sleep(0.1)
    assert bench.node().outages < 10 and sum(fact is NodeFault.RECONFIGURED for fact in bench.log.error_facts) < 4
    bench.wait(lambda: bench.node().fault is NodeFault.NONE, 'given up')
    bench.end_of_cause().recover()


@fault()
def second_sync_producer(bench: FaultBench) -> None:
    """Another device also sends SYNC. The driver reports a second producer while both send."""
    bench.is_clock_true = False  # taxels that were sampled at the other SYNC get the stamp of our SYNC
    producer = bench.repeat(0x080, 0.05)
    bench.detect(SyncFault.SECOND_PRODUCER)
    assert bench.driver.facts().sync_fault is SyncFault.SECOND_PRODUCER and bench.driver.facts().foreign_syncs > 0
    time.sleep(2.0)
    # A TPDO that answers the other SYNC does not prove a second sender.
    assert NodeFault.TWO_SENDERS not in bench.log.facts
    producer.stop()
    bench.end_of_cause().recover()
    bench.wait(lambda: bench.driver.facts().sync_fault is SyncFault.NONE, 'fault stays')


@fault(produce_sync=False, sync_period=0.02, is_running=False)
def sync_producer_of_another_period(bench: FaultBench) -> None:
    """The SYNC period differs from sync_period. The driver reports both periods. The taxels continue."""
    producer = bench.repeat(0x080, 0.04)
    bench.run().cause()
    bench.detect(SyncFault.OTHER_PERIOD)
    period = bench.driver.facts().sync_period
    bench.wrong_durations += [] if abs(period - 0.04) < 0.01 else [f'a period of {period:.3f} s']
    producer.stop()
    bench.repeat(0x080, 0.02)
    bench.end_of_cause().recover()
    bench.wait(lambda: bench.driver.facts().sync_fault is SyncFault.NONE, 'fault stays')


@fault()
def transmission_type_ignored(bench: FaultBench) -> None:
    """A device confirms a transmission type but keeps the old one. The driver refuses the device to avoid losses."""
    _disturb_configuration(bench, _reads('4F001802', '02000000'), '0x1800 sub 2', '0x02')


@fault(produce_sync=False, is_running=False)
def sync_of_another_producer_stops(bench: FaultBench) -> None:
    """The driver reports that SYNC is missing, and sends the device no command."""
    producer = bench.repeat(0x080, 0.02)
    bench.run().cause()
    producer.stop()
    bench.detect(NodeFault.NO_SYNC)
    assert bench.node().operational
    bench.repeat(0x080, 0.02)
    bench.end_of_cause().recover()


@fault()
def emcy_storm(bench: FaultBench) -> None:
    """The driver reports the first EMCY decoded, counts all EMCYs, reports few, and keeps the last. Taxels continue."""
    for i in range(2000):
        bench.send(0x0A0, f'1042 09 {i:010X}')
    bench.detect(kind=lambda fact: isinstance(fact, Emergency) and (fact.code, fact.register) == (0x4210, 0x09))
    bench.wait(lambda: bench.node().emcy_count == 2000, 'not all counted')
    bench.wait_for_whole('pad32', bench.kept[-1][1].stamp)
    assert bench.emcy_last.manufacturer[-1] == 1999 & 0xFF
    assert sum(isinstance(fact, Emergency) for fact in bench.log.error_facts) < 10


@fault()
def short_emcy(bench: FaultBench) -> None:
    """The driver reports the fields that an incomplete EMCY contains."""
    for data in ('', '10', '1042', '104209'):
        bench.send(0x0A0, data)
    bench.wait(lambda: bench.node().emcy_count == 4, 'not counted')
    bench.detect(kind=lambda fact: isinstance(fact, Emergency))
    assert (bench.emcy_last.code, bench.emcy_last.register) == (0x4210, 9)
    bench.wait_for_whole('pad32', bench.kept[-1][1].stamp)


@fault()
def emcy_until_it_is_reset(bench: FaultBench) -> None:
    """A warning about an error remains until the device resets this error or all errors, or boots again."""

    def has(code: int | None, count: int) -> None:
        bench.wait(lambda: bench.node().emcy_count == count, 'not counted')
        active = bench.node().emcy_active
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
    """Foreign devices, node guarding with its toggle bit, and empty heartbeats have no effect."""
    for can_id, data in ((0x555, '01'), (0x720, '85'), (0x720, ''), (0x733, '00'), (0x0B3, '10'), (0x000, '01'),
                         (0x000, '0133'), (0x000, '')):
        bench.send(can_id, data)
    bench.other.send(can.Message(arbitration_id=0x720, is_extended_id=False, is_remote_frame=True))
    bench.other.send(can.Message(arbitration_id=0x1A0, is_extended_id=True, data=bytes(8)))
    bench.wait(lambda: bench.driver.facts().can_frames.get('foreign') == 2, 'not counted')
    bench.wait_for_whole('pad32', bench.kept[-1][1].stamp)
    assert not bench.complaints and (bench.node().state, bench.node().fault) == (
        NmtState.OPERATIONAL, NodeFault.NONE)


@fault((32, 64), boot_timeout=0.3, is_running=False)
def absent_pad_of_two(bench: FaultBench) -> None:
    """One pad is absent, the other works. The driver reports the absent pad, and uses it as soon as it boots."""
    bench.simulator.devices[64].power_off()
    bench.cause()
    bench.run()
    bench.detect(kind=lambda fact: isinstance(fact, DeviceAbsentError) and 'node 64' in fact.where)
    bench.wait(lambda: bench.node('pad64').fault.is_fault, 'fault not reported')
    assert all(np.isnan(frame.values).all() for name, frame in bench.kept if name == 'pad64')
    bench.simulator.devices[64].boot()
    bench.end_of_cause().recover('pad64')


def _tamper(bench: FaultBench, tamper: Callable, seen: Callable[[FaultBench], int]) -> None:
    """Pass all TPDOs through ``tamper`` until ``seen`` returns at least 20, and then end the fault."""
    bench.adapter.tamper = lambda message: tamper(message) if message.arbitration_id in COB_IDS else [message]
    bench.wait(lambda: seen(bench) >= 20, 'not counted')
    bench.detected = time.monotonic() - bench._begun
    bench.repair()
    bench.assert_no_outage()


def _pad(bench: FaultBench):
    return bench.driver.facts().pad('pad32')


@fault()
def tpdos_lost(bench: FaultBench) -> None:
    """Every seventh TPDO is lost. The lost taxels are NaN and STALE. The driver counts the missing TPDOs and warns."""
    numbers = itertools.count()
    _tamper(bench, lambda message: [message] if next(numbers) % 7 else [], lambda bench: _pad(bench).missing)


@fault()
def tpdos_duplicated(bench: FaultBench) -> None:
    """Each TPDO arrives twice. The driver drops and counts the second TPDO as a duplicate. The taxels continue."""
    _tamper(bench, lambda message: [message, message],
            lambda bench: _pad(bench).losses[LossReason.DUPLICATE])


@fault()
def tpdos_reordered(bench: FaultBench) -> None:
    """Pairs of TPDOs arrive in the wrong order. The driver drops the TPDOs of these sweeps as out of order."""
    held: list[can.Message] = []

    def exchange(message: can.Message) -> list[can.Message]:
        held.append(message)
        return [held.pop(), held.pop()] if len(held) == 2 else []
    _tamper(bench, exchange, lambda bench: _pad(bench).losses[LossReason.OUT_OF_ORDER])


@fault()
def short_tpdos(bench: FaultBench) -> None:
    """A TPDO is one byte too short. The driver drops the TPDO as short, and its taxels are NaN."""
    def cut(message: can.Message) -> list[can.Message]:
        return [_with_data(message, message.data[:-1])] if message.arbitration_id == COB_IDS[3] else [message]
    _tamper(bench, cut, lambda bench: _pad(bench).losses[LossReason.SHORT])


@fault()
def over_long_tpdos(bench: FaultBench) -> None:
    """A TPDO is longer than its mapping and than CAN allows. The driver drops the TPDO as over-long and continues."""
    def lengthen(message: can.Message) -> list[can.Message]:
        return [_with_data(message, message.data + b'1')] if message.arbitration_id == COB_IDS[3] else [message]
    _tamper(bench, lengthen, lambda bench: _pad(bench).losses[LossReason.OVER_LONG])


def _with_data(message: can.Message, data: bytes) -> can.Message:
    return can.Message(timestamp=message.timestamp, arbitration_id=message.arbitration_id, is_extended_id=False,
                       data=data, dlc=len(data), check=False)


def _disturb_configuration(bench: FaultBench, tamper: Callable[[can.Message], list], where: str, got: str) -> None:
    """Restart the device with its SDO responses passing through ``tamper``, and check that all taxels are NaN."""
    bench.adapter.tamper = lambda message: tamper(message) if message.arbitration_id == 0x5A0 else [message]
    bench.power_cycle()
    bench.detect(kind=lambda fact: isinstance(fact, DeviceError) and where in fact.where and got in fact.got)
    seen = len(bench.kept)
    bench.wait(lambda: len(bench.kept) > seen + 2, 'no frames')
    assert all(np.isnan(frame.values).all() for _, frame in bench.kept[seen:])
    bench.repair()


def _reads(answer: str, value: str) -> Callable[[can.Message], list[can.Message]]:
    """Return a function that replaces the value in each SDO response beginning with the bytes ``answer``."""
    def tamper(message: can.Message) -> list[can.Message]:
        is_meant = bytes(message.data[:4]) == bytes.fromhex(answer)
        return [_with_data(message, bytes.fromhex(answer + value)) if is_meant else message]
    return tamper


@fault()
def sdo_aborted_in_configuration(bench: FaultBench) -> None:
    """The device refuses a write. The driver reports object and abort code, and retries until the write succeeds."""
    def abort(message: can.Message) -> list[can.Message]:  # CiA 301: 0x60 confirms a download, and 0x80 aborts it
        is_tpdo = bytes(message.data[1:3]) == bytes.fromhex('0018')
        if message.data[0] == 0x60 and is_tpdo:
            message = _with_data(message, b'\x80' + bytes(message.data[1:4]) + bytes.fromhex('22000008'))
        return [message]
    _disturb_configuration(bench, abort, 'object 0x1800', '0x08000022')


@fault()
def sdo_timeout_in_mid_configuration(bench: FaultBench) -> None:
    """The device goes silent during configuration. The driver reports the object that got no response, and retries."""
    _disturb_configuration(
        bench, lambda message: [] if bytes(message.data[1:3]) == bytes.fromhex('001A') else [message],
        'object 0x1A00 sub', 'No SDO response')


@fault()
def device_that_lies_about_its_mapping(bench: FaultBench) -> None:
    """The device confirms each write but keeps another mapping. The driver reports the written and the read value."""
    _disturb_configuration(bench, _reads('43001A01', '10020020'), '0x1A00', '20000210')


@fault(queue_limit=100)
def queue_overrun(bench: FaultBench) -> None:
    """A consumer hangs. The driver reports an overload, counts lost CAN frames, and sends the device no command."""
    bench.heard()
    bench.hold.clear()
    bench.wait(lambda: bench.driver.facts().queue_overruns > 50, 'not counted')
    bench.detect(Overload.BEHIND, Overload.DROPPED)
    bench.wait(lambda: bench.driver.facts().queue_overruns > 1500, 'not counted')
    bench.end_of_cause()
    bench.hold.set()
    bench.recover()
    assert not [message for message in bench.heard() if message.arbitration_id in (0x000, 0x620)]
    assert not any(isinstance(fact, NodeFault) for fact in bench.log.facts)
    bench.wait(lambda: bench.driver.facts().overload is Overload.NONE, 'it stays')


@fault()
def process_stalled(bench: FaultBench) -> None:
    """The driver process stalls for 1.2 s. The driver reports the stall, and sends the healthy device no command."""
    time.sleep(0.1)
    bench.heard()
    for _ in range(2):
        ctypes.PyDLL(None).usleep(1_200_000)  # this call holds the interpreter lock, so no other thread runs
        bench.end_of_cause()
        bench.detect(Overload.STALLED)
        bench.recover()
    assert not [message for message in bench.heard() if message.arbitration_id in (0x000, 0x620)]
    assert not any(isinstance(fact, NodeFault) for fact in bench.log.facts) and bench.node().outages == 0
    assert bench.driver.facts().stalls >= 2


@fault()
def wall_clock_set_back(bench: FaultBench) -> None:
    """The clock goes back an hour.

    The driver warns about a single clock jump. Stamps never go back, and no TPDO is late.
    """
    _set_clock(bench, -3600.0)


@fault()
def wall_clock_set_forward(bench: FaultBench) -> None:
    """The clock goes forward an hour. The driver warns about a single clock jump, and the stamps follow immediately."""
    _set_clock(bench, 3600.0)


def _set_clock(bench: FaultBench, seconds: float) -> None:
    bench.is_clock_true = False
    real, time.time = time.time, lambda: real() + seconds
    try:
        bench.wait(lambda: bench.driver.facts().clock_jumps == 1, 'not counted')
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
    """The recording ends. The driver logs the reason and counts the unrecorded CAN frames. The taxels continue."""
    with tempfile.TemporaryDirectory() as folder:
        bench.driver = Supervisor(replace(bench.settings, record=f'{folder}/x.log'), bench.pads, bench.keep)
        bench.run().cause()
        with open('/dev/full', 'wb') as full:
            os.dup2(full.fileno(), bench.driver._bus._record._file.writer.file.fileno())
        bench.detect(kind=lambda fact: isinstance(fact, OSError) and fact.errno == errno.ENOSPC)
        before = bench.driver.facts().unrecorded_can_frames
        bench.wait_for_whole('pad32', bench.kept[-1][1].stamp)
        bench.wait(lambda: bench.driver.facts().unrecorded_can_frames > before, 'not counted')
        assert sum(isinstance(fact, OSError) for fact in bench.log.facts) == 1
        assert bench.driver.failure is None and bench.adapter.opened == 1


@fault(is_running=False)
def fails_while_inactive(bench: FaultBench) -> None:
    """The driver reopens the bus and configures the device again. The activate transition then succeeds."""
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
    """Node guarding with the toggle bit changes no state, does not count as a boot, and loses no taxel."""
    for answer in ('05', '85') * 50:
        bench.other.send(can.Message(arbitration_id=0x720, is_extended_id=False, is_remote_frame=True, dlc=1))
        bench.send(0x720, answer)
    bench.wait(lambda: bench.driver.facts().can_frames.get('remote') == 100, 'not counted')
    bench.wait_for_whole('pad32', bench.kept[-1][1].stamp)
    assert not bench.complaints and (bench.node().state, bench.node().boots) == (NmtState.OPERATIONAL, 0)


@fault()
def other_makers_device_at_work(bench: FaultBench) -> None:
    """PDOs, SDOs, EMCYs, boot-ups, SYNC and TIME of a busy foreign device have no effect."""
    theirs = ((0x185, '0102030405060708'), (0x285, 'FF'), (0x605, '4018100100000000'), (0x585, '4318100100000001'),
              (0x085, '0010010000000000'), (0x705, '00'), (0x705, '7F'), (0x090, ''), (0x100, '000000000000'),
              (0x205, '00'), (0x7E5, '0400000000000000'))
    for times in range(1, 101):
        for can_id, data in theirs:
            bench.send(can_id, data)
        # Without this wait, the backlog of the busy interpreter and of the simulated device would grow.
        bench.wait(lambda: bench.driver.facts().can_frames.get('time', 0) == times, 'not counted')  # noqa: B023
    bench.wait(lambda: bench.driver.facts().can_frames.get('foreign', 0) == 400, 'not counted')
    bench.end_of_cause().recover()
    counts = bench.driver.facts()
    assert (counts.can_frames['emcy'], counts.can_frames['time']) == (200, 100)  # 0x090 is the COB-ID of an EMCY
    assert not bench.complaints and bench.node().emcy_count == 0
    bench.assert_no_outage()
    assert counts.pad('pad32').losses[LossReason.UNKNOWN_ROW] == 0


@fault(is_running=False)
def refuses_operational_from_the_start(bench: FaultBench) -> None:
    """The activate transition fails, and the error names the device's state. The bus stays open for another attempt."""
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
    del bench.kept[:second]  # sequence numbers restart with each activation


@fault()
def tare_under_load(bench: FaultBench) -> None:
    """The driver refuses a tare under load and names the taxel with the highest load. The offsets do not change."""
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
    last = 63  # the last taxel of Coded has the highest reading
    assert f'row {last // 8}, column {last % 8}' in outcome[0] and pad.offset is None


@fault((32, 35), source=uniform(1, 100, 1000, 12, 8), layout='nodes2_12x8_12bit.yaml')
def one_of_a_pads_nodes_lost(bench: FaultBench) -> None:
    """A pad loses one of its two nodes. The driver reports the node, and only its taxels are NaN until it boots."""
    second = bench.simulator.devices[35]
    values = _switch_off(bench, second, 12, NodeFault.SILENT).values
    first, lost = bench.driver.facts().pad('pad32').nodes
    assert (lost.node_id, lost.fault, first.fault) == (35, NodeFault.SILENT, NodeFault.NONE)
    assert np.isfinite(values[:6]).all() and np.isnan(values[6:]).all()
    _switch_on(bench, second)


@fault(source=uniform(2, 100, 1000, 16, 10), layout='domain16x10_16bit.yaml')
def polled_pad_power_cycled(bench: FaultBench) -> None:
    """The SDO block uploads of a restarting pad fail. The driver reports the failure and configures the booted pad."""
    _switch_off(bench, bench.device, 1,
                kind=lambda fact: isinstance(fact, (SdoAbortedError, SdoCommunicationError)))
    _switch_on(bench, bench.device)


@fault(source=uniform(3, 100, 1000, 16, 10), layout='domain16x10_16bit.yaml')
def polled_uploads_damaged(bench: FaultBench) -> None:
    """The CRC reveals damaged upload segments to the driver. The affected frames are NaN, and no value is wrong."""
    count = itertools.count()

    def damage(message: can.Message) -> list[can.Message]:
        if message.arbitration_id == 0x5A0 and message.data[0] < 0x80 and next(count) % 100 == 0:
            data = bytearray(message.data)
            data[5] ^= 1
            message = _with_data(message, bytes(data))
        return [message]
    bench.adapter.tamper = damage
    bench.detect(kind=lambda fact: isinstance(fact, SdoCommunicationError) and 'CRC' in str(fact))
    bench.wait(lambda: bench.driver.facts().pad('pad32').losses[LossReason.BROKEN] > 5, 'not counted')
    bench.repair()
    scale, values = bench.pads[0].layout.value.scale, bench.source(0.0)
    for _, frame in bench.kept:
        assert np.isnan(frame.values).all() or np.abs(frame.values - values).max() <= 0.5 * scale + 1e-3


@fault((32, 64), source=uniform(4, 1e3, 9e4, 16, 16), layout='sim16x16.yaml')
def adapter_of_two_large_pads_unplugged(bench: FaultBench) -> None:
    """The driver checks the 64 TPDOs of two 16x16 pads again. Both pads then work."""
    bench.wait_for_whole('pad64')
    bench.adapter.is_plugged = False
    bench.detect(BusFault.RECEPTION_FAILED, BusFault.SENDING_FAILED)
    bench.repair('pad32', 'pad64')


@fault((32, 64), source=uniform(4, 1e3, 9e4, 16, 16), layout='sim16x16.yaml')
def two_large_pads_power_cycled(bench: FaultBench) -> None:
    """Two 16x16 pads lose power at the same time. The driver writes 64 TPDOs again."""
    bench.wait_for_whole('pad64')
    for device in bench.simulator.devices.values():
        device.power_off()
    for device in bench.simulator.devices.values():
        device.boot()
    bench.end_of_cause().detect(NodeFault.BOOTED)
    bench.recover('pad32', 'pad64')


FAULTS += [stall(part, seconds) for seconds in (0.3, 2.0) for part in STALLING]
LONG_FAULTS = [stall(part, seconds) for seconds in (1.0, 5.0, 10.0, 30.0) for part in STALLING]
#: The faults that `make test` injects, one for each mechanism, with the reason for each. `make faults` injects all
#: faults.
ESSENTIAL = {
    'power_cycled_in_mid_stream': 'BOOTED: the boot-up message starts the recovery',
    'absent_at_configure_then_late': 'DeviceAbsentError: configure waits',
    'one_of_two_pads_lost': 'SILENT, while the other pad continues',
    'boot_up_message_lost': 'a device that sends nothing is found by a request',
    'another_device_comes_back': 'the identity is checked, the taxels are distrusted',
    'stopped_by_another_master': 'ForeignCommand, from any master',
    'refuses_operational': 'NOT_OPERATIONAL that stays, with DeviceErrors',
    'adapter_unplugged': 'RECEPTION_FAILED: the driver reopens the bus',
    'sending_fails': 'SENDING_FAILED, while reception works',
    'bus_off': 'BUS_OFF, by an error frame',
    'heartbeat_switched_off_by_another_master': 'NO_HEARTBEAT, repaired while the taxels continue',
    'taxels_lost_while_heartbeat_flows': 'NO_TAXELS',
    'tpdo_remapped_by_another_master': 'RECONFIGURED, by a write that the driver saw',
    'one_tpdo_switched_off_unseen': 'TPDO_MISSING, repaired while the others continue',
    'two_devices_from_the_start': 'TwoDevicesError, by two SDO answers',
    'second_sender_of_a_tpdo': 'TWO_SENDERS, by surplus TPDOs',
    'second_sync_producer': 'SECOND_PRODUCER',
    'sync_producer_of_another_period': 'OTHER_PERIOD',
    'sync_of_another_producer_stops': 'NO_SYNC',
    'emcy_until_it_is_reset': 'Emergency, from its start to its reset',
    'sdo_aborted_in_configuration': 'DeviceError: a write that the device refuses',
    'queue_overrun': 'BEHIND and DROPPED',
    'wall_clock_set_back': 'the stamps advance while the wall clock goes back',
    'polled_uploads_damaged': 'LossReason.BROKEN, of a polled pad',
    'adapter_stalls_for_0.3_s': 'LossReason.LATE: a backlog of one device',
    'driver_stalls_for_2_s': 'STALLED: the driver blames no node'}


class Beside:
    """Context manager for a process that only sleeps.

    A long wake-up delay of this process shows that the machine is overloaded.
    """

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
        """Return the largest wake-up delay since the last call [s]."""
        print(file=self._process.stdin, flush=True)
        return float(self._process.stdout.readline())


def main(names: list[str]) -> int:
    """Inject the faults in ``names``, or all faults, and print the results as a table.

    The exit code is 1 if taxels arrived too late, or a duration was wrong, although the machine kept up. Otherwise it
    is 0.
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
                print(f'{"":42} this machine did not keep up: {", ".join(wrong)}; a sleeping process woke up '
                      f'{late:.3f} s late, load average {os.getloadavg()[0]:.1f}', flush=True)
            elif wrong:
                failed.append(f'{each.__name__} ({", ".join(wrong)})')
    print(f'{len(chosen)} faults, taxels again within {ALLOWED:g} s'
          + (f', but for {", ".join(failed)}' if failed else '')
          + (f'; this machine did not keep up with {", ".join(not_measured)}' if not_measured else ''))
    return int(bool(failed))


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
