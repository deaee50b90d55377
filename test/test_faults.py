"""Tests of the fault catalogue, which lists what a user sees during each fault.

The taxel values must stay correct during every fault.
"""

import threading
import time
from contextlib import nullcontext

import numpy as np
import pytest
from can_bench import TooSlowError
from fault_bench import PERIOD, SIDE, Coded, FaultBench, check_stamps
from fault_catalogue import ESSENTIAL, FAULTS
from waiting import wait_until

from tactile_node.assembly.health import BusFault, NodeFault
from tactile_node.cia301.emergency import decode_emergency
from tactile_node.cia301.objects import NmtState
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus

pytestmark = pytest.mark.bus


@pytest.mark.parametrize('name', ESSENTIAL)
def test_fault(name):
    fault, = (fault for fault in FAULTS if fault.__name__ == name)
    fault(f'test {name}')


def test_without_recovery_faults_are_reported_and_left_alone():
    with FaultBench('left alone', recover=False) as bench:
        bench.run()
        bench.send(0x000, '0220')
        bench.wait(lambda: bench.node().fault is NodeFault.NOT_OPERATIONAL, 'not reported')
        bench.adapter.is_plugged = False
        bench.wait(lambda: bench.driver.failure is not None, 'not reported')
        assert bench.adapter.opened == 1 and bench.node().state == NmtState.STOPPED
        bench.detect(BusFault.RECEPTION_FAILED, BusFault.SENDING_FAILED)
        failed, = (one.message for one in bench.log.records if isinstance(one.fact, BusFault))
        assert 'deactivate, clean up and configure' in failed and '..' not in failed


def test_sequence_numbers_of_an_outage_of_the_bus_are_left_out():
    """During an outage, the sequence numbers advance by one for each SYNC period, and never faster."""
    with FaultBench('numbers') as bench:
        bench.run()
        bench.adapter.is_plugged = False
        bench.wait(lambda: bench.adapter.opened == 1 and bench.driver.failure is not None, 'not failed')
        bench.wait(lambda: bench.driver.facts().outage_seconds > 1.0, 'the outage ends by itself')
        bench.repair()
        frames = [frame for _, frame in bench.kept]
    before, after = max(zip(frames, frames[1:]), key=lambda pair: pair[1].sequence - pair[0].sequence)
    assert 1.0 / PERIOD <= after.sequence - before.sequence <= (after.stamp - before.stamp) / PERIOD + 1


@pytest.mark.parametrize('is_stopped_later', [False, True])
def test_an_outage_of_a_stopped_driver_adds_no_sequence_numbers_to_the_next_outage(is_stopped_later):
    """The first outage begins before the driver is started, or the driver is stopped during the first outage."""
    with FaultBench(f'stopped {is_stopped_later}') as bench:
        if is_stopped_later:
            bench.run()
        else:
            bench.driver.open()
            bench.driver.configure()
        bench.adapter.is_plugged = False
        bench.wait(lambda: bench.driver.facts().outage_seconds > 0.2, 'not failed')
        bench.driver.stop()
        bench.adapter.mend()
        bench.wait(lambda: bench.driver.failure is None, 'not reopened')
        bench.kept.clear()  # the sequence starts again
        bench.driver.start()
        bench.wait_for_whole('pad32')
        bench.adapter.is_plugged = False
        bench.wait(lambda: bench.driver.facts().outages == 2, 'not failed again')
        bench.repair()
        frames = [frame for _, frame in bench.kept]
    before, after = max(zip(frames, frames[1:]), key=lambda pair: pair[1].sequence - pair[0].sequence)
    assert 0 < after.sequence - before.sequence <= (after.stamp - before.stamp) / PERIOD + 1


def test_one_recording_holds_both_sides_of_an_outage(tmp_path):
    record = tmp_path / 'session.log'
    with FaultBench('recorded', record=str(record)) as bench:
        # A new whole frame proves that more than one SYNC is recorded.
        bench.run().wait_for_whole('pad32', time.time())
        bench.cause()
        bench.adapter.is_plugged = False
        bench.wait(lambda: bench.driver.facts().outage_seconds > 0.3, 'the outage ends by itself')
        bench.repair()
    assert [path.name for path in tmp_path.iterdir()] == ['session.log']
    syncs = np.array([float(line.split()[0][1:-1]) for line in record.read_text().splitlines() if ' 080#' in line])
    gaps = np.flatnonzero(np.diff(syncs) > 0.25)  # A busy machine may cause additional gaps.
    assert ((0 < gaps) & (gaps < len(syncs) - 2)).any()


def test_a_driver_closes_during_an_outage_and_leaves_no_thread_behind():
    before = set(threading.enumerate())
    with FaultBench('closing') as bench:
        bench.run()
        bench.adapter.is_plugged = False
        bench.wait(lambda: bench.driver.failure is not None, 'not failed')
        bench.driver.stop()
        bench.driver.close()
        bench.driver.close()
    assert wait_until(lambda: set(threading.enumerate()) <= before)


def test_a_driver_closed_during_an_outage_opens_again():
    with FaultBench('again') as bench:
        bench.run()
        bench.adapter.is_plugged = False
        bench.wait(lambda: bench.driver.failure is not None, 'not failed')
        bench.driver.close()
        bench.adapter.is_plugged = True
        bench.kept.clear()
        bench.run()
        assert bench.driver.failure is None and bench.kept[0][1].sequence == 0


@pytest.mark.parametrize(('stamped', 'answered_late', 'error'), [
    (2, 0.06, None), (3, 0.005, AssertionError), (1, 0.005, AssertionError), (3, 0.06, TooSlowError)],
    ids=['right, held up by adapter and skin', 'a value of the past', 'a value of the future', 'a device that is late'])
def test_a_stamp_is_judged_by_the_sync_that_the_taxels_answer(stamped, answered_late, error):
    """The check judges a stamp by the SYNC that the taxels answer, not by the time that a busy machine needs.

    The taxels answer SYNC 2 and carry the stamp of SYNC ``stamped``.
    """
    coded, asked = Coded(), [100.0 + PERIOD * number for number in range(5)]

    def frame(sync: int, stamp: float) -> TaxelFrame:
        coded.syncs = sync
        return TaxelFrame(stamp, sync, coded(0.0), np.full((SIDE, SIDE), TaxelStatus.VALID), 0)
    frames = [frame(2, asked[stamped - 1]), *(frame(sync, asked[sync - 1]) for sync in range(stamped + 1, 5))]
    answered = {number: asked[number - 1] + answered_late for number in range(1, 6)}
    with pytest.raises(error) if error else nullcontext() as raised:
        check_stamps(frames, coded, asked, answered)
    assert error is None or raised.type is error


@pytest.mark.parametrize('data, text', [
    ('0000000000000000', 'EMCY 0x0000 (error reset or no error)'),
    ('3081110000000000', 'EMCY 0x8130 (life guard or heartbeat error), error register: generic, communication'),
    ('0031050000000000', 'EMCY 0x3100 (mains voltage), error register: generic, voltage'),
    ('0050010102000000', 'EMCY 0x5000 (device hardware), error register: generic, manufacturer 0102000000'),
    ('01FF80', 'EMCY 0xFF01 (specific to the device), error register: manufacturer'),
    ('00B0', 'EMCY 0xB000 (of no class in CiA 301)'), ('7F', 'EMCY too short to hold an error code')])
def test_emcy_in_words(data, text):
    assert str(decode_emergency(bytes.fromhex(data), 0.0)) == text
