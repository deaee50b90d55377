"""How many bits a CAN frame takes on the wire (ISO 11898-1, classical frames; Bosch CAN 2.0), stuff bits included."""

from collections.abc import Callable
from enum import Enum
from functools import lru_cache
from typing import NamedTuple

#: CRC delimiter, ACK slot and its delimiter, end of frame, and the three bits between two frames: never stuffed
UNSTUFFED_BITS = 1 + 2 + 7 + 3
CRC_BITS, CRC_POLYNOMIAL = 15, 0x4599
STUFFED_RUN = 5  #: equal bits after which the transmitter adds one of the other value
MAX_DATA_BYTES = 8


class Stuffing(Enum):
    """Which stuff bits count."""

    WORST = 'worst'  #: the most that a frame of this length can have
    TRUE = 'true'    #: those that this frame has


class Frame(NamedTuple):
    """A classical CAN frame. A remote one has no data and asks for ``requested`` bytes."""

    can_id: int
    data: bytes = b''
    is_extended: bool = False
    is_remote: bool = False
    requested: int = 0

    @property
    def dlc(self) -> int:
        return self.requested if self.is_remote else len(self.data)


def arbitration(frame: Frame) -> int:
    """The arbitration field as a number: the lowest wins.

    A standard frame wins over an extended one of the same eleven first bits, a data frame over its remote one.

    >>> frames = [Frame(0x100 << 18, is_extended=True), Frame(0x100, is_remote=True), Frame(0x101), Frame(0x100)]
    >>> [frames.index(frame) for frame in sorted(frames, key=arbitration)]
    [3, 1, 0, 2]
    """
    if not frame.is_extended:
        return frame.can_id << 21 | frame.is_remote << 20
    base, rest = frame.can_id >> 18, frame.can_id & 0x3FFFF
    return base << 21 | 0b11 << 19 | rest << 1 | frame.is_remote


def worst_case_bits(frame: Frame) -> int:
    """
    >>> worst_case_bits(Frame(0x080)), worst_case_bits(Frame(0x1A0, bytes(8)))
    (55, 135)
    """
    stuffed = (39 if frame.is_extended else 19) + 8 * len(frame.data) + CRC_BITS
    return stuffed + (stuffed - 1) // 4 + UNSTUFFED_BITS


def true_bits(frame: Frame) -> int:
    """With the stuff bits of exactly this identifier, these data and their CRC.

    >>> true_bits(Frame(0x080)), true_bits(Frame(0x2AA, bytes([0x55] * 8)))
    (51, 111)
    """
    crc, state, bits = _header(frame.can_id, frame.is_extended, frame.is_remote, frame.dlc)
    for byte in frame.data:
        crc = CRC_OF_BYTE[crc >> 7 ^ byte] ^ crc << 8 & 0x7FFF
        state, added = STUFF_BYTE[state][byte]
        bits += 8 + added
    state, added = STUFF_SEVEN[state][crc >> 8]
    return bits + added + STUFF_BYTE[state][crc & 0xFF][1] + CRC_BITS + UNSTUFFED_BITS


def bits_of(stuffing: Stuffing) -> Callable[[Frame], int]:
    """The function that counts them."""
    return worst_case_bits if stuffing is Stuffing.WORST else true_bits


def crc15(bits: int, width: int, crc: int = 0) -> int:
    """Return the CRC of the last ``width`` bits of the number ``bits``, the highest first."""
    for place in reversed(range(width)):
        is_fed_back = bits >> place & 1 ^ crc >> CRC_BITS - 1
        crc = crc << 1 & 0x7FFF ^ CRC_POLYNOMIAL * is_fed_back
    return crc


def _stuffed(bits: int, width: int, state: int) -> tuple[int, int]:
    """The state after these bits, and the stuff bits that they caused. A state: 2 x equal bits so far + their value."""
    added = 0
    for place in reversed(range(width)):
        bit = bits >> place & 1
        run = (state >> 1) + 1 if bit == state & 1 else 1
        if run == STUFFED_RUN:  # the bit that is added begins the next run
            bit, run, added = 1 - bit, 1, added + 1
        state = run << 1 | bit
    return state, added


@lru_cache(maxsize=4096)
def _header(can_id: int, is_extended: bool, is_remote: bool, dlc: int) -> tuple[int, int, int]:
    """CRC, state and bits after start of frame, arbitration and control field."""
    if is_extended:  # ..., SRR and IDE recessive, 18 bits, RTR, r1, r0, DLC
        bits, width = ((can_id >> 18) << 20 | 0b11 << 18 | can_id & 0x3FFFF) << 7 | is_remote << 6 | dlc, 39
    else:            # start of frame, 11 bits, RTR, IDE, r0, DLC
        bits, width = can_id << 7 | is_remote << 6 | dlc, 19
    state, added = _stuffed(bits, width, 0)
    return crc15(bits, width), state, width + added


STATES = range(2 * STUFFED_RUN)
CRC_OF_BYTE = tuple(crc15(byte, 8) for byte in range(256))
STUFF_BYTE = tuple(tuple(_stuffed(byte, 8, state) for byte in range(256)) for state in STATES)
STUFF_SEVEN = tuple(tuple(_stuffed(bits, 7, state) for bits in range(128)) for state in STATES)
