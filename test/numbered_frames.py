"""Generator of numbered CAN frames for logs."""

from random import Random

import can


def numbered(count: int) -> list[can.Message]:
    """Return ``count`` CAN frames at intervals of 1 ms. The first four bytes of each frame contain its number."""
    random = Random(3)  # without random bytes, a compressed file would be too small
    return [can.Message(1.7e9 + n / 1000, 0x181, False, data=n.to_bytes(4, 'little') + random.randbytes(4),
                        channel='can0') for n in range(count)]
