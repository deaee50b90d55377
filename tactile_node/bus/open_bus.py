"""Open a python-can bus, and explain how to remedy a bus that cannot be opened."""

import errno
from difflib import get_close_matches
from typing import Any

import can

from tactile_node.bus.slcan_bus import BulkSlcanBus, PortInUseError
from tactile_node.cia301.objects import BIT_RATES
from tactile_node.errors import BusError, ConfigurationError

_REMEDIES = {
    'socketcan': 'Check that the interface is up: "ip link" lists all interfaces, "ip link set {channel} up type can '
                 'bitrate {bitrate}" brings it up.',
    'slcan': 'Check the device path, and check that you have permission to open it (group dialout).',
    'kvaser': 'Use the interface socketcan with the Linux driver kvaser_usb. On Linux, python-can 4.6 cannot open an '
              'adapter through CANlib (docs/adapters.md).',
    'pcan': 'Use the interface socketcan with the Linux driver peak_usb, or install PCAN-Basic (docs/adapters.md).'}
_REMEDY_IN_USE = ('Only one program can use a serial port. Close the other program. If it is the driver, let the '
                  'driver record (tactile bringup --record FILE), and view its topics (tactile view). If the adapter '
                  'hangs, plug it in again.')
#: Manufacturer's library that python-can loads, by interface.
_LIBRARIES = {'kvaser': 'CANlib', 'pcan': 'PCAN-Basic'}


def check_bit_rate(bitrate: int) -> None:
    """Raise ConfigurationError if ``bitrate`` [bit/s] is not a standard CANopen bit rate (CiA 301)."""
    if bitrate not in BIT_RATES:
        raise ConfigurationError('bitrate', expected=f'one of {", ".join(map(str, BIT_RATES))} bit/s', got=str(bitrate),
                                 remedy='Give the bit rate to which the devices are set.')


def open_bus(interface: str, channel: str, bitrate: int, **options: Any) -> can.BusABC:
    """Open a python-can bus.

    Parameters
    ----------
    interface : str
        python-can interface name, such as 'socketcan' or 'slcan'.
    channel : str
        Channel of the interface, such as 'can0' or '/dev/ttyACM0'.
    bitrate : int
        Bit rate to which the devices are set [bit/s].
    **options
        Further options for python-can.

    Raises
    ------
    ConfigurationError
        Raised if python-can does not know the interface or the bit rate is not standard.
    BusError
        Raised if the bus cannot be opened.
    """
    check_bit_rate(bitrate)
    if interface not in can.VALID_INTERFACES:
        close = get_close_matches(interface.lower(), can.VALID_INTERFACES, n=1)
        raise ConfigurationError('CAN interface', expected=f'one of {", ".join(sorted(can.VALID_INTERFACES))}',
                                 got=repr(interface),
                                 remedy=f'Did you mean "{close[0]}"?' if close else 'Name one of these.')
    try:
        if interface == 'slcan':
            return BulkSlcanBus(channel, bitrate=bitrate, **options)
        return can.Bus(interface=interface, channel=channel, bitrate=bitrate, ignore_config=True, **options)
    except Exception as error:
        # The exception type depends on the python-can backend: CanError, OSError, ValueError, ImportError or NameError.
        is_without_library = interface in _LIBRARIES and isinstance(error, (NameError, OSError))
        raise BusError(f'CAN bus {interface} {channel}', expected=f'a bus that opens at {bitrate} bit/s',
                       got=f'no library {_LIBRARIES[interface]} of its maker' if is_without_library
                       else f'{type(error).__name__}: {error}'.rstrip('.'),
                       remedy=_remedy(interface, channel, error).format(channel=channel, bitrate=bitrate)) from error


def _remedy(interface: str, channel: str, error: Exception) -> str:
    if isinstance(error, (can.CanInterfaceNotImplementedError, ImportError)):
        return 'Check the name, and install what this interface needs (slcan: pyserial).'
    if isinstance(error, PortInUseError):
        return _REMEDY_IN_USE
    if getattr(error, 'errno', None) == errno.EAFNOSUPPORT:
        return 'This kernel has no SocketCAN. Load its modules (modprobe -a can can_raw), or use another interface.'
    if interface == 'socketcan' and channel.startswith('vcan'):
        return ('Check that the interface exists: "ip link add dev {channel} type vcan && ip link set {channel} up" '
                'creates it.')
    return _REMEDIES.get(interface, 'Check interface and channel.')
