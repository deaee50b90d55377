"""The driver finds a serial adapter again by its USB identity, and never mistakes another adapter for it."""

import gc
import os
from types import SimpleNamespace

import numpy as np
import pytest
from serial.tools import list_ports
from waiting import wait_until

from tactile_node.bus.bus_network import BusNetwork
from tactile_node.bus.bus_settings import BusSettings
from tactile_node.bus.open_bus import open_bus
from tactile_node.bus.usb_port import UsbPort
from tactile_node.errors import BusError
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.simulator.slcan_pty import SlcanPty
from tactile_node.skin.pads import make_pads, with_dictionaries
from tactile_node.sources.supervisor import Supervisor

OF_PTY = 2  # A pseudo-terminal has one file descriptor at each end.
PADS = with_dictionaries(make_pads(['sim8x8_16bit.yaml'], [32]))


def usb(device, serial_number: str | None = 'A1', location='1-2', vid=0x16D0, pid=0x117E):
    """Return a USB adapter as pyserial would list it."""
    return SimpleNamespace(device=str(device), vid=vid, pid=pid, serial_number=serial_number, location=location)


def descriptors() -> int:
    gc.collect()  # Garbage collection closes the descriptors of earlier tests.
    return len(os.listdir('/proc/self/fd'))


@pytest.fixture
def plugged(monkeypatch):
    """Return the list of connected adapters."""
    ports = [SimpleNamespace(device='/dev/ttyS0', vid=None, pid=None, serial_number=None, location=None)]
    monkeypatch.setattr(list_ports, 'comports', lambda: list(ports))
    return ports


def opened(plugged, *adapters, channel='/dev/ttyACM0@115200') -> UsbPort:
    """Return a port that was opened while ``adapters`` were connected. The adapters are disconnected afterwards."""
    plugged += adapters
    port = UsbPort(channel)
    assert port.channel() == channel
    port.opened()
    del plugged[1:]
    return port


def test_its_adapter_is_opened_under_its_new_name_with_the_same_bit_rate(plugged):
    port = opened(plugged, usb('/dev/ttyACM0'))
    assert port.channel() == '/dev/ttyACM0@115200'
    plugged += [usb('/dev/ttyACM2', 'B7'), usb('/dev/ttyACM1')]
    assert port.channel() == '/dev/ttyACM1@115200'
    plugged.append(usb('/dev/ttyACM0', 'C3'))  # Another adapter now has the first adapter's old name.
    assert port.channel() == '/dev/ttyACM1@115200'


def test_another_adapter_under_its_name_is_another_bus(plugged):
    port = opened(plugged, usb('/dev/ttyACM0'))
    plugged.append(usb('/dev/ttyACM0', 'B7'))
    with pytest.raises(BusError, match='B7'):
        port.channel()


@pytest.mark.parametrize('serial_number', [None, '0001'])
def test_the_port_decides_between_two_indistinguishable_adapters(plugged, serial_number):
    first, second = usb('/dev/ttyACM0', serial_number, '1-2'), usb('/dev/ttyACM1', serial_number, '1-3')
    port = opened(plugged, first, second)
    plugged.append(second)
    assert port.channel() == '/dev/ttyACM0@115200'  # The named adapter is not connected, so the port waits for it.
    plugged.append(usb('/dev/ttyACM5', serial_number, '1-2'))
    assert port.channel() == '/dev/ttyACM5@115200'


def test_the_same_port_of_an_adapter_with_two_ports_is_opened(plugged):
    port = opened(plugged, usb('/dev/ttyACM0', location='1-2:1.0'), usb('/dev/ttyACM1', location='1-2:1.2'))
    plugged += [usb('/dev/ttyACM2', location='1-4:1.2'), usb('/dev/ttyACM3', location='1-4:1.0')]
    assert port.channel() == '/dev/ttyACM3@115200'


def test_a_port_that_is_not_a_usb_device_keeps_its_name(plugged):
    port = opened(plugged, usb('/dev/ttyACM0'), channel='/dev/ttyS0')
    plugged.append(usb('/dev/ttyACM1'))
    assert port.channel() == '/dev/ttyS0'


def test_a_pulled_adapter_is_closed_for_certain(tmp_path):
    """Closing must close both the port and pyserial's pipes.

    The kernel reuses the name of a port only after the port has been closed. The test does not open the old name again,
    because a parallel test may already use it.
    """
    pty = SlcanPty()
    # This object stands in for the adapter.
    adapter = BusNetwork(pty, lambda message: None, lambda fault, error: None)
    before = descriptors()
    bus = open_bus('slcan', pty.port, 1_000_000)
    assert descriptors() > before
    network = BusNetwork(bus, lambda message: None, lambda fault, error: None)
    adapter.close()
    network.close()
    assert descriptors() == before - OF_PTY
    with pytest.raises(BusError):
        open_bus('slcan', str(tmp_path / 'gone'), 1_000_000)
    assert descriptors() == before - OF_PTY


@pytest.mark.bus
def test_an_adapter_that_was_pulled_out_is_used_under_its_new_name(plugged):
    def plug() -> tuple[SkinSimulator, str]:
        pty = SlcanPty()
        simulator = SkinSimulator(PADS, {'pad32': lambda t: np.full((8, 8), 12.5)})
        simulator.start_on(pty)
        plugged.append(usb(pty.port))
        return simulator, pty.port

    frames, before = [], descriptors()
    simulator, port = plug()
    driver = Supervisor(BusSettings('slcan', port, sync_period=0.05), PADS, lambda _, frame: frames.append(frame))

    def is_whole_after(count: int) -> bool:
        return any(not frame.missing_can_frames for frame in frames[count:])
    held = []
    try:
        driver.open()
        driver.configure()
        driver.start()
        assert wait_until(lambda: is_whole_after(0))
        plugged[1:] = [usb(port, 'B7')]  # From now on, the kernel may give the adapter's old name to any process.
        simulator.stop()
        assert wait_until(lambda: driver.failure is not None)
        held.append(os.openpty())  # This process takes the old name, unless another process has taken it first.
        simulator, new = plug()
        assert new != port
        count = len(frames)
        assert wait_until(lambda: is_whole_after(count + 2) and driver.failure is None)
    finally:
        driver.close()
        simulator.stop()
        for pair in held:
            for descriptor in pair:
                os.close(descriptor)
    assert descriptors() == before and driver.facts().outages == 1
    assert all((np.diff([getattr(frame, key) for frame in frames]) > 0).all() for key in ('sequence', 'stamp'))
    assert all(np.allclose(frame.values[np.isfinite(frame.values)], 12.5) for frame in frames)
