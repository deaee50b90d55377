"""Extend python-can's slcan bus with bulk reads, checked lines and a locked port.

python-can reads the serial port byte by byte, with one or two system calls per byte. Reading byte by byte is too slow
for two pads at 25 Hz (1600 CAN frames/s). This module reads all waiting bytes at once, which takes a fraction of the
time. python-can also decodes parts of damaged lines. This module accepts a line only if the whole line is valid.
"""

import io
import os
import select
import sys
import threading
import time
from collections import deque
from contextlib import suppress
from math import inf
from typing import Any

import can
from can.interfaces.slcan import slcanBus
from can.util import CAN_FD_DLC
from serial import Serial, SerialException

from tactile_node.bus.batch_reader import Batch
from tactile_node.threads import ReportedThread

#: End of a line. Other line endings are replaced by END: BELL follows a refused command, and some firmware writes CR
#: LF.
END = b'\r'
ENDS = bytes.maketrans(b'\a\n', 2 * END)

#: Longest valid line [characters]. The limit is longer than any CAN FD frame, so a longer line lacks an END.
LONGEST_LINE = 160
HEXADECIMAL = frozenset('0123456789abcdefABCDEF')
ID_DIGITS = dict.fromkeys('trdb', 3) | dict.fromkeys('TxRDB', 8)  #: Number of digits in the identifier, by frame type.

#: Identifier of the error frame that replaces a damaged line (linux/can/error.h).
PROTOCOL_VIOLATION = 0x008
WAKE_TIMEOUT = 0.3  #: Time within which a running adapter answers [s].
RESET_TIME = 2.0  #: Start time of an adapter that resets when its port is opened, such as an Arduino [s].

#: Number of checks, with pauses, after which an adapter that has not taken a frame counts as stuck. A frame takes 2 ms
#: at 115,200 baud. Time would be no measure, because this process may be stopped for seconds.
WRITE_CHECKS = 400
WRITE_PAUSE = 0.5e-3  #: Time between two of these checks [s].
NO_WAIT = 0.0  #: Write timeout with which pyserial writes the bytes that fit, and returns [s].
CLOSE_TIMEOUT = 0.5  #: Longest wait for the port to close [s].


