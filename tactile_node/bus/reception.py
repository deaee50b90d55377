"""Reads a CAN bus in batches.

python-can's Notifier wakes up for each CAN frame. At a full bus (7,400 frames/s) waking up and handing over the
interpreter costs more than all that is done with a frame.
"""

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import can

from tactile_node.threads import ReportedThread, call_guarded

RECEIVE_TIMEOUT = 0.1  #: s that a read waits at most
STOP_TIMEOUT = 1.0  #: s
READ_PAUSE = 0.5e-3  #: s from one read to the next on a busy bus, at least: what it adds to the age of taxels, at most
MOST_IN_BATCH = 256  #: CAN frames: less than a socket's buffer holds
BUSY_FRAMES = 4  #: within 0.8 ms are taxels; a dialogue by SDO is not held up


class Batch(NamedTuple):
    """What was read at once.

    ``came``: where the messages' stamps do not say when they came, they all did between these times of the monotonic
    clock [s].
    """

    messages: list[can.Message]
    came: tuple[float, float] | None = None


class Reception:
    """Reads ``bus``, by its ``recv_all`` where it has one: BulkSlcanBus.

    Calls ``on_batch(batch)``, never an empty one, and ``on_error(exception)``, on its own thread, until stopped.
    An exception of ``on_batch`` is logged and costs this batch alone: it is no fault of the bus.
    """

    def __init__(self, bus: can.BusABC, on_batch: Callable[[Batch], None], on_error: Callable[[Exception], None]):
        self._bus = bus
        self._recv_all: Callable[[float], Batch] | None = getattr(bus, 'recv_all', None)
        self._on_batch = on_batch
        self._on_error = on_error
        self._recent: deque[float] = deque(maxlen=BUSY_FRAMES)  # when the last messages were read
        self._error: Exception | None = None  # not yet reported
        self._stopping = threading.Event()
        self._thread = ReportedThread(self._run, 'reception', on_death=on_error)
        self._thread.start()

    def stop(self) -> None:
        """Read no more. Returns when that is so, or after STOP_TIMEOUT where a dead adapter holds the read up."""
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
            except Exception as error:  # each backend of python-can raises its own
                if not self._stopping.is_set():
                    self._on_error(error)
                self._stopping.wait(RECEIVE_TIMEOUT)  # a dead adapter fails at once

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
            except Exception as error:  # after what came before it
                self._error = error
                break
        return Batch(messages)
