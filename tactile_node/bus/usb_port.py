"""Find a serial adapter by its USB identity, because its device name may change when it is plugged in again."""

import logging
import os
from typing import NamedTuple

from tactile_node.errors import BusError

logger = logging.getLogger(__name__)


class UsbIdentity(NamedTuple):
    """Identity of a USB serial port."""

    vendor: int  #: vendor ID
    product: int  #: product ID
    serial_number: str  #: serial number; '' if the device has none
    interface: str  #: interface of this port if the adapter has several, else ''
    place: str  #: USB bus and ports that lead to the device; '' if the serial number identifies the device

    def __str__(self) -> str:
        which = f'at {self.place}' if self.place else f'serial number {self.serial_number}'
        return f'USB {self.vendor:04x}:{self.product:04x}, {which}{self.interface and " " + self.interface}'


class UsbPort:
    """A serial port whose adapter is remembered when the port is first opened.

    Later calls open only this adapter, even if its device name has changed. Another adapter would belong to another
    bus.

    Parameters
    ----------
    channel : str
        Device file of the port, optionally followed by '@' and the baud rate.
    """

    def __init__(self, channel: str):
        self._channel = channel
        self._path, self._at, self._rate = channel.partition('@')
        self._adapter: UsbIdentity | None = None
        self._found = ''  # last device name of the adapter if it differs from the given name

    def channel(self) -> str:
        """Return the channel to open now.

        Raise BusError if the given name belongs to another adapter and the remembered adapter is not present.
        """
        if self._adapter is None:
            return self._channel
        ports = _usb_ports(needs_place=bool(self._adapter.place))
        named = ports.get(os.path.realpath(self._path))
        if named == self._adapter:
            return self._channel
        found = next((path for path, identity in ports.items() if identity == self._adapter), None)
        if found is not None:
            if found != self._found:
                logger.info('The adapter of %s (%s) is now %s.', self._path, self._adapter, found)
            self._found = found
            return found + self._at + self._rate
        if named is not None:
            raise BusError(f'serial port {self._path}', expected=f'the same adapter as before ({self._adapter})',
                           got=f'another one ({named})',
                           remedy='Plug in the adapter used before. To use the new one, configure the driver again.')
        return self._channel

    def opened(self) -> None:
        """Remember the adapter of the port when the port is opened for the first time.

        If the adapter has no serial number, or shares it with another adapter, its USB location is also remembered.
        """
        if self._adapter is None:
            path, ports = os.path.realpath(self._path), _usb_ports()
            adapter = ports.get(path)
            if adapter is not None and not (adapter.serial_number and list(ports.values()).count(adapter) == 1):
                adapter = _usb_ports(needs_place=True).get(path)
            self._adapter = adapter


def _usb_ports(needs_place: bool = False) -> dict[str, UsbIdentity]:
    """Return the USB serial ports of this host, by device file. If pyserial is not installed, the result is empty."""
    try:
        from serial.tools import list_ports
    except ImportError:
        return {}
    found = {}
    for port in list_ports.comports():
        if port.vid is not None and port.pid is not None:
            place, _, interface = (port.location or '').partition(':')  # '1-2', or '1-2:1.0'
            found[os.path.realpath(port.device)] = UsbIdentity(
                port.vid, port.pid, port.serial_number or '', interface, place if needs_place else '')
    return found
