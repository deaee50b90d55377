"""Finds a serial adapter again by its USB identity: plugged in again, it may have another device name."""

import logging
import os
from typing import NamedTuple

from tactile_node.errors import BusError

logger = logging.getLogger(__name__)


class UsbIdentity(NamedTuple):
    """What a USB device says of itself."""

    vendor: int
    product: int
    serial_number: str  #: '': it has none
    interface: str  #: which one, where an adapter has several ports; '': it has one
    place: str  #: bus and ports to it; '' where the serial number is enough

    def __str__(self) -> str:
        which = f'at {self.place}' if self.place else f'serial number {self.serial_number}'
        return f'USB {self.vendor:04x}:{self.product:04x}, {which}{self.interface and " " + self.interface}'


class UsbPort:
    """A serial port, '@' and its bit rate included, whose adapter is remembered when it is first opened.

    From then on only this adapter is opened, under whatever name it has: another one is another bus.
    """

    def __init__(self, channel: str):
        self._channel = channel
        self._path, self._at, self._rate = channel.partition('@')
        self._adapter: UsbIdentity | None = None
        self._found = ''  # the name it had last, where that is another one

    def channel(self) -> str:
        """Return the channel to open now. Raises BusError where another adapter has its name."""
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
            raise BusError(f'serial port {self._path}', expected=f'the adapter that it was ({self._adapter})',
                           got=f'another one ({named})',
                           remedy='Plug the first one in; to use this one, configure the driver again.')
        return self._channel

    def opened(self) -> None:
        """Remember its adapter; by its place where it has no serial number, or another one has the same."""
        if self._adapter is None:
            path, ports = os.path.realpath(self._path), _usb_ports()
            adapter = ports.get(path)
            if adapter is not None and not (adapter.serial_number and list(ports.values()).count(adapter) == 1):
                adapter = _usb_ports(needs_place=True).get(path)
            self._adapter = adapter


def _usb_ports(needs_place: bool = False) -> dict[str, UsbIdentity]:
    """The USB serial ports of this machine, by device file; none without pyserial."""
    try:
        from serial.tools import list_ports
    except ImportError:
        return {}
    found = {}
    for port in list_ports.comports():
        if port.vid is not None and port.pid is not None:
            place, _, interface = (port.location or '').partition(':')  # '1-2', or '1-2:1.0' of several interfaces
            found[os.path.realpath(port.device)] = UsbIdentity(
                port.vid, port.pid, port.serial_number or '', interface, place if needs_place else '')
    return found
