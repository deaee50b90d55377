"""Reads a CAN bus in batches.

python-can's Notifier wakes up for each CAN frame. At a full bus (7,400 frames/s) waking up and handing over the
interpreter costs more than all that is done with a frame.
"""

import threading
import time
from collections.abc import Callable
from typing import Protocol, runtime_checkable

import can

RECEIVE_TIMEOUT = 0.1  #: s that a read waits at most
STOP_TIMEOUT = 1.0  #: s
PAUSE = 0.8e-3  #: s from one read to the next, at least: what it adds to the age of taxels, at most
MOST = 256  #: CAN frames in a batch: less than a socket's buffer holds

Batch = list[can.Message]


@runtime_checkable
class BatchBus(Protocol):
    """A bus that gives all at once that it has received."""

    def recv_all(self, timeout: float) -> Batch:
        """Return the messages that wait, at least one unless none comes within ``timeout`` [s]."""


class Reception:
    """Calls ``on_batch(messages)``, never empty, and ``on_error(exception)``, on its own thread, until stopped."""

    def __init__(self, bus: can.BusABC, on_batch: Callable[[Batch], None], on_error: Callable[[Exception], None]):
        self._bus = bus
        self._on_batch = on_batch
        self._on_error = on_error
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name='reception', daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Read no more. Returns when that is so, or after STOP_TIMEOUT where a dead adapter holds the read up."""
        self._stopping.set()
        if self._thread is not threading.current_thread():
            self._thread.join(STOP_TIMEOUT)

    def _run(self) -> None:
        while not self._stopping.is_set():
            begun = time.monotonic()
            try:
                batch = received(self._bus, RECEIVE_TIMEOUT)
                if not batch:
                    continue
                self._on_batch(batch)
            except Exception as error:  # each backend of python-can raises its own
                self._on_error(error)
                self._stopping.wait(RECEIVE_TIMEOUT)  # a dead adapter fails at once
            time.sleep(max(0.0, begun + PAUSE - time.monotonic()))


def received(bus: can.BusABC, timeout: float) -> Batch:
    """Return what waits, at least one message unless none comes within ``timeout`` [s].

    Raises what ``bus`` raises, unless messages were received before.
    """
    if isinstance(bus, BatchBus):
        return bus.recv_all(timeout)
    batch: Batch = []
    message = bus.recv(timeout)
    while message is not None:
        batch.append(message)
        try:
            message = bus.recv(0) if len(batch) < MOST else None
        except Exception:  # raised again by the next call
            break
    return batch
