"""python-can's slcan with bulk reads, for one process at a time, open as soon as the adapter answers.

python-can reads the serial port byte by byte, a system call or two each: two pads at 25 Hz (1600 CAN
frames/s) are too much for it. Reading all that waits takes a fraction of that. python-can also takes what it can of
a damaged line: here each is checked whole.
"""

import os
import time
from collections import deque
from math import inf
from typing import Any

import can
from can.interfaces.slcan import slcanBus
from can.util import CAN_FD_DLC

from tactile_node.bus.reception import Batch

END = b'\r'
#: other ends of a line become END: BELL of a refused command, and LF because some firmware writes CR LF
ENDS = bytes.maketrans(b'\a\n', 2 * END)

LONGEST_LINE = 160  # characters: more than a CAN FD frame takes, so the end of a line is missing
HEXADECIMAL = frozenset('0123456789abcdefABCDEF')
ID_DIGITS = dict.fromkeys('trdb', 3) | dict.fromkeys('TxRDB', 8)  # by the kind of frame; what else comes is none

PROTOCOL_VIOLATION = 0x008  # linux/can/error.h: the frame in a damaged line is lost, as on a damaged wire
WAKE_TIMEOUT = 0.3  # s in which an adapter that is awake answers
RESET_TIME = 2.0  # s that one takes to start which is reset when its port is opened, as an Arduino is


class BulkSlcanBus(slcanBus):
    """An slcan bus as python-can's, with the same options; a damaged line becomes an error frame.

    Unless ``sleep_after_open`` is given, an adapter that does not answer at once is given time to start and opened
    again. Raises CanInitializationError where another process has the port, whose frames would be lost to one of both.
    """

    #: S7 is 800 kbit/s in the protocol (CAN232), which is the bit rate of CiA 301; python-can lists CANable's 750
    _BITRATES = slcanBus._BITRATES | {800_000: 'S7'}

    def __init__(self, channel: str, bitrate: int | None = None, sleep_after_open: float | None = None,
                 listen_only: bool = False, **options: Any):
        self._lines: deque[str] = deque()
        self._asked = self._came_after = -inf  # when what waits was last asked for; after which the lines came
        self._open_command = 'L' if listen_only else 'O'  # python-can 4.3 ignores the option
        self._lock = _lock_port(channel.split('@')[0])
        try:
            super().__init__(channel, bitrate=bitrate, sleep_after_open=sleep_after_open or 0.0,
                             # s that one read of an idle port waits; data wake it at once
                             **{'timeout': 0.002} | options)
            if sleep_after_open is None and not self._is_awake():
                time.sleep(RESET_TIME - WAKE_TIMEOUT)
                self.open() if bitrate is None else self.set_bitrate(bitrate)
        except BaseException:
            self._release()
            raise

    def open(self) -> None:
        """Take part in the bus, or with ``listen_only`` listen."""
        self._write(self._open_command)

    def shutdown(self) -> None:
        """A dead adapter's port is given back too: else it comes back under another name."""
        try:
            super().shutdown()
        finally:
            self._release()

    def _release(self) -> None:
        """Close the port, which python-can leaves open when a command to the adapter fails, and give it free."""
        try:
            port = getattr(self, 'serialPortOrig', None)
            if port is not None:
                port.close()
        finally:
            if self._lock is not None:
                os.close(self._lock)
                self._lock = None

    def _is_awake(self) -> bool:
        """Whether a byte is received soon: an answer, or a frame."""
        self._write('V')
        end = time.monotonic() + WAKE_TIMEOUT
        while not self._buffer and time.monotonic() < end:
            self._buffer += self.serialPortOrig.read(1)
        return bool(self._buffer)

    def recv_all(self, timeout: float) -> Batch:
        """Return the messages that wait, at least one unless none comes within ``timeout`` [s]."""
        self._came_after = self._asked
        if not self._lines:
            self._read_lines(timeout)
        lines, self._lines = self._lines, deque()
        now, read = time.time(), time.monotonic()
        messages = (self._message(line, now) for line in lines)
        return Batch([message for message in messages if message is not None], (self._came_after, read))

    def _read_lines(self, timeout: float | None) -> None:
        """Read all that waits, until there is a line or ``timeout`` [s] is over."""
        end = None if timeout is None else time.monotonic() + timeout
        while not self._lines:
            with can.exceptions.error_check('Could not read from serial device'):
                self._asked = time.monotonic()
                waiting = self.serialPortOrig.in_waiting
                if not waiting and not self._buffer:  # so the next line is not here yet
                    self._came_after = self._asked
                self._buffer += self.serialPortOrig.read(max(1, waiting))
            *lines, rest = self._buffer.translate(ENDS).split(END)
            self._buffer = bytearray(rest)
            if len(rest) > LONGEST_LINE:
                self._buffer.clear()
                self._lines.append('t')  # no frame, but a damaged one
            self._lines += [line.decode('ascii', 'replace') for line in lines if line not in (b'', b'z', b'Z')]
            if end is not None and time.monotonic() >= end:
                return

    def _read(self, timeout: float | None) -> str | None:
        """Give python-can the next line."""
        if not self._lines:
            self._read_lines(timeout)
        return self._lines.popleft() if self._lines else None

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        line = self._read(timeout)
        return None if line is None else self._message(line, time.time()), False

    def _message(self, line: str, now: float) -> can.Message | None:
        """Make the message of a line received ``now`` [s]; None of an answer of the adapter."""
        if not is_sound(line):
            return can.Message(now, PROTOCOL_VIOLATION, is_extended_id=False, is_error_frame=True, data=bytes(8))
        if line[0] == 't':
            return can.Message(now, int(line[1:4], 16), False, data=bytes.fromhex(line[5:5 + 2 * int(line[4])]))
        self._lines.appendleft(line)  # python-can takes it from _read: it has no queue before 4.5
        return super()._recv_internal(0.0)[0]


def _lock_port(port: str) -> int | None:
    """A descriptor that keeps ``port`` from being opened by others that ask (pyserial: exclusive); None: no file."""
    try:
        import fcntl
    except ImportError:  # Windows: it opens a serial port for one process only
        return None
    try:
        descriptor = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        return None  # pyserial reports it
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        raise can.CanInitializationError('another process has this port open') from error
    return descriptor


def is_sound(line: str) -> bool:
    """Whether a line is a whole CAN frame, or none at all (an answer of the adapter).

    >>> is_sound('t1812AABB'), is_sound('t1812AAB'), is_sound('t1812AABBt1812CCDD'), is_sound('V1013')
    (True, False, False, True)
    >>> is_sound('r123a')  # a remote frame of ten bytes
    False
    >>> is_sound('1812AABB')  # without its first letter
    False
    """
    digits = ID_DIGITS.get(line[:1])
    if digits is None:
        return line[:1] in ('', *'VvNFzZ') and len(line) <= 20  # version, serial number, status flags, sent
    body = line[1:]
    if len(body) <= digits or not HEXADECIMAL.issuperset(body):
        return False
    size, can_id = int(body[digits], 16), int(body[:digits], 16)
    if line[0] in 'tTxrR' and size > 8 or can_id > (0x7FF if digits == 3 else 0x1FFF_FFFF):
        return False
    data = 0 if line[0] in 'rR' else CAN_FD_DLC[size]
    return len(body) - digits - 1 - 2 * data in (0, 4)  # digits of the time that some adapters add
