"""The driver runs on Linux's own CAN stack, with emulated SJA1000 controllers on one bus, and with vcan.

`make socketcan` runs these tests.
"""

import ctypes
import socket
import subprocess
import sys
import termios
import threading
import time
from pathlib import Path

import can
import numpy as np
import pytest
from can_bench import INTERFACE, TooSlowError
from captured_log import CapturedLog
from waiting import wait_until

from tactile_node.assembly.health import BusFault, Overload
from tactile_node.bus.batch_reader import WANTED_SIZE
from tactile_node.bus.bus_network import BusNetwork
from tactile_node.bus.bus_settings import BusSettings
from tactile_node.bus.open_bus import open_bus
from tactile_node.errors import BusError
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.skin.pads import make_pad, make_pads, with_dictionaries
from tactile_node.sources.supervisor import Supervisor

pytestmark = [pytest.mark.bus, pytest.mark.skipif(
    INTERFACE != 'socketcan', reason='this test needs SocketCAN; `make socketcan` runs it')]
PRESSED = 12.5
PERIOD = 0.25  # Period in seconds, which is long because the emulated machine is slow.
LONGEST = 120  # Longest wait [s].
BUS_OFF = 0x40  # From linux/can/error.h.


def ip(*words: str) -> None:
    subprocess.run(['ip', 'link', 'set', *words], check=True)


@pytest.fixture
def controllers():
    """Set up the controllers can0 and can1 with the same bit rate."""
    for name in ('can0', 'can1'):
        ip(name, 'type', 'can', 'bitrate', '1000000')
        # The skin sends a whole sweep at once, but the default transmit queue holds only 10 frames.
        ip(name, 'up', 'txqueuelen', '1000')
    yield
    for name in ('can0', 'can1'):
        ip(name, 'down')


def overruns_of_controllers() -> int:
    """Return how often can0 failed to receive CAN frames, or can1 failed to send them.

    The emulated machine is slow if the host is busy.
    """
    kinds = {'can0': ('rx_dropped', 'rx_over_errors', 'rx_fifo_errors', 'rx_missed_errors'),
             'can1': ('tx_dropped', 'tx_errors', 'tx_fifo_errors')}
    return sum(int(Path(f'/sys/class/net/{name}/statistics/{kind}').read_text())
               for name, of_name in kinds.items() for kind in of_name)


class Driven:
    """A supervised driver on ``channel`` and a simulated skin on ``skin``. Use this class as a context manager."""

    def __init__(self, channel: str, skin: str, layout: str = 'sim8x8_16bit.yaml', nodes: tuple[int, ...] = (32,)):
        pads = with_dictionaries(make_pads([layout], nodes))
        self.skin = skin
        self.kept = []
        self.log = CapturedLog()
        self.value = pads[0].layout.value
        pressed = np.full((pads[0].layout.rows, pads[0].layout.cols), self.pressed)
        self.simulator = SkinSimulator(pads, {pad.name: lambda t: pressed for pad in pads})
        self.driver = Supervisor(BusSettings('socketcan', channel, sync_period=PERIOD, boot_timeout=20), pads,
                                 lambda name, frame: self.kept.append(frame), heartbeat_timeout=1.0)

    def __enter__(self) -> 'Driven':
        self.log.__enter__()
        self.simulator.start('socketcan', self.skin)
        self.driver.open()
        self.driver.configure()
        self.driver.start()
        self.wait(lambda: self.whole_after(0), 'no whole frames')
        return self

    def __exit__(self, *_: object) -> None:
        self.driver.close()
        self.simulator.stop()
        self.log.__exit__()

    @property
    def pressed(self) -> float:
        """Return a load in the layout's unit that corresponds to an even number of counts."""
        return PRESSED if self.value.unit == 'N' else 100 * self.value.scale

    def whole_after(self, stamp: float) -> bool:
        return any(frame.stamp > stamp and not frame.missing_can_frames for frame in self.kept[-20:])

    def wait(self, condition, what: str) -> None:
        """Wait until ``condition()`` is true.

        Raises TooSlowError if the condition stays false on a machine that overloads the driver.
        """
        if wait_until(condition, LONGEST):
            return
        is_overloaded = any(isinstance(fact, Overload) for fact in self.log.facts)
        raise (TooSlowError if is_overloaded else AssertionError)(
            f'{what}; {self.driver.facts()}; {self.log.errors}')

    def check(self) -> None:
        """Check that each published value is either the load on the skin or NaN."""
        for frame in self.kept:
            np.testing.assert_allclose(frame.values[np.isfinite(frame.values)], self.pressed, rtol=1e-3)


