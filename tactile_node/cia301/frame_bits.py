"""Compute the largest number of bits that a CAN frame can occupy on the bus.

The rules follow ISO 11898-1 for classical frames (Bosch CAN 2.0).
"""

from functools import lru_cache
from typing import NamedTuple

CRC_BITS = 15
#: number of bits that are never stuffed: CRC delimiter, ACK slot and delimiter, end of frame, 3 bits of interframe
#: space
UNSTUFFED_BITS = 1 + 2 + 7 + 3


class CanFrame(NamedTuple):
    """A classical CAN frame. A remote frame carries no data and requests ``requested`` bytes."""

    can_id: int
    data: bytes = b''
    is_extended: bool = False
    is_remote: bool = False
    requested: int = 0

    @property
    def dlc(self) -> int:
        return self.requested if self.is_remote else len(self.data)


def arbitration(frame: CanFrame) -> int:
    """Return the arbitration field as a number. The frame with the lowest number wins arbitration.

    A standard frame wins over an extended frame whose first eleven bits are equal. A data frame wins over a remote
    frame with the same identifier.

    >>> frames = [CanFrame(0x100 << 18, is_extended=True), CanFrame(0x100, is_remote=True), CanFrame(0x101),
    ...           CanFrame(0x100)]
    >>> [frames.index(frame) for frame in sorted(frames, key=arbitration)]
    [3, 1, 0, 2]
    """
    if not frame.is_extended:
        return frame.can_id << 21 | frame.is_remote << 20
    base, rest = frame.can_id >> 18, frame.can_id & 0x3FFFF
    return base << 21 | 0b11 << 19 | rest << 1 | frame.is_remote


def worst_case_bits(frame: CanFrame) -> int:
    """Return the largest number of bits that a frame of this length can take, including stuff bits.

    >>> worst_case_bits(CanFrame(0x080)), worst_case_bits(CanFrame(0x1A0, bytes(8)))
    (55, 135)
    """
    stuffed = (39 if frame.is_extended else 19) + 8 * len(frame.data) + CRC_BITS
    return stuffed + (stuffed - 1) // 4 + UNSTUFFED_BITS


@lru_cache(maxsize=256)
def load_bits(size: int, is_extended: bool = False, is_remote: bool = False) -> int:
    """Return the number of bits that a frame adds to the bus load.

    Parameters
    ----------
    size
        Number of data bytes. A classical frame has at most 8 bytes, but an adapter may report more.
    is_extended
        True for a 29-bit identifier.
    is_remote
        True for a remote frame, which has no data.
    """
    return worst_case_bits(CanFrame(0, b'' if is_remote else bytes(min(size, 8)), is_extended))
