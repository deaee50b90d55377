"""Calls made on another thread, in the order in which they were put."""

import threading
from collections.abc import Callable
from queue import SimpleQueue

Call = tuple[Callable[..., object], tuple[object, ...]]


class CallQueue:
    """Makes the calls that are ``put``, one after another, on its own thread, between ``begin`` and ``end``."""

    def __init__(self, name: str):
        self._name = name
        self._queue: SimpleQueue[Call | None] = SimpleQueue()
        self._thread: threading.Thread | None = None

    def __len__(self) -> int:
        return self._queue.qsize()

    def begin(self) -> None:
        """Forget what was put before and not called yet, also by a thread that still hangs in a call."""
        self._queue = SimpleQueue()
        self._thread = threading.Thread(target=self._work, args=(self._queue,), name=self._name, daemon=True)
        self._thread.start()

    def put(self, call: Callable[..., object], *args: object) -> None:
        """From any thread; returns at once."""
        self._queue.put((call, args))

    def end(self, timeout: float) -> None:
        """Make the calls put so far, then no more; waits for that at most ``timeout`` [s]."""
        self._queue.put(None)
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout)

    def _work(self, queue: 'SimpleQueue[Call | None]') -> None:
        while (item := queue.get()) is not None and queue is self._queue:
            call, args = item
            call(*args)
