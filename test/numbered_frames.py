"""CAN frames with numbers, for logs."""

from random import Random

import can


def numbered(count: int) -> list[can.Message]:
    """Frames 1 ms apart, each with its number in its first four bytes."""
    random = Random(3)  # or a compressed file would stay small
    return [can.Message(1.7e9 + n / 1000, 0x181, False, data=n.to_bytes(4, 'little') + random.randbytes(4),
                        channel='can0') for n in range(count)]
