"""python-can's slcan with bulk reads.

python-can reads the serial port byte by byte, a system call or two each: two pads at 25 Hz (1600 CAN
frames/s) are too much for it. Reading all that waits takes a fraction of that.
"""

import time
from collections import deque

import can
from can.interfaces.slcan import slcanBus

PORT_TIMEOUT = 0.02  # s that one read of an idle port waits; data wake it at once
ENDS = b'\r\a'  # of a line: done, refused
ACKNOWLEDGED = (b'', b'z', b'Z')  # lines that only confirm a frame sent


class BulkSlcanBus(slcanBus):
    """An slcan bus as python-can's, with the same options; a malformed line is skipped."""

    def __init__(self, channel: str, **options: object):
        self._lines: deque[str] = deque()
        super().__init__(channel, **{'timeout': PORT_TIMEOUT} | options)

    def _read(self, timeout: float | None) -> str | None:
        end = None if timeout is None else time.monotonic() + timeout
        while not self._lines:
            with can.exceptions.error_check('Could not read from serial device'):
                self._buffer += self.serialPortOrig.read(max(1, self.serialPortOrig.in_waiting))
            *lines, rest = self._buffer.replace(ENDS[1:], ENDS[:1]).split(ENDS[:1])
            self._buffer = bytearray(rest)
            self._lines += [line.decode('ascii', 'replace') for line in lines if line not in ACKNOWLEDGED]
            if not self._lines and end is not None and time.monotonic() >= end:
                return None
        return self._lines.popleft()

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        try:
            return super()._recv_internal(timeout)
        except (ValueError, IndexError):  # characters lost on the serial line
            return None, False
