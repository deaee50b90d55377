"""Read the waiting messages of a bus as one batch.

The kernel stores the CAN frames of a SocketCAN socket in a receive buffer until the driver reads them.
"""

import logging
import socket
import sys
import time
from typing import NamedTuple

import can

from tactile_node.bus.log_throttle import LogThrottle

logger = logging.getLogger(__name__)

#: Largest number of CAN frames in a batch. A socket buffer holds more frames than this.
MOST_IN_BATCH = 256
#: Size of the receive buffer that the driver requests [bytes]. The kernel grants twice the size: 8 MiB hold 1.5 s of a
#: full bus at 1 Mbit/s.
WANTED_SIZE = 4 << 20
# Options of Linux (asm-generic/socket.h, linux/sock_diag.h) that Python's module ``socket`` does not name.
SO_RCVBUFFORCE = 33
SO_MEMINFO = 55
DROPS = slice(4 * 8, 4 * 9)  # the drop count in the answer to SO_MEMINFO


class Batch(NamedTuple):
    """Messages that were read together."""

    messages: list[can.Message]  #: messages in the order of reception

    #: Interval of the monotonic clock in which all messages arrived [s]; None if the stamp of each message gives its
    #: time of arrival.
    arrival: tuple[float, float] | None = None

    #: number of CAN frames that the kernel has dropped before, between or directly after these messages
    dropped: int = 0


class BatchReader:
    """Reads batches from a bus that returns its messages one by one.

    The reader enlarges the receive buffer of a socket, and counts the CAN frames that the kernel has dropped from the
    buffer. With the option SO_RXQ_OVFL, the kernel would add the same count to each frame. The class does not use this
    option, because python-can reads only the stamp of a frame.

    Parameters
    ----------
    bus : can.BusABC
        Open bus. If the bus has no socket, the count stays 0.
    """

    def __init__(self, bus: can.BusABC):
        self._bus = bus
        self._error: Exception | None = None  # exception to be raised after the messages received before it
        has_socket = sys.platform == 'linux' and isinstance(getattr(bus, 'socket', None), socket.socket)
        self._socket: socket.socket | None = bus.socket if has_socket else None  # type: ignore[attr-defined]
        self._throttle = LogThrottle()
        self._dropped = 0
        if self._socket is not None:
            try:
                self._socket.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, WANTED_SIZE)
            except PermissionError:  # without CAP_NET_ADMIN, the kernel grants at most twice net.core.rmem_max
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, WANTED_SIZE)
        self._dropped = self._drop_count()

    def recv_all(self, timeout: float) -> Batch:
        """Return all waiting messages. If no message is waiting, wait up to ``timeout`` [s] for the first one."""
        error, self._error = self._error, None
        if error is not None:
            raise error
        messages: list[can.Message] = []
        message = self._bus.recv(timeout)
        while message is not None:
            messages.append(message)
            try:
                message = self._bus.recv(0) if len(messages) < MOST_IN_BATCH else None
            except Exception as error:  # the next read raises this exception, after these messages have been passed on
                self._error = error
                break
        return Batch(messages, dropped=self.new_drops() if messages else 0)

    def new_drops(self) -> int:
        """Return the number of CAN frames dropped since the last call, and log a warning if there are any."""
        before, self._dropped = self._dropped, self._drop_count()
        new = self._dropped - before & 0xFFFF_FFFF  # the kernel counts with 32 bits
        if new and self._throttle.is_due('dropped', time.monotonic()):
            logger.warning('The kernel has dropped %d CAN frames, because this process did not read them in time and '
                           'the receive buffer was full. Increase net.core.rmem_max (docs/adapters.md).', new)
        return new

    def _drop_count(self) -> int:
        if self._socket is None:
            return 0
        try:
            return int.from_bytes(self._socket.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, DROPS.stop)[DROPS],
                                  sys.byteorder)
        except OSError:  # Linux before 4.12, or a socket that was closed meanwhile
            return self._dropped