class BulkSlcanBus(slcanBus):
    """An slcan bus that takes the same options as python-can's slcan bus.

    A damaged line is delivered as an error frame.

    If the adapter takes no data, for example because its firmware hangs, sending fails after WRITE_CHECKS checks.
    python-can would wait forever.

    If the adapter does not answer immediately, the bus gives it time to start and then opens it again. If
    ``sleep_after_open`` is given, the bus does not open the adapter a second time.

    Parameters
    ----------
    channel : str
        Serial port, optionally followed by '@' and its baud rate.
    bitrate : int or None
        Bit rate of the CAN bus [bit/s]; None to keep the setting of the adapter.
    sleep_after_open : float or None
        Time to wait after opening the port [s].
    listen_only : bool
        True to send nothing on the bus, not even acknowledgements.
    **options
        Further options of python-can's ``slcanBus``.

    Raises
    ------
    can.CanInitializationError
        Raised if another process has opened the port. If two processes shared the port, each frame would reach only one
        of them.
    """

    # In the slcan protocol (CAN232), the command S7 sets 800 kbit/s, which is a bit rate of CiA 301. python-can maps S7
    # to 750 kbit/s, as the CANable adapter does.
    _BITRATES = slcanBus._BITRATES | {800_000: 'S7'}

    def __init__(self, channel: str, bitrate: int | None = None, sleep_after_open: float | None = None,
                 listen_only: bool = False, **options: Any):
        self._lines: deque[str] = deque()
        self._asked = -inf  # time of the last check for waiting bytes
        self._rest_arrival = -inf  # the incomplete line in the buffer arrived after this time
        self._open_command = 'L' if listen_only else 'O'  # python-can 4.3 ignores this option
        self._port = channel.split('@')[0]
        self._lock = _lock_port(self._port)
        try:
            super().__init__(channel, bitrate=bitrate, sleep_after_open=sleep_after_open or 0.0,
                             # Longest wait of one read on an idle port [s]. Incoming data end the wait immediately.
                             **{'timeout': 0.002} | options)
            if sleep_after_open is None and not self._is_awake():
                time.sleep(RESET_TIME - WAKE_TIMEOUT)
                self.open() if bitrate is None else self.set_bitrate(bitrate)
        except BaseException:
            self._release()
            raise

    def open(self) -> None:
        """Open the CAN channel of the adapter, in listen-only mode if ``listen_only`` was given."""
        self._write(self._open_command)

    def shutdown(self) -> None:
        """Close the bus and the port, even if the adapter is gone.

        If the port stayed open, the adapter would get a different device name when it is plugged in again.
        """
        try:
            super().shutdown()
        finally:
            self._release()

    def _release(self) -> None:
        """Close and unlock the port. python-can leaves the port open if a command to the adapter fails.

        The kernel waits up to 30 s for bytes that an adapter does not take. The port therefore closes on a thread of
        its own. From now on, a write fails, because another file may soon have the descriptor of the port.
        """
        port, lock = getattr(self, 'serialPortOrig', None), self._lock
        self.serialPortOrig, self._lock = Serial(), None
        if sys.is_finalizing():  # Python starts no more threads
            _close(port, lock)
            return
        closing = ReportedThread(_close, _closing(self._port), port, lock)
        closing.start()
        closing.join(CLOSE_TIMEOUT)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a message, and wait until the buffer of the kernel is empty.

        If this fails, the adapter may still get a part of the message, or the whole message, when it takes data again.

        Parameters
        ----------
        msg : can.Message
            Message to send.
        timeout : float or None
            Not used, because the wait always has a limit.

        Raises
        ------
        can.CanTimeoutError
            Raised if the adapter does not take the message.
        can.CanOperationError
            Raised if the adapter is gone.
        """
        super().send(msg, NO_WAIT)

    def _write(self, string: str) -> None:
        """Write a command, and wait until the buffer of the kernel is empty. python-can calls this method.

        python-can's own method calls ``tcdrain``, which has no time limit. pyserial's time limit also expires after a
        successful write if this process was stopped meanwhile.
        """
        port, unsent = self.serialPortOrig, string.encode() + self.LINE_TERMINATOR
        try:
            if port.write_timeout != NO_WAIT:
                port.write_timeout = NO_WAIT
            for _ in range(WRITE_CHECKS):
                if unsent and _has_room(port):
                    unsent = unsent[port.write(unsent):]
                if not unsent and not getattr(port, 'out_waiting', 0):  # a port that is a socket lacks this attribute
                    return
                time.sleep(WRITE_PAUSE)
        except OSError as error:
            raise can.CanOperationError(f'Could not write to serial device: {error}') from error
        with suppress(Exception):  # not every kind of port can drop its unsent bytes
            port.reset_output_buffer()
        raise can.CanTimeoutError('the adapter takes no data')

    def _is_awake(self) -> bool:
        """Return True if the adapter sends an answer or a frame within WAKE_TIMEOUT."""
        self._write('V')
        end = time.monotonic() + WAKE_TIMEOUT
        while not self._buffer and time.monotonic() < end:
            # A port that was closed just before may report data and return none. If the adapter is gone, the next
            # command fails.
            with suppress(SerialException):
                self._buffer += self.serialPortOrig.read(1)
        return bool(self._buffer)

    def recv_all(self, timeout: float) -> Batch:
        """Return all waiting messages. If no message is waiting, wait up to ``timeout`` [s] for the first one."""
        earliest = self._read_lines(timeout)
        lines, self._lines = self._lines, deque()
        now, read = time.time(), time.monotonic()
        messages = (self._message(line, now) for line in lines)
        return Batch([message for message in messages if message is not None], (earliest, read))

    def _read_lines(self, timeout: float | None) -> float:
        """Read all waiting bytes, and repeat this until a line is complete or ``timeout`` [s] has passed.

        If complete lines are already waiting, read nothing.

        Returns
        -------
        float
            Time after which all complete lines arrived, on the steady clock [s].
        """
        earliest = self._rest_arrival if self._buffer else self._asked
        end = None if timeout is None else time.monotonic() + timeout
        while not self._lines:
            with can.exceptions.error_check('Could not read from serial device'):
                after, self._asked = self._asked, time.monotonic()
                waiting, is_begun = self.serialPortOrig.in_waiting, bool(self._buffer)
                if not waiting:  # no byte of this read has arrived yet
                    after = self._asked
                    if not is_begun:
                        earliest = after
                self._buffer += self.serialPortOrig.read(max(1, waiting))
            *lines, rest = self._buffer.translate(ENDS).split(END)
            if lines or not is_begun:
                self._rest_arrival = after
            self._buffer = bytearray(rest)
            if len(rest) > LONGEST_LINE:
                self._buffer.clear()
                self._lines.append('t')  # an incomplete line, which is delivered as an error frame
            self._lines += [line.decode('ascii', 'replace') for line in lines if line not in (b'', b'z', b'Z')]
            if end is not None and time.monotonic() >= end:
                break
        return earliest

    def _read(self, timeout: float | None) -> str | None:
        """Return the next line. python-can calls this method."""
        if not self._lines:
            self._read_lines(timeout)
        return self._lines.popleft() if self._lines else None

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        line = self._read(timeout)
        return None if line is None else self._message(line, time.time()), False

    def _message(self, line: str, now: float) -> can.Message | None:
        """Return the message in a line received at ``now`` [s], or None if the line is an answer of the adapter."""
        if not is_sound(line):
            return can.Message(now, PROTOCOL_VIOLATION, is_extended_id=False, is_error_frame=True, data=bytes(8))
        if line[0] == 't':
            return can.Message(now, int(line[1:4], 16), False, data=bytes.fromhex(line[5:5 + 2 * int(line[4])]))
        self._lines.appendleft(line)  # python-can calls _read to get the line; before version 4.5 it has no queue
        return super()._recv_internal(0.0)[0]


def _has_room(port: Serial) -> bool:
    """Return True if the port takes bytes now. On a full port, pyserial's write would try again without a pause."""
    try:
        return bool(select.select([], [port.fileno()], [], 0)[1])
    except io.UnsupportedOperation:  # on Windows, a port has no file descriptor, and its write does not wait
        return True