def test_taxels_over_two_controllers(controllers):
    with Driven('can0', 'can1') as bench:
        bench.wait(lambda: sum(not frame.missing_can_frames for frame in bench.kept) >= 20, 'too few whole frames')
        bench.check()
        sent = bench.simulator.devices[32].frames_sent
        received, overruns = bench.driver.facts().pad('pad32').tpdos_received, overruns_of_controllers()
    whole = [frame for frame in bench.kept if not frame.missing_can_frames]
    assert all(np.isfinite(frame.values).all() for frame in whole)
    print(f'\nsocketcan: two controllers: {sent} TPDOs sent, {received} received, {overruns} overruns')
    # The 16 TPDOs of one sweep may still be in transit. An overrun may lose any number of frames.
    assert received >= sent - 16 or overruns


@pytest.mark.parametrize(('layout', 'nodes'), [('sim16x16.yaml', (32, 64)), ('nodes2_12x8_12bit.yaml', (32, 35))])
def test_nothing_is_lost_between_linux_and_the_driver(layout, nodes):
    """No controller can overrun with vcan, so the driver must receive every sent TPDO."""
    with Driven('vcan0', 'vcan0', layout, nodes) as bench:
        bench.wait(lambda: len(bench.kept) >= 20, 'too few frames')
        bench.driver.stop()
        devices = bench.simulator.devices.values()
        bench.wait(lambda: not any(device.operational for device in devices), 'not stopped')
        sent = sum(device.frames_sent for device in devices)
        bench.wait(lambda: sum(pad.tpdos_received for pad in bench.driver.facts().pads) == sent,
                   f'{sent} TPDOs sent, some not received')
        print(f'\nsocketcan: {layout} on vcan: {sent} TPDOs sent, all received')


#: Program that reads a number from each line, and then sends this many numbered CAN frames.
SENDER = """
import socket, struct, sys
bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
bus.bind(('vcan0',))
for line in sys.stdin:
    for number in range(int(line)):
        bus.send(struct.pack('=IB3x8s', 0x1A0, 8, number.to_bytes(8, 'big')))
    print('sent', flush=True)
"""
ORDINARY = 212_992  # Largest size that an ordinary user may set by default [bytes]. The kernel doubles it.


@pytest.mark.parametrize(('size', 'sent', 'keeps_lock', 'is_whole'), [
    (WANTED_SIZE, 8000, False, True),  # 1 s of a full bus
    (ORDINARY, 320, True, True),       # 100 ms of two pads of 16x16 at 50 Hz
    (4096, 1000, False, False),
    (4096, 1000, True, False)])
