"""Decode EMCY messages (CiA 301, 7.2.7), in which a device reports its errors, and keep the last message."""

import time
from typing import NamedTuple

#: Names of errors (CiA 301, "Emergency error codes"). The most specific known entry names an error. An entry is a full
#: code, a high byte or a class.
_CODES = {
    0x8110: 'CAN overrun, frames lost', 0x8120: 'CAN in error passive mode', 0x8130: 'life guard or heartbeat error',
    0x8140: 'recovered from bus-off', 0x8150: 'CAN-ID collision', 0x8210: 'PDO not processed, wrong length',
    0x8220: 'PDO too long', 0x8230: 'DAM MPDO without its object', 0x8240: 'SYNC of unexpected length',
    0x8250: 'RPDO timeout'}
_HIGH_BYTES = {
    0x00: 'error reset or no error', 0x21: 'current, input side', 0x22: 'current inside the device',
    0x23: 'current, output side', 0x31: 'mains voltage', 0x32: 'voltage inside the device', 0x33: 'output voltage',
    0x41: 'ambient temperature', 0x42: 'device temperature', 0x61: 'internal software', 0x62: 'user software',
    0x63: 'data set', 0x81: 'communication', 0x82: 'protocol error', 0xF0: 'additional functions',
    0xFF: 'specific to the device'}
_CLASSES = {
    0x1: 'generic error', 0x2: 'current', 0x3: 'voltage', 0x4: 'temperature', 0x5: 'device hardware',
    0x6: 'device software', 0x7: 'additional modules', 0x8: 'monitoring', 0x9: 'external error',
    0xF: 'additional or specific to the device'}
#: meaning of each bit in object 0x1001 (CiA 301), starting with bit 0
_REGISTER = ('generic', 'current', 'voltage', 'temperature', 'communication', 'device profile', 'reserved',
             'manufacturer')


class Emergency(NamedTuple):
    """One EMCY. A field is None if the message is too short to contain it."""

    stamp: float  #: time of reception [s, Unix epoch]
    code: int | None
    register: int | None  #: object 0x1001
    manufacturer: bytes

    @property
    def is_reset(self) -> bool:
        """True if the EMCY message reports "error reset" or "no error"."""
        return self.code is not None and self.code >> 8 == 0

    def __str__(self) -> str:
        if self.code is None:
            return 'EMCY too short to hold an error code'
        register = '' if not self.register else f', error register: {_names(self.register)}'
        manufacturer = f', manufacturer {self.manufacturer.hex()}' if any(self.manufacturer) else ''
        return f'EMCY 0x{self.code:04X} ({_meaning(self.code)}){register}{manufacturer}'


def decode_emergency(data: bytes, stamp: float) -> Emergency:
    """Decode an EMCY message of any length. Real devices also send short and even empty EMCY messages.

    >>> str(decode_emergency(bytes.fromhex('1042090000000000'), 0.0))
    'EMCY 0x4210 (device temperature), error register: generic, temperature'
    """
    code = int.from_bytes(data[:2], 'little') if len(data) >= 2 else None
    return Emergency(stamp, code, data[2] if len(data) > 2 else None, bytes(data[3:8]))


class DeviceErrors(NamedTuple):
    """Errors that a device reports when asked by SDO. A field is None or empty if the device did not report it."""

    register: int | None  #: object 0x1001

    #: entries of object 0x1003, newest first; the lower 16 bits hold the error code, the upper 16 bits the maker's code
    field: tuple[int, ...] = ()

    def __str__(self) -> str:
        """Return the errors as text.

        >>> str(DeviceErrors(0x09, (0x0005_4210,))), str(DeviceErrors(None))
        ('error register: generic, temperature; error field: 0x4210 (device temperature)', 'no error register')
        >>> str(DeviceErrors(0))
        'error register: no error'
        """
        register = 'no error register' if self.register is None else (
            f'error register: {_names(self.register) or "no error"}')
        field = ', '.join(f'0x{entry & 0xFFFF:04X} ({_meaning(entry & 0xFFFF)})' for entry in self.field)
        return register + (f'; error field: {field}' if field else '')


class EmergencyLog:
    """Keeps the last EMCY message of one node and counts all its EMCY messages."""

    def __init__(self) -> None:
        self.count = 0
        self.last: Emergency | None = None
        self.active: Emergency | None = None  #: last error that the device has not reset

    def feed(self, _can_id: int, data: bytes) -> None:
        """Process an EMCY.

        If the error register still shows errors when the device reports an error reset, the error stays active (CiA
        301, 7.2.7.1).
        """
        emergency = decode_emergency(data, time.time())
        self.last = emergency
        self.count += 1
        if not emergency.is_reset:
            self.active = emergency
        elif not emergency.register:
            self.active = None

    def booted(self) -> None:
        """Note a boot-up. A device starts without errors and then reports the errors that it finds."""
        self.active = None


def _meaning(code: int) -> str:
    return _CODES.get(code) or _HIGH_BYTES.get(code >> 8) or _CLASSES.get(code >> 12) or 'of no class in CiA 301'


def _names(register: int) -> str:
    return ', '.join(name for bit, name in enumerate(_REGISTER) if register >> bit & 1)