def _closing(port: str) -> str:
    """Return the name of the thread that closes ``port``."""
    return f'close {os.path.realpath(port)}'


def _close(port: Serial | None, lock: int | None) -> None:
    """Close a port that may already be gone, and the descriptor of its lock."""
    try:
        if port is not None:
            with suppress(OSError):
                port.close()
    finally:
        if lock is not None:
            os.close(lock)


class PortInUseError(can.CanInitializationError):
    """Another process has locked the serial port, or this process has not closed it yet."""


def _lock_port(port: str) -> int | None:
    """Lock ``port`` against other processes that also request exclusive access, as pyserial can.

    Return the file descriptor that holds the lock, or None if the port is not a file that can be locked. Raises
    PortInUseError.
    """
    # while a thread of this process closes the port, the kernel blocks every thread that opens the port
    if any(thread.name == _closing(port) for thread in threading.enumerate()):
        raise PortInUseError('this process is still closing this port')
    try:
        import fcntl
    except ImportError:  # Windows lets only one process open a serial port
        return None
    try:
        descriptor = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        return None  # pyserial reports that the port is locked
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        raise PortInUseError('another process has this port open') from error
    return descriptor


def is_sound(line: str) -> bool:
    """Return True if a line is a complete CAN frame or an answer of the adapter, False if it is damaged.

    Examples
    --------
    >>> is_sound('t1812AABB'), is_sound('t1812AAB'), is_sound('t1812AABBt1812CCDD'), is_sound('V1013')
    (True, False, False, True)
    >>> is_sound('r123a')  # a remote frame of ten bytes
    False
    >>> is_sound('1812AABB')  # without its first letter
    False
    """
    digits = ID_DIGITS.get(line[:1])
    if digits is None:
        if line[:1] == 'F':  # status flags; 'F' is also a digit, so the line may be the rest of a frame
            return len(line) == 3 and HEXADECIMAL.issuperset(line)
        return line[:1] in ('', *'VvNzZ') and len(line) <= 20  # version, serial number, confirmation
    body = line[1:]
    if len(body) <= digits or not HEXADECIMAL.issuperset(body):
        return False
    size, can_id = int(body[digits], 16), int(body[:digits], 16)
    if line[0] in 'tTxrR' and size > 8 or can_id > (0x7FF if digits == 3 else 0x1FFF_FFFF):
        return False
    data = 0 if line[0] in 'rR' else CAN_FD_DLC[size]
    return len(body) - digits - 1 - 2 * data in (0, 4)  # some adapters append a time stamp of 4 digits
