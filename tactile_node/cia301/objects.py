"""Define facts from CiA 301 and CiA 306: node-IDs, COB-IDs, objects, PDO and NMT."""

import re
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

MIN_NODE_ID = 1
MAX_NODE_ID = 127
ALL_NODES = 0  #: node-ID with which an NMT command addresses all nodes

#: bit rates defined by CiA 301 (5.4) [bit/s]; earlier versions also define 100,000
BIT_RATES = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)


DISABLED = 1 << 31  #: bit "PDO does not exist" in sub-index 1 of the PDO communication record (CiA 301)
NO_RTR = 1 << 30  #: bit "no remote request allowed" in sub-index 1 of the PDO communication record (CiA 301)
PRODUCES_SYNC = 1 << 30  #: bit in object 0x1005 that is set if the device produces SYNC
SYNC_ID_MASK = (1 << 30) - 1  #: mask in object 0x1005 for the identifier and bit 29, which marks a 29-bit identifier
ID_MASK = 0x7FF  #: mask and largest value of an 11-bit identifier

_OCTAL = re.compile(r'(?<![\w.])0+([0-7]+)(?![\w.])')


def read_octal(written: str) -> str:
    """Return a number, or a sum of numbers, in Python's notation. In CiA 306, an octal number has a leading 0, as in C.

    >>> read_octal('$NODEID+0600'), read_octal('0x080'), read_octal('0')
    ('$NODEID+0o600', '0x080', '0')
    """
    return _OCTAL.sub(r'0o\1', written)


_TERM = re.compile(r'\$NODEID|0X[0-9A-F]+|[0-9]+')


class CobId(NamedTuple):
    """An 11-bit COB-ID, given as a number or as '$NODEID+0x180' (CiA 306)."""

    base: int
    relative: bool  #: True if the node-ID must be added to ``base``

    def of(self, node_id: int) -> int:
        return self.base + (node_id if self.relative else 0)

    def __str__(self) -> str:
        return f'{"$NODEID+" if self.relative else ""}0x{self.base:03X}'


def parse_cob_id(written: int | str) -> CobId:
    """Read a COB-ID: a number, '0x1A0', '$NODEID+0x180' or '0x180 + $NodeID'. Raise ValueError for any other text.

    >>> parse_cob_id('$NODEID+0x180').of(32) == 0x1A0
    True
    """
    if isinstance(written, bool) or not isinstance(written, (int, str)):
        raise ValueError(written)
    terms = str(written).replace(' ', '').upper().split('+')
    if not all(_TERM.fullmatch(term) for term in terms) or terms.count('$NODEID') > 1:
        raise ValueError(written)
    base = sum(int(read_octal(term), 0) for term in terms if term != '$NODEID')
    if not 0 <= base <= ID_MASK:
        raise ValueError(written)
    return CobId(base, '$NODEID' in terms)


DEVICE_TYPE = 0x1000
ERROR_REGISTER = 0x1001
ERROR_FIELD = 0x1003  #: sub-index 0: number of errors; sub-index 1: newest error
COB_ID_SYNC = 0x1005
DEVICE_NAME = 0x1008
HARDWARE_VERSION = 0x1009
SOFTWARE_VERSION = 0x100A
STORE_PARAMETERS = 0x1010  #: sub 1: all, sub 2: communication, sub 3: application
RESTORE_PARAMETERS = 0x1011  #: sub 1: all, sub 2: communication, sub 3: application
PRODUCER_HEARTBEAT_TIME = 0x1017
IDENTITY = 0x1018  #: sub 1: vendor, sub 2: product, sub 3: revision, sub 4: serial number
TPDO_COMMUNICATION = 0x1800  #: communication record of TPDO 1; sub-index 1: COB-ID, sub-index 2: transmission type

#: mapping record of TPDO 1; sub-index 0: number of mapped objects, then index, sub-index and number of bits of each
TPDO_MAPPING = 0x1A00
MAX_TPDOS = 512  #: largest number of TPDOs of one node
COMMUNICATION_RECORDS = range(TPDO_COMMUNICATION, TPDO_COMMUNICATION + MAX_TPDOS)
MAPPING_RECORDS = range(TPDO_MAPPING, TPDO_MAPPING + MAX_TPDOS)

MAX_INDEX = 0xFFFF
MAX_SUBINDEX = 0xFE


FIRST_INDEX = 0x1000  #: lower indices are data types (CiA 301, 7.4.1), which no SDO server provides
_ADDRESS = re.compile(r'(0x[0-9a-f]+|[0-9]{5,})(?::(0x[0-9a-f]+|[0-9]+))?', re.IGNORECASE)


@dataclass(frozen=True)
class ObjectAddress:
    """Address of one value in a device; ``sub`` is 0 for an object without sub-indices."""

    index: int
    sub: int

    def __str__(self) -> str:
        return f'0x{self.index:04X} sub {self.sub}'


def parse_address(written: str) -> ObjectAddress:
    """Return the address for '0x1018:1', '0x1018:0x01' or '25601:16'. Raise ValueError for any other text.

    Manuals write an index as four hexadecimal digits. The function rejects four digits without 0x, because they could
    be decimal or hexadecimal:

    >>> parse_address('0x6401:16'), parse_address('25601:0x10')
    (ObjectAddress(index=25601, sub=16), ObjectAddress(index=25601, sub=16))
    >>> parse_address('6401')
    Traceback (most recent call last):
    ValueError: 6401
    """
    match = _ADDRESS.fullmatch(written.strip())
    if match is None:
        raise ValueError(written)
    address = ObjectAddress(int(match[1], 0), int(match[2] or '0', 0))
    if not (FIRST_INDEX <= address.index <= MAX_INDEX and address.sub <= MAX_SUBINDEX):
        raise ValueError(written)
    return address


