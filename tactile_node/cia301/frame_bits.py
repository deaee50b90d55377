"""How many bits a CAN frame takes on the wire at most (ISO 11898-1, classical frames; Bosch CAN 2.0)."""

from functools import lru_cache
from typing import NamedTuple

CRC_BITS = 15
#: CRC delimiter, ACK slot and its delimiter, end of frame, and the three bits between two frames: never stuffed
UNSTUFFED_BITS = 1 + 2 + 7 + 3


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
    """Return the most bits that a frame of this length can take, stuff bits included.

    >>> worst_case_bits(Frame(0x080)), worst_case_bits(Frame(0x1A0, bytes(8)))
    (55, 135)
    """
    stuffed = (39 if frame.is_extended else 19) + 8 * len(frame.data) + CRC_BITS
    return stuffed + (stuffed - 1) // 4 + UNSTUFFED_BITS


@lru_cache(maxsize=256)
def load_bits(size: int, is_extended: bool = False, is_remote: bool = False) -> int:
    """Return the bits that a frame of ``size`` bytes adds to the load of its bus.

    A classical controller has 8 bytes at most, but an adapter may report more.
    """
    return worst_case_bits(Frame(0, b'' if is_remote else bytes(min(size, 8)), is_extended))
