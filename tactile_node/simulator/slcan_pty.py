"""A serial CAN adapter on a pseudo-terminal: the device side of the slcan protocol (Lawicel CAN232).

The owner of a SlcanPty acts as the bus behind the adapter. A program that opens ``interface: slcan`` and ``channel:
<port>`` sees an ordinary adapter.
"""

import os
import pty
import select
import termios
import threading
import time
import tty
from collections import deque
from collections.abc import Iterable
from pathlib import Path

import can

from tactile_node.cia301.frame_bits import CanFrame
from tactile_node.errors import ConfigurationError

OK = b'\r'
REFUSED = b'\a'
#: number of unread bytes above which frames are lost, as in a real adapter
MAX_WAITING = 1 << 16


class SlcanPty(can.BusABC):
    """A python-can bus whose wire is a pseudo-terminal. The bus accepts every bit rate that a client sets.

    Parameters
    ----------
    link
        Path of a symbolic link that gives the pseudo-terminal a fixed name, or '' for no link.

    Raises
    ------
    ConfigurationError
        Raised if the link cannot be made, for example because another simulator uses its name.
    """

    def __init__(self, link: str = ''):
        # This process keeps its end of the port open, so that clients may connect and disconnect.
        self._master, self._port_fd = pty.openpty()
        tty.setraw(self._port_fd)
        os.set_blocking(self._master, False)
        self.port = os.ttyname(self._port_fd)
        self._link = Path(link) if link else None
        self._lock = threading.Lock()  # needed because another thread sends heartbeats
        self._open = False
        self._is_silent = False  # True in listen-only mode, which refuses frames from the client
        self._unsent = bytearray()
        self._line = bytearray()
        self._received: deque[can.Message] = deque()
        self.channel_info = f'slcan on {self.port}'
        self.lost = 0  #: number of frames that the client did not read in time
        super().__init__(self.port)
        try:
            if self._link:
                _point(self._link, self.port)
        except ConfigurationError:
            self.shutdown()
            raise

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Deliver a frame to the client that has opened the channel. If the client does not read, the frame is lost.

        The attribute ``lost`` counts the lost frames.
        """
        self.send_all([frame_of(msg)])

    def send_all(self, frames: Iterable[CanFrame]) -> None:
        """Send several frames at once, each like `send`."""
        if not self._open:
            return
        lines = [line_of(frame) for frame in frames]
        waiting, fitting = len(self._unsent), 0
        for line in lines:
            if waiting > MAX_WAITING:
                break
            waiting += len(line)
            fitting += 1
        self.lost += len(lines) - fitting
        if fitting:
            self._write(b''.join(lines[:fitting]))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        deadline = None if timeout is None else time.monotonic() + timeout
        while not self._received:
            left = None if deadline is None else max(0.0, deadline - time.monotonic())
            readable, writable, _ = select.select([self._master], [self._master] if self._unsent else [], [],
                                                  left)
            if writable:
                self._write(b'')
            if readable:
                self._read()
            elif not writable and left is not None:
                return None, False
        return self._received.popleft(), False

    def _read(self) -> None:
        for byte in os.read(self._master, 4096):
            if byte != OK[0]:
                self._line.append(byte)
            else:
                self._write(self._answer(bytes(self._line)))
                self._line.clear()

    def _answer(self, line: bytes) -> bytes:
        command = line[:1]
        if command in (b't', b'T', b'r', b'R'):
            message = decode(line)
            if message is None or not self._open or self._is_silent:
                return REFUSED
            self._received.append(message)
            return (b'z' if command in (b't', b'r') else b'Z') + OK
        if command in (b'O', b'L', b'C'):
            self._is_silent = command == b'L'
            return self._set_open(command != b'C')
        return {b'V': b'V1013\r', b'N': b'NTS01\r', b'F': b'F00\r'}.get(command,
                                                                 OK if command in b'SsMmZX' else REFUSED)

    def _set_open(self, is_open: bool) -> bytes:
        # Frames that the last client did not read must not reach the next client. The next client closes the channel
        # once more and may already be waiting in a read, which would fail if these bytes disappeared.
        if self._open and not is_open:
            with self._lock:
                self._unsent.clear()
            termios.tcflush(self._port_fd, termios.TCIFLUSH)
        self._open = is_open
        return OK

    def _write(self, data: bytes) -> None:
        with self._lock:
            self._unsent += data
            try:
                written = os.write(self._master, self._unsent)
            except BlockingIOError:
                return
            del self._unsent[:written]

    def shutdown(self) -> None:
        """Close the pseudo-terminal and remove its link."""
        if not self._is_shutdown:
            super().shutdown()
            if self._link and self._link.is_symlink() and os.readlink(self._link) == self.port:
                self._link.unlink()
            os.close(self._master)
            os.close(self._port_fd)


def _point(link: Path, port: str) -> None:
    """Make ``link`` a symbolic link to ``port``. Raises ConfigurationError.

    A symbolic link whose target is gone is replaced. A link to an existing port probably belongs to a running
    simulator, which would become unreachable.
    """
    try:
        if link.is_symlink() and (not link.exists() or os.readlink(link) == port):
            link.unlink()
        link.symlink_to(port)
    except OSError as error:
        got = f'a link to {os.readlink(link)}, which exists' if link.is_symlink() else error.strerror or str(error)
        raise ConfigurationError(f'--link {link}', expected='a new name, or a symbolic link whose target is gone',
                                 got=got, remedy='Choose another name, or end the simulator that uses this name.'
                                 ) from None


def encode(message: can.Message) -> bytes:
    """Encode a message as an slcan line: ``t1A02AABB`` is COB-ID 0x1A0 with the bytes AA BB."""
    return line_of(frame_of(message))


def frame_of(message: can.Message) -> CanFrame:
    return CanFrame(message.arbitration_id, bytes(message.data or b''), message.is_extended_id, message.is_remote_frame,
                    message.dlc if message.is_remote_frame else 0)


def line_of(frame: CanFrame) -> bytes:
    """Encode a CAN frame as an slcan line.

    >>> line_of(CanFrame(0x1A0, bytes.fromhex('AABB'))), line_of(CanFrame(0x180, is_remote=True, requested=8))
    (b't1A02AABB\\r', b'r1808\\r')
    """
    kind = 'r' if frame.is_remote else 't'
    head = f'{kind.upper()}{frame.can_id:08X}' if frame.is_extended else f'{kind}{frame.can_id:03X}'
    return f'{head}{frame.dlc:d}{frame.data.hex().upper()}\r'.encode()


def decode(line: bytes) -> can.Message | None:
    """Decode the frame in an slcan line without the final CR, or return None if the line contains no frame."""
    try:
        digits = 8 if line[:1].isupper() else 3
        length, remote = int(line[1 + digits:2 + digits]), line[:1] in b'rR'
        data = bytes.fromhex(line[2 + digits:].decode())
        if length > 8 or len(data) != (0 if remote else length):
            return None
        return can.Message(time.time(), int(line[1:1 + digits], 16), digits == 8, remote, dlc=length,
                           data=data)
    except ValueError:
        return None