def test_frames_of_a_stall_are_received_in_order_or_counted(size, sent, keeps_lock, is_whole):
    """The reception, or with ``keeps_lock`` the whole interpreter, stands still until all frames are sent."""
    bus, batches, released = open_bus('socketcan', 'vcan0', 1_000_000), [], threading.Event()

    def receive(batch):
        batches.append(batch)
        assert keeps_lock or released.wait(LONGEST)
    network = BusNetwork(bus, receive, lambda fault, error: batches.append(error))
    if size != WANTED_SIZE:
        bus.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, size)
    with subprocess.Popen([sys.executable, '-ISc', SENDER], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as sender:
        sender.stdin.write(b'1\n')
        sender.stdin.flush()
        assert sender.stdout.readline() == b'sent\n' and wait_until(lambda: batches, LONGEST)
        sender.stdin.write(b'%d\n' % sent)
        sender.stdin.flush()
        if keeps_lock:
            assert ctypes.PyDLL(None).read(sender.stdout.fileno(), ctypes.create_string_buffer(5), 5) == 5
        else:
            assert sender.stdout.readline() == b'sent\n'
        released.set()
        # This frame finds room in the buffer once the reception has begun to read.
        assert wait_until(lambda: len(batches) > 1, LONGEST)
        sender.communicate(b'1\n', LONGEST)
    wait_until(lambda: sum(len(batch.messages) + batch.dropped for batch in batches) >= sent + 2, LONGEST)
    network.close()
    numbers = [int.from_bytes(message.data, 'big') for batch in batches for message in batch.messages]
    dropped = sum(batch.dropped for batch in batches)
    print(f'\nsocketcan: buffer {size}: {sent} sent during a stall, {dropped} dropped by the kernel')
    assert len(numbers) + dropped == sent + 2 and (dropped == 0) == is_whole
    assert numbers[1:-1] == sorted(set(numbers[1:-1]))


def test_a_polled_domain_is_read_through_linux():
    with Driven('vcan0', 'vcan0', 'domain16x10_16bit.yaml') as bench:
        bench.wait(lambda: sum(not frame.missing_can_frames for frame in bench.kept) >= 5, 'too few whole frames')
        bench.check()


def test_network_down_and_up_again(controllers):
    """While the interface is down, the driver reports ENETDOWN and publishes no values.

    After the interface is up again, the driver publishes whole frames.
    """
    with Driven('can0', 'can1') as bench:
        ip('can0', 'down')
        down = time.time()
        bench.wait(lambda: bench.driver.failure is not None, 'not noticed')
        bench.wait(lambda: any(isinstance(fact, BusFault) for fact in bench.log.facts), 'not reported')
        time.sleep(1)
        # While the bus is down, no frame may contain values.
        assert not any(np.isfinite(frame.values).any() for frame in bench.kept if frame.stamp > down), 'the bus is down'
        ip('can0', 'up')
        up = time.time()
        bench.wait(lambda: bench.whole_after(up), 'no whole frames again')
        print(f'\nsocketcan: whole frames {time.time() - up:.2f} s after can0 was up again')
        assert bench.driver.facts().outages == 1
        bench.check()


def test_bus_off_reported_by_the_stack():
    """A controller's kernel driver reports bus-off with an error frame that has the flag CAN_ERR_BUSOFF.

    After bus-off, our driver opens the bus again and publishes taxels.
    """
    with Driven('vcan0', 'vcan0') as bench, can.Bus('vcan0', interface='socketcan') as other:
        other.send(can.Message(arbitration_id=BUS_OFF, is_error_frame=True, is_extended_id=False, data=bytes(8)))
        begun = time.time()
        bench.wait(lambda: BusFault.BUS_OFF in bench.log.facts, 'not reported')
        bench.wait(lambda: bench.whole_after(begun) and bench.driver.failure is None, 'no whole frames again')
        print(f'\nsocketcan: whole frames {time.time() - begun:.2f} s after bus-off')
        bench.check()


def test_interface_that_is_down_or_absent_is_an_error_with_a_name():
    for channel in ('can1', 'can7'):
        driver = Supervisor(BusSettings('socketcan', channel), (make_pad('pad32', 32, 'sim8x8_16bit.yaml'),),
                            lambda *_: None)
        with pytest.raises(BusError, match=channel):
            driver.open()
            driver.configure()
        driver.close()


def test_a_serial_port_whose_bytes_stay_in_the_kernel_holds_nobody_up():
    """A pseudo-terminal has no such bytes, so only a real port shows that the driver does not wait in ``tcdrain``."""
    bus = open_bus('slcan', '/dev/ttyS1', 1_000_000)
    termios.tcflow(bus.serialPortOrig.fd, termios.TCOOFF)
    message, failures = can.Message(arbitration_id=0x80, is_extended_id=False), []

    def use() -> None:
        for call in (lambda: bus.send(message), bus.shutdown):
            try:
                call()
            except can.CanError as error:
                failures.append(str(error))
    thread = threading.Thread(target=use, daemon=True)
    thread.start()
    thread.join(LONGEST)
    assert not thread.is_alive() and len(failures) == 2
    assert all('takes no data' in failure for failure in failures)