MAX_PDO_BYTES = 8  #: largest number of data bytes in a classical CAN frame
MAX_PDO_BITS = 8 * MAX_PDO_BYTES

# Transmission types
TRANSMISSION_TYPE = 2  #: sub-index of the transmission type in the communication record
EVERY_SYNC = 1  #: transmission type "at every SYNC"; 2..240 means at every 2nd..240th SYNC
MAX_SYNCHRONOUS = 240
#: transmission type for an event that the maker defines; CiA 301 requires 254 or 255 for an MPDO
MANUFACTURER_EVENT = 254
PROFILE_EVENT = 255  #: transmission type for an event that the device profile defines

# Transmission times in the communication record (CiA 301, 7.5.2.37)
INHIBIT_TIME = 3  #: sub-index of the shortest time between two transmissions of one TPDO
INHIBIT_UNIT = 1e-4  #: resolution of the inhibit time [s]
EVENT_TIMER = 5  #: sub-index of the event timer, the longest time between two transmissions; 0 disables the timer
EVENT_TIMER_UNIT = 1e-3  #: resolution of the event timer [s]
MAX_TIME = 0xFFFF  #: largest value of an inhibit time or event timer, in units of its resolution

# A multiplexed PDO in source addressing mode carries a node-ID, the index and sub-index of one object, and the value of
# the object.

#: value of sub-index 0 in the mapping record that marks an MPDO, instead of the number of mapped objects
SAM_MPDO = 0xFE
MPDO_DATA_BITS = 32


class NmtCommand(IntEnum):
    """Byte 0 of an NMT command; byte 1 is the node-ID."""

    START = 0x01
    STOP = 0x02
    ENTER_PRE_OPERATIONAL = 0x80
    RESET_NODE = 0x81
    RESET_COMMUNICATION = 0x82


class NmtState(IntEnum):
    """NMT state of a node, as reported in its heartbeat."""

    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


def command_name(command: int) -> str:
    """Return the name of an NMT command, such as 'enter pre-operational'.

    The name is 'command 0x..' if CiA 301 does not define the command.
    """
    if command not in NmtCommand.__members__.values():
        return f'command 0x{command:02X}'
    return NmtCommand(command).name.lower().replace('_', ' ').replace('pre ', 'pre-')


def state_name(state: int | None) -> str:
    """Return the name that CiA 301 gives an NMT state, such as 'PRE-OPERATIONAL', or 'never heard' for None."""
    if state is None:
        return 'never heard'
    known = state in NmtState.__members__.values()
    return NmtState(state).name.replace('_', '-') if known else f'unknown NMT state 0x{state:02X}'


AUTO_ZERO = 0x6125  #: object "AI autozero", write-only, with one sub-index per channel (CiA 404)
ZERO_SIGNATURE = b'zero'  #: value written to AUTO_ZERO: 0x6F72657A, least significant byte first


NMT = 0x000
SYNC = 0x080  #: default COB-ID of SYNC; object 0x1005 can change it
TIME = 0x100
# Base COB-IDs to which the node-ID is added:
EMCY = 0x080
SDO_RESPONSE = 0x580  #: server to client
SDO_REQUEST = 0x600  #: client to server
HEARTBEAT = 0x700  #: base COB-ID of heartbeats, boot-up messages and node guarding


class CanIdRange(NamedTuple):
    first: int
    last: int
    use: str


def _of_nodes(base: int, use: str) -> CanIdRange:
    return CanIdRange(base + MIN_NODE_ID, base + MAX_NODE_ID, use)


#: CAN services, and the names under which their frames are counted
SERVICES = (CanIdRange(NMT, NMT, 'nmt'), _of_nodes(EMCY, 'emcy'), CanIdRange(TIME, TIME, 'time'),
            _of_nodes(SDO_RESPONSE, 'sdo'), _of_nodes(SDO_REQUEST, 'sdo'), _of_nodes(HEARTBEAT, 'heartbeat'))

#: table "Restricted CAN-IDs" of CiA 301; neither a PDO nor SYNC may use these identifiers
RESERVED = (
    CanIdRange(NMT, NMT, 'NMT'), CanIdRange(0x001, 0x07F, 'reserved'), CanIdRange(0x101, 0x180, 'reserved'),
    _of_nodes(SDO_RESPONSE, 'SDO answers'), _of_nodes(SDO_REQUEST, 'SDO requests'),
    CanIdRange(0x6E0, 0x6FF, 'reserved'), _of_nodes(HEARTBEAT, 'NMT error control'),
    CanIdRange(0x780, 0x7FF, 'reserved'))


def node_of(can_id: int, base: int) -> int | None:
    """Return the node-ID in a COB-ID that is the sum of ``base`` and a node-ID, or None for any other COB-ID.

    >>> node_of(0x720, HEARTBEAT), node_of(0x700, HEARTBEAT)
    (32, None)
    """
    node_id = can_id - base
    return node_id if MIN_NODE_ID <= node_id <= MAX_NODE_ID else None


def service_of(can_id: int) -> str:
    """Return the service of a COB-ID that is neither SYNC nor a TPDO of a pad: 'nmt', 'emcy', ..., or 'foreign'."""
    return next((service.use for service in SERVICES if service.first <= can_id <= service.last), 'foreign')


def reserved_for(can_id: int) -> str | None:
    """Return the purpose for which CiA 301 reserves ``can_id``, or None if a PDO may use it."""
    return next((range_.use for range_ in RESERVED if range_.first <= can_id <= range_.last), None)
