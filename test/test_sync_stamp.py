"""The stamp of the driver's own SYNC must stay correct if the process or the write is delayed.

The test moves the clocks.
"""

import threading

import can
import numpy as np
import pytest
from can_bench import is_balanced, tiny_layout
from test_stamp_clock import Hands
from waiting import wait_until

from tactile_node.assembly.router import Router
from tactile_node.bus import sync_producer
from tactile_node.bus.batch_reader import Batch
from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.bus.bus_network import BusNetwork
from tactile_node.bus.can_queue import CanQueue
from tactile_node.bus.sync_producer import SyncProducer
from tactile_node.skin.pads import PadSettings

pytestmark = pytest.mark.bus
PERIOD = 0.02  # Period of SYNC [s].
STALL = 0.3    # Delay of the process or the write [s].
ALLOWED = 0.02  # Largest error of a stamp [s].


class HeldUpBus:
    """A bus with one device that samples at each SYNC and whose taxels read the number of the SYNC.

    ``send`` calls ``before`` before the SYNC is on the wire, and calls ``after`` once the device's TPDOs have arrived.
    """

    channel_info = 'held up'

    def __init__(self, hands):
        self._hands = hands
        self.sampled = []  # Times at which the SYNCs were on the wire.
        self.before = self.after = lambda: None
        self.received = None

    def recv(self, timeout):
        threading.Event().wait(0.01)  # Received messages do not pass through recv, but go directly to ``received``.

    def send(self, message):
        self.before()
        self.sampled.append(self._hands.wall)
        taxels = bytes([10 + len(self.sampled)] * 2)
        self._hands.wait(0.001)
        self.received(Batch([can.Message(self._hands.wall, 0x1A0 + 0x100 * i, False, data=taxels) for i in range(3)]))
        self.after()

    def shutdown(self):
        pass


class HeldUp:
    """The part of the driver that sends SYNC, connected to a HeldUpBus. ``frames`` collects the resulting frames."""

    def __init__(self, folder, one_clock=True):
        self.frames, self.hands = [], Hands()
        self.bus = HeldUpBus(self.hands)
        pad = PadSettings('pad', (32,), tiny_layout(folder))
        self._router = Router((pad,), lambda name, frame: self.frames.append(frame), foreign_sync=False,
                              one_clock=one_clock)
        self.queue = CanQueue(self._router, BusMonitor([32]), print, polled=(), queue_limit=999,
                              clock=self.hands.clock())
        self.network = BusNetwork(self.bus, self.queue.received, print)
        self.bus.received = self.queue.received
        self.producer = SyncProducer(PERIOD, 0x80, lambda: self.network, self.queue, self._router, print)

    def __enter__(self):
        self.queue.begin()
        self.queue.restart()
        return self

    def __exit__(self, *_):
        self.network.close()
        self.queue.end(60)

    def sync(self, count=1):
        for _ in range(count):
            self.hands.wait(PERIOD)
            self.producer.send()

    def wait_for(self, frames):
        assert wait_until(lambda: len(self.frames) >= frames), self.frames

    def check(self):
        """Check the stamps and the loss counts of all frames.

        No valid taxel may have a stamp that is off by more than ALLOWED. Every frame must be accounted for.
        """
        for frame in self.frames:
            valid = np.isfinite(frame.values)
            for number in np.unique(frame.values[valid] / 2.0):  # The scale of the taxels is 2 Pa per count.
                assert abs(frame.stamp - self.bus.sampled[int(number) - 1]) < ALLOWED
        assert is_balanced(self._router._assemblers['pad'])

    def whole(self):
        """Return the numbers of the SYNCs whose taxels were published."""
        return [int(frame.values[0, 0] / 2.0) for frame in self.frames if np.isfinite(frame.values).all()]


@pytest.fixture
def patient(monkeypatch):
    """Make the assembler wait until every write has returned.

    The duration of a write then depends only on the clocks of the test, not on the load of the machine.
    """
    monkeypatch.setattr(sync_producer, 'MOST_LATE', 60)


@pytest.mark.parametrize('stall', [STALL, 0.03])
@pytest.mark.parametrize('one_clock', [True, False])
@pytest.mark.parametrize('where', ['before', 'after'])
def test_a_delayed_write_leaves_no_taxels_with_a_wrong_stamp(tmp_path, patient, where, one_clock, stall):
    with HeldUp(tmp_path, one_clock) as held:
        held.sync(3)
        setattr(held.bus, where, lambda: held.hands.wait(stall))
        held.sync()
        setattr(held.bus, where, lambda: None)
        held.sync(3)
        held.wait_for(7)
    held.check()
    # The fourth sweep is not published whole, because its sampling time is unknown.
    assert held.whole() == [1, 2, 3, 5, 6, 7]


def test_a_write_that_takes_a_millisecond_costs_nothing(tmp_path, patient):
    with HeldUp(tmp_path) as held:
        held.bus.before = held.bus.after = lambda: held.hands.wait(0.001)
        held.sync(5)
        held.wait_for(5)
    held.check()
    assert held.whole() == [1, 2, 3, 4, 5]


def test_a_sync_that_waited_for_another_sender_has_the_time_of_its_own_write(tmp_path, patient):
    class Busy:
        """A lock that another thread has held for STALL."""

        def __enter__(self):
            held.hands.wait(STALL)

        def __exit__(self, *_):
            pass
    with HeldUp(tmp_path) as held:
        held.network.send_lock = Busy()
        held.sync(3)
        held.wait_for(3)
    held.check()
    assert held.whole() == [1, 2, 3]


def test_a_write_that_does_not_return_holds_up_nothing_else(tmp_path):
    """The answers arrive. Neither the device's TPDOs nor the SYNC may delay the assembler."""
    released, answered = threading.Event(), threading.Event()
    with HeldUp(tmp_path) as held:
        held.bus.after = lambda: answered.set() or released.wait(60)
        sender = threading.Thread(target=held.sync)
        sender.start()
        assert answered.wait(60)
        done = threading.Event()
        held.queue.chain.post(done.set)
        assert done.wait(30), 'the assembler must not wait for the write'
        released.set()
        sender.join()
    held.check()
    assert held.whole() == []
