"""Tests of batched reading: how the driver reads a bus, when the CAN frames arrived, and which SYNCs it omits."""

import os
import select
import socket
import sys
import threading
import time
from contextlib import suppress
from functools import partial
from math import inf
from types import SimpleNamespace

import can
import pytest
from can_bench import serial_line
from waiting import wait_until

from tactile_node.assembly.free_bus import FreeBus
from tactile_node.assembly.health import BusFault
from tactile_node.assembly.router import Router
from tactile_node.bus import can_queue
from tactile_node.bus.batch_reader import MOST_IN_BATCH, Batch, BatchReader
from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.bus.bus_network import BusNetwork
from tactile_node.bus.can_queue import CanQueue
from tactile_node.bus.open_bus import open_bus
from tactile_node.bus.stamp_clock import StampClock
from tactile_node.bus.sync_producer import SyncPause, SyncProducer
from tactile_node.viewing.node_record import BusRecord

pytestmark = pytest.mark.bus


class Script:
    """A bus that delivers ``messages`` one by one and then raises an error."""

    channel_info = 'script'

    def __init__(self, messages):
        self._messages = list(messages)

    def recv(self, timeout):
        if not self._messages:
            raise can.CanOperationError('pulled out')
        return self._messages.pop(0)

    def shutdown(self):
        pass


def network_on(bus, on_batch, errors):
    """Return a network on ``bus`` that adds each failure of the reception to ``errors``."""
    def failed(fault, error):
        assert fault is BusFault.RECEPTION_FAILED
        errors.append(error)
    return BusNetwork(bus, on_batch, failed)


def test_waiting_messages_form_one_batch_and_none_before_a_fault_is_lost():
    sent = [can.Message(arbitration_id=number, is_extended_id=False) for number in range(MOST_IN_BATCH + 10)]
    batches, errors = [], []
    network = network_on(Script(sent), batches.append, errors)
    assert wait_until(lambda: errors)
    network.close()
    assert [len(batch.messages) for batch in batches] == [MOST_IN_BATCH, 10]
    assert [message for batch in batches for message in batch.messages] == sent


def test_an_exception_over_a_batch_is_logged_and_neither_ends_the_reception_nor_is_a_fault_of_the_bus(caplog):
    sent, errors = [can.Message(), None, can.Message(), None], []
    seen = []

    def stumble(batch):
        seen.append(batch)
        raise RuntimeError('a bug')
    network = network_on(Script(sent), stumble, errors)
    assert wait_until(lambda: errors)
    network.close()
    assert len(seen) == 2 and {type(error) for error in errors} == {can.CanOperationError}
    assert caplog.text.count('Traceback') == 2 and 'in stumble' in caplog.text


def test_an_exception_of_the_assembler_is_logged_and_costs_one_call_alone(monkeypatch, caplog):
    bus = Clocked(monkeypatch, queue_limit=1)
    free_bus = bus.queue._router._free_bus
    arrived = free_bus.arrived
    monkeypatch.setattr(free_bus, 'arrived', lambda *given: 1 / 0)
    bus.received(1.0)
    done = threading.Event()
    bus.queue.chain.post(done.set)
    assert done.wait(60) and 'ZeroDivisionError' in caplog.text and 'Traceback' in caplog.text
    monkeypatch.setattr(free_bus, 'arrived', arrived)
    assert wait_until(bus.received(2.0))
    assert bus.queue.overruns == 0  # The queue accepts messages again.


