"""Calls made elsewhere, in the order in which they were asked for."""

import threading
from collections.abc import Callable
from queue import SimpleQueue


class CallQueue:
    """Makes the calls that are ``put``, one after another, on a thread of its own, between ``begin`` and ``end``."""

    def __init__(self, name: str):
        self._name, self._queue = name, SimpleQueue()
        self._thread: threading.Thread | None = None

    def __len__(self) -> int:
        return self._queue.qsize()

    def begin(self) -> None:
        """What was put before and not called is forgotten, also by a thread that hangs in a call until now."""
        self._queue = SimpleQueue()
        self._thread = threading.Thread(target=self._work, args=(self._queue,), name=self._name, daemon=True)
        self._thread.start()

    def put(self, call: Callable[..., object], *args: object) -> None:
        """From any thread; returns at once."""
        self._queue.put((call, args))

    def end(self, patience: float) -> None:
        """Make the calls put so far, then no more; waits for that at most ``patience`` [s]."""
        self._queue.put(None)
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(patience)

    def _work(self, queue: SimpleQueue) -> None:
        while (asked := queue.get()) is not None and queue is self._queue:
            call, args = asked
            call(*args)
