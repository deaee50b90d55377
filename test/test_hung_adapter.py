"""A serial adapter that stays connected but takes no data holds up no thread. Later, the driver uses it again.

An adapter takes no data while its firmware hangs, and while no other device of its CAN bus is powered, because it then
repeats its first frame for ever.
"""

import os
import subprocess
import sys
import termios
import threading
import time
from contextlib import contextmanager

import can
import numpy as np
import pytest
from waiting import wait_until

from tactile_node.assembly.health import BusFault
from tactile_node.bus.bus_settings import BusSettings
from tactile_node.bus.open_bus import open_bus
from tactile_node.errors import BusError
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.simulator.slcan_pty import SlcanPty
from tactile_node.skin.pads import make_pads, with_dictionaries
from tactile_node.sources.supervisor import Supervisor

LONG = 60.0  #: Time in which a call or a program ends on a busy machine [s]. Without a limit, it would never end.
PADS = with_dictionaries(make_pads(['sim8x8_16bit.yaml'], [32]))


class HangingPty(SlcanPty):
    """An adapter that can stop taking data, like a USB adapter whose firmware hangs."""

    def hang(self) -> None:
        termios.tcflow(self._port_fd, termios.TCOOFF)

    def recover(self) -> None:
        termios.tcflow(self._port_fd, termios.TCOON)


def outcome(call) -> object:
    """Return what ``call`` returns or raises, on another thread. If the call does not end in time, fail."""
    outcomes = []

    def run() -> None:
        try:
            outcomes.append(call())
        except Exception as error:
            outcomes.append(error)
    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(LONG)
    assert not thread.is_alive()
    return outcomes[0]


def is_stuck(error: object) -> bool:
    return isinstance(error, can.CanTimeoutError) and 'takes no data' in str(error)


@contextmanager
def pty():
    """Yield an adapter that receives what its client sends."""
    with HangingPty() as adapter:
        notifier = can.Notifier(adapter, [], 0.05)
        try:
            yield adapter
        finally:
            adapter.recover()
            notifier.stop()


FRAME = can.Message(arbitration_id=0x80, is_extended_id=False)


def test_a_frame_for_an_adapter_that_hangs_fails():
    with pty() as adapter:
        bus = open_bus('slcan', adapter.port, 1_000_000)
        adapter.hang()
        assert is_stuck(outcome(lambda: bus.send(FRAME)))
        assert is_stuck(outcome(bus.shutdown))
        # The kernel may already have given the descriptor of the port to another file.
        assert not bus.serialPortOrig.is_open and isinstance(outcome(lambda: bus.send(FRAME)), can.CanOperationError)


def test_bytes_that_never_leave_the_host_are_a_failure(monkeypatch):
    """The kernel accepts a few kilobytes for an adapter that hangs, so the write itself ends at once."""
    with pty() as adapter:
        bus = open_bus('slcan', adapter.port, 1_000_000)
        monkeypatch.setattr(type(bus.serialPortOrig), 'out_waiting', 6, raising=False)
        monkeypatch.setattr(bus.serialPortOrig, 'flush', lambda: time.sleep(10 * LONG))
        assert is_stuck(outcome(lambda: bus.send(FRAME)))
        monkeypatch.undo()
        bus.shutdown()


def test_a_program_that_does_not_close_its_bus_ends():
    """Python starts no more threads at that time."""
    program = ("import sys; from tactile_node.bus.slcan_bus import BulkSlcanBus\n"
               "bus = BulkSlcanBus(sys.argv[1], bitrate=1_000_000)")
    with pty() as adapter:
        assert subprocess.run([sys.executable, '-c', program, adapter.port], timeout=LONG).returncode == 0


def test_a_stop_of_this_process_during_a_write_is_no_failure(monkeypatch):
    """pyserial's own time limit would also expire, although the bytes were written."""
    with pty() as adapter:
        bus = open_bus('slcan', adapter.port, 1_000_000)
        write, stopped = os.write, []

        def write_and_stop(descriptor: int, data: bytes) -> int:
            written = write(descriptor, data)
            if descriptor == bus.fileno():
                stopped.append(time.sleep(1.5))
            return written
        with monkeypatch.context() as patch:
            patch.setattr(os, 'write', write_and_stop)
            bus.send(FRAME)
        assert stopped
        bus.shutdown()


def test_a_port_that_does_not_close_is_not_opened_and_holds_nobody_up(monkeypatch):
    """The kernel waits up to 30 s for unsent bytes when the port of an adapter that hangs is closed.

    During this time, the kernel also blocks every program that opens the port.
    """
    with pty() as adapter:
        bus = open_bus('slcan', adapter.port, 1_000_000)
        adapter.hang()
        close, closing = bus.serialPortOrig.close, threading.Event()
        monkeypatch.setattr(bus.serialPortOrig, 'close', lambda: (closing.wait(LONG), close()))
        assert is_stuck(outcome(bus.shutdown))
        adapter.recover()
        with pytest.raises(BusError, match='still closing this port'):
            open_bus('slcan', adapter.port, 1_000_000)
        closing.set()

        def is_free() -> bool:
            try:
                open_bus('slcan', adapter.port, 1_000_000).shutdown()
            except BusError:
                return False
            return True
        assert wait_until(is_free)


@pytest.mark.bus
def test_a_driver_stops_and_closes_while_its_adapter_hangs_and_uses_it_again_afterwards():
    adapter, frames = HangingPty(), []
    simulator = SkinSimulator(PADS, {'pad32': lambda t: np.full((8, 8), 12.5)})
    simulator.start_on(adapter)
    driver = Supervisor(BusSettings('slcan', adapter.port, sync_period=0.05), PADS,
                        lambda _, frame: frames.append(frame))

    def is_whole_after(count: int) -> bool:
        return any(not frame.missing_can_frames for frame in frames[count:])
    try:
        driver.open()
        driver.configure()
        driver.start()
        assert wait_until(lambda: is_whole_after(0))
        adapter.hang()
        assert wait_until(lambda: driver.failure is not None)
        assert driver.failure.fault is BusFault.SENDING_FAILED
        adapter.recover()
        count = len(frames)
        assert wait_until(lambda: is_whole_after(count + 2) and driver.failure is None)
        adapter.hang()
        assert wait_until(lambda: driver.failure is not None)
        assert outcome(driver.stop) is None and outcome(driver.close) is None
    finally:
        adapter.recover()
        driver.close()
        simulator.stop()
    assert all((np.diff([getattr(frame, key) for frame in frames]) > 0).all() for key in ('sequence', 'stamp'))
