"""Read a CAN bus in batches.

python-can's Notifier wakes up a thread for each CAN frame. On a full bus (7,400 frames/s), waking a thread and
switching the Python interpreter to it takes longer than processing the frame.
"""

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import can

from tactile_node.bus.socket_buffer import SocketBuffer
from tactile_node.threads import ReportedThread, call_guarded

RECEIVE_TIMEOUT = 0.1  #: Longest time a read waits for a message [s].
STOP_TIMEOUT = 1.0  #: Time allowed for the reception thread to end [s].

#: Shortest time between two reads on a busy bus [s]. The pause adds at most this time to the age of the taxels.
READ_PAUSE = 0.5e-3
#: Largest number of CAN frames in a batch. A socket buffer holds more frames than this.
MOST_IN_BATCH = 256
#: If at least this many frames arrive within 0.8 ms, the frames carry taxels and the bus counts as busy. An SDO
#: dialogue is slower and is therefore not delayed.
BUSY_FRAMES = 4


class Batch(NamedTuple):
    """Messages that were read together."""

    messages: list[can.Message]  #: messages in the order of reception

    #: Interval of the monotonic clock in which all messages arrived [s]; None if the stamp of each message gives its
    #: time of arrival.
    came: tuple[float, float] | None = None

    #: number of CAN frames that the kernel has dropped before, between or directly after these messages
    dropped: int = 0


class Reception:
    """Reads a bus on a separate thread until stopped.

    An exception raised by ``on_batch`` is logged and affects only one batch, because it is not a fault of the bus.

    Parameters
    ----------
    bus : can.BusABC
        Open bus. If the bus has a method ``recv_all``, as `BulkSlcanBus` does, that method is used.
    on_batch : callable
        Function that is called with each `Batch` that contains messages.
    on_error : callable
        Function that is called with the exception when a read fails or the thread ends with an exception.
    """

    def __init__(self, bus: can.BusABC, on_batch: Callable[[Batch], None], on_error: Callable[[Exception], None]):
        self._bus = bus
        self._buffer = SocketBuffer(bus)
        self._recv_all: Callable[[float], Batch] | None = getattr(bus, 'recv_all', None)
        self._on_batch = on_batch
        self._on_error = on_error
        self._recent: deque[float] = deque(maxlen=BUSY_FRAMES)  # times at which the last batches of messages were read
        self._error: Exception | None = None  # exception to be reported after the messages received before it
        self._stopping = threading.Event()
        self._thread = ReportedThread(self._run, 'reception', on_death=on_error)
        self._thread.start()

    def stop(self) -> None:
        """Stop reading.

        The method returns when the thread has ended, or after STOP_TIMEOUT if a dead adapter blocks the read.
        """
        self._stopping.set()
        if self._thread is not threading.current_thread():
            self._thread.join(STOP_TIMEOUT)

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                batch = self._read()
                if not batch.messages or self._stopping.is_set():
                    continue
                begun = time.monotonic()
                call_guarded(self._on_batch, batch)
                if self._is_busy(len(batch.messages), begun):
                    time.sleep(max(0.0, begun + READ_PAUSE - time.monotonic()))
            except Exception as error:  # the exception type depends on the python-can backend
                if not self._stopping.is_set():
                    self._on_error(error)
                self._stopping.wait(RECEIVE_TIMEOUT)  # reading from a dead adapter fails immediately

    def _is_busy(self, messages: int, now: float) -> bool:
        self._recent.extend([now] * min(messages, BUSY_FRAMES))
        return len(self._recent) == BUSY_FRAMES and now - self._recent[0] < 0.8e-3

    def _read(self) -> Batch:
        if self._recv_all is not None:
            return self._recv_all(RECEIVE_TIMEOUT)
        error, self._error = self._error, None
        if error is not None:
            raise error
        messages: list[can.Message] = []
        message = self._bus.recv(RECEIVE_TIMEOUT)
        while message is not None:
            messages.append(message)
            try:
                message = self._bus.recv(0) if len(messages) < MOST_IN_BATCH else None
            except Exception as error:  # the next read raises this exception, after these messages have been passed on
                self._error = error
                break
        return Batch(messages, dropped=self._buffer.new_drops() if messages else 0)
