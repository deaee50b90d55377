"""Batches: how a bus is read, when their frames came, and which SYNC is left out."""

import os
import pty
import threading
import time
import tty
from math import inf
from types import SimpleNamespace

import can
import pytest
from can_bench import wait_until

from tactile_node.bus.bus_network import open_bus
from tactile_node.bus.reception import MOST, Batch, Reception
from tactile_node.bus.traffic import Traffic

pytestmark = pytest.mark.bus


class Script:
    """A bus that gives ``messages`` one by one, then fails."""

    def __init__(self, messages):
        self._messages = list(messages)

    def recv(self, timeout):
        if not self._messages:
            raise can.CanOperationError('pulled out')
        return self._messages.pop(0)


def test_what_waits_is_one_batch_in_order_and_what_came_before_a_fault_is_not_lost():
    sent = [can.Message(arbitration_id=number, is_extended_id=False) for number in range(MOST + 10)]
    batches, errors = [], []
    reception = Reception(Script(sent), batches.append, errors.append)
    assert wait_until(lambda: errors)
    reception.stop()
    assert [len(batch.messages) for batch in batches] == [MOST, 10]
    assert [message for batch in batches for message in batch.messages] == sent


def test_an_exception_over_a_batch_does_not_end_the_reception():
    sent, errors = [can.Message(), None, can.Message(), None], []
    seen = []

    def stumble(batch):
        seen.append(batch)
        raise RuntimeError('a bug')
    reception = Reception(Script(sent), stumble, errors.append)
    assert wait_until(lambda: len(seen) == 2)
    reception.stop()
    assert isinstance(errors[0], RuntimeError)


def test_slcan_frames_came_between_the_last_look_at_an_empty_port_and_their_reading():
    master, port = pty.openpty()
    tty.setraw(port)
    bus = open_bus('slcan', os.ttyname(port), 500_000, {'sleep_after_open': 0.0})
    bus.recv_all(0.05)
    before = time.monotonic()
    os.write(master, b't1A02AABB\rt1A02')
    time.sleep(0.05)  # a pseudo-terminal passes it on by a thread of the kernel
    after, until = (batch := bus.recv_all(60)).came
    assert after < before < until and len(batch.messages) == 1
    os.write(master, b'CCDD\r')  # the line began before the last look
    time.sleep(0.05)
    second = bus.recv_all(60)
    assert second.came[0] < until and bytes(second.messages[0].data) == b'\xCC\xDD'
    asked = time.monotonic()
    assert not bus.recv_all(0.1).messages
    os.write(master, b't1A01EE\r')
    idle = bus.recv_all(60)
    assert idle.came[0] > asked  # nothing waited then: proved by a look, not by the length of the wait
    bus.shutdown()
    os.close(master)
    os.close(port)


def test_syncs_are_left_out_while_it_is_not_known_how_far_a_node_is():
    """As many as the bus has to be idle for, then none for a while."""
    router = SimpleNamespace(idle_wanted=0.0, sync=lambda stamp: None)
    traffic = Traffic(router, None, None, polled=(), queue_limit=9, is_host_stamped=True, sync_period=0.02)
    sent = []
    network = SimpleNamespace(send_message=lambda *args, **kwargs: sent.append(number))
    for number in range(24):
        router.idle_wanted = 0.025 if number >= 10 else 0.0
        traffic.send_sync(network, 0x80)
    assert sent == [*range(10), 12, 13, 14, 15, 18, 19, 20, 21]
    assert traffic.pause.count == 6 and traffic.syncs_sent == len(sent)


def test_a_bus_that_was_closed_or_not_read_was_not_idle():
    idle = []
    router = SimpleNamespace(settle=lambda since, until: idle.append(until - since), feed=lambda *frame: None)
    monitor = SimpleNamespace(feed=lambda can_id, data: None)
    traffic = Traffic(router, monitor, None, polled=(), queue_limit=2, is_host_stamped=True, sync_period=0.02)
    held = threading.Event()
    now = time.time()

    def received(*stamps):
        traffic.received(Batch([can.Message(now + stamp, 0x1A0, False) for stamp in stamps]))
    traffic.begin()
    received(-5.0, -4.0)
    assert wait_until(lambda: len(idle) == 2)
    traffic.put(held.wait)
    received(-3.9, -3.8)
    received(-3.7)  # there is no room for it
    held.set()
    assert wait_until(lambda: len(idle) == 4)
    received(-2.0, -1.5)
    assert wait_until(lambda: len(idle) == 6)
    traffic.end(1.0)
    traffic.begin()
    received(-1.0)
    assert wait_until(lambda: len(idle) == 7)
    traffic.end(1.0)
    assert idle == pytest.approx([-inf, 1.0, 0.1, 0.1, -inf, 0.5, -inf], abs=1e-5) and traffic.overruns == 1