def test_a_batch_that_was_lost_by_an_exception_leaves_a_gap(monkeypatch):
    """The lost CAN frames occupied the bus, so the driver cannot assume that the bus was free at that time."""
    bus = Clocked(monkeypatch)
    assert wait_until(bus.received(1.0))
    with monkeypatch.context() as patch:
        patch.setattr(bus.queue._monitor, 'feed', lambda *frame: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            bus.received(1.2)
    assert wait_until(bus.received(1.3))
    assert bus.seen()[1:] == [0.3]


def test_a_batch_that_was_lost_by_an_exception_takes_no_room_in_the_queue(monkeypatch):
    bus = Clocked(monkeypatch, queue_limit=1)
    with monkeypatch.context() as patch:
        patch.setattr(bus.queue, '_arrival', lambda *batch: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            bus.received(1.0)
    assert wait_until(bus.received(1.2))
    assert bus.queue.overruns == 0


def test_slcan_frames_came_between_the_last_look_at_an_empty_port_and_their_reading():
    with serial_line() as (adapter, port):
        bus = open_bus('slcan', port, 500_000, sleep_after_open=0.0)
        bus.recv_all(0.05)
        before = time.monotonic()
        os.write(adapter, b't1A02AABB\rt1A02')
        select.select([bus], [], [], 60)  # a kernel thread passes the bytes through the pseudo-terminal
        after, until = (batch := bus.recv_all(60)).arrival
        assert after < before < until and len(batch.messages) == 1
        os.write(adapter, b'CCDD\r')
        select.select([bus], [], [], 60)
        second = bus.recv_all(60)
        # The first part of this line was sent before the last read, and after ``before``.
        assert second.arrival[0] < before and bytes(second.messages[0].data) == b'\xCC\xDD'
        asked = time.monotonic()
        assert not bus.recv_all(0.1).messages
        os.write(adapter, b't1A01EE\r')
        idle = bus.recv_all(60)
        # A read at that time proves that no message was waiting. The length of the wait would prove nothing.
        assert idle.arrival[0] > asked
        bus.shutdown()


def test_syncs_are_left_out_while_it_is_not_known_how_far_a_node_is():
    """The driver omits SYNCs until the nodes have sent their backlog and the bus has been free.

    After the omitted SYNCs, the driver omits none for a while.
    """
    router = SimpleNamespace(is_in_doubt=False, sync=lambda stamp: None)
    queue = CanQueue(router, None, None, polled=(), queue_limit=9, clock=StampClock())
    sent = []
    network = SimpleNamespace(send_message=lambda *args, **kwargs: sent.append(number))
    producer = SyncProducer(0.02, 0x80, lambda: network, queue, router, None)
    for number in range(24):
        router.is_in_doubt = number >= 10
        producer.send()
    assert sent == [*range(10), 13, 14, 15, 16, 20, 21, 22, 23]
    assert producer.pause.count == 6 and producer.sent == len(sent)


class Clocked:
    """A CanQueue whose steady clock is set by the test.

    For each CAN frame, the object records how long before the frame the bus was not provably free.
    """

    def __init__(self, monkeypatch, queue_limit=99):
        self.spans, self.steady = [], 1000.0
        monkeypatch.setattr(can_queue, 'time', SimpleNamespace(monotonic=lambda: self.steady, time=time.time))
        bus = FreeBus(1_000_000)
        monkeypatch.setattr(bus, '_occupy', lambda until, seconds: self.spans.append(seconds))
        monkeypatch.setattr(bus, 'saw_frame', lambda stamp: self.spans.append(None))
        router = SimpleNamespace(_free_bus=bus, feed=lambda *frame: None)
        router._saw_other = partial(Router._saw_other, router)
        router.feed_batch = partial(Router.feed_batch, router)
        monitor = BusMonitor([])
        self.queue = CanQueue(router, monitor, None, polled=(), queue_limit=queue_limit, clock=StampClock())
        self.begun = time.time() - 100.0
        self.queue.begin()

    def received(self, *stamps, steady=None, spans=None, dropped=0, **kind):
        """Receive messages stamped ``stamps`` seconds after the beginning and read ``steady`` seconds after it.

        The returned function returns True once all messages are processed.
        """
        self.steady = 1000.0 + (stamps[-1] if steady is None else steady)
        expected = len(self.spans) + (len(stamps) if spans is None else spans)
        self.queue.received(Batch([can.Message(self.begun + stamp, 0x1A0, kind.pop('extended', False), **kind)
                                     for stamp in stamps], dropped=dropped))
        return lambda: len(self.spans) == expected

    def seen(self):
        self.queue.end(10.0)
        return [span if span is None else round(span, 3) for span in self.spans]


def test_a_bus_that_was_closed_or_not_read_was_not_free(monkeypatch):
    bus, held = Clocked(monkeypatch, queue_limit=2), threading.Event()
    assert wait_until(bus.received(5.0)) and wait_until(bus.received(6.0, 6.1))
    bus.queue.chain.post(held.wait)
    whole = bus.received(6.2, 6.3)
    bus.received(6.4)  # The queue is full, so this message is dropped.
    held.set()
    assert wait_until(whole) and wait_until(bus.received(8.0)) and wait_until(bus.received(8.5))
    bus.queue.end(1.0)
    bus.queue.begin()
    assert wait_until(bus.received(9.0))
    assert bus.seen() == [inf, 0.0, 0.0, 0.0, 0.0, 1.7, 0.0, 0.5] and bus.queue.overruns == 1


def test_frames_dropped_by_the_kernel_are_counted_and_leave_a_gap_around_their_batch(monkeypatch):
    bus = Clocked(monkeypatch)
    for stamp, dropped in ((1.0, 0), (1.1, 0), (1.3, 2), (1.4, 0), (1.5, 0)):
        assert wait_until(bus.received(stamp, dropped=dropped))
    assert bus.seen() == [inf, 0.0, 0.2, 0.1, 0.0] and bus.queue.overruns == 2


@pytest.mark.skipif(sys.platform != 'linux', reason='only Linux reports the drops of a socket')
def test_the_drops_of_a_socket_are_counted_once_and_logged(caplog):
    with socket.socket(type=socket.SOCK_DGRAM) as receiver, socket.socket(type=socket.SOCK_DGRAM) as sender:
        receiver.bind(('127.0.0.1', 0))
        receiver.settimeout(1.0)
        before = receiver.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
        buffer = BatchReader(SimpleNamespace(socket=receiver))
        assert receiver.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) > before and buffer.new_drops() == 0
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        for _ in range(100):
            sender.sendto(bytes(8), receiver.getsockname())
        dropped, received = buffer.new_drops(), 0
        with suppress(TimeoutError):
            while receiver.recv(8):
                received += 1
        assert received > 0 and received + dropped == 100 and buffer.new_drops() == 0
    assert f'dropped {dropped} CAN frames' in caplog.text and buffer.new_drops() == 0


def test_a_frame_without_room_in_the_queue_is_counted_once(monkeypatch):
    bus, held = Clocked(monkeypatch, queue_limit=1), threading.Event()
    bus.queue.chain.post(held.wait)
    for kind in ({}, {'extended': True}, {'is_error_frame': True}, {}):
        bus.received(5.0, **kind)
    counted = bus.queue.overruns, dict(bus.queue.others)  # also while the chain hangs
    held.set()
    bus.seen()
    assert counted == (bus.queue.overruns, dict(bus.queue.others)) == (1, {'foreign': 1, 'error': 1})


def test_a_clock_that_is_set_forward_does_not_count_as_a_free_bus(monkeypatch):
    bus = Clocked(monkeypatch)
    for stamps, steady in (((1.0,), 1.0), ((1.001,), 1.001), ((1.052,), 1.002)):
        assert wait_until(bus.received(*stamps, steady=steady))
    assert bus.seen()[1:] == [0.0, 0.05]


def test_other_frames_take_bus_time_and_after_an_error_the_bus_is_not_provably_free(monkeypatch):
    bus = Clocked(monkeypatch)
    for stamp, spans, kind in ((1.0, 1, {}), (1.01, 2, {'extended': True}), (1.02, 1, {'is_error_frame': True})):
        assert wait_until(bus.received(stamp, spans=spans, **kind))
    assert bus.seen()[1:] == [0.0, None, inf]


#: Kind of a CAN frame and its largest number of bits according to ISO 11898-1, counted by hand. The terms are the bits
#: subject to stuffing, the stuff bits, and the 13 bits after them.
WIRE_BITS = [({'is_extended_id': False, 'data': bytes(8)}, 98 + 24 + 13),
             ({'is_extended_id': True, 'data': bytes(8)}, 118 + 29 + 13),
             ({'is_extended_id': True, 'data': b''}, 54 + 13 + 13),
             ({'is_extended_id': False, 'is_remote_frame': True, 'dlc': 8}, 34 + 8 + 13),
             ({'is_extended_id': True, 'is_remote_frame': True, 'dlc': 8}, 54 + 13 + 13)]


@pytest.mark.parametrize(('kind', 'bits'), WIRE_BITS)
def test_the_live_bus_load_counts_every_frame_on_the_wire_as_the_report_does(kind, bits):
    monitor, record = BusMonitor([32]), BusRecord(1_000_000)
    queue = CanQueue(SimpleNamespace(), monitor, None, polled=(), queue_limit=99, clock=StampClock())
    messages = [can.Message(timestamp=100.0 + stamp, arbitration_id=0x1A0, **kind) for stamp in (0.1, 0.2, 1.5)]
    queue.received(Batch([*messages, can.Message(timestamp=101.6, is_error_frame=True)]))
    for message in messages:
        record.feed(message)
    assert monitor.bits == 3 * bits
    # This is the load of the first second, which contains two CAN frames.
    assert record.report(None).load.mean == pytest.approx(2 * bits / 1e6)


def test_a_single_fault_is_reported_after_all_earlier_messages():
    class Once(Script):
        def recv(self, timeout):
            message = super().recv(timeout)
            if isinstance(message, Exception):
                raise message
            return message
    lost, batches, errors = can.CanOperationError('frames lost'), [], []
    network = network_on(Once([can.Message(), lost, can.Message(), None]), batches.append, errors)
    assert wait_until(lambda: len(batches) == 2)
    network.close()
    assert errors[0] is lost


def test_syncs_are_no_longer_left_out_once_nothing_is_in_doubt_or_sync_was_off():
    pause = SyncPause(period=0.001)
    assert pause.is_due(True) and pause.is_due(True) and not pause.is_due(False) and not pause.is_due(True)
    pause.restart()  # The pause lasts for 2 SYNCs for pending frames, 6 ms of free bus, and 2 ms to read the frames.
    assert [pause.is_due(True) for _ in range(15)] == 10 * [True] + 4 * [False] + [True]
