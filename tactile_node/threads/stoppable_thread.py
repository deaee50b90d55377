"""A thread that can be asked to end, and begun again."""

import threading
from collections.abc import Callable


class StoppableThread:
    """Runs ``run(stopping)`` on a daemon thread of its own; ``run`` returns once the event ``stopping`` is set."""

    def __init__(self, run: Callable[[threading.Event], None], name: str):
        self._run, self._name, self._stopping = run, name, threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin; nothing where it has begun and was not stopped."""
        if self._thread is None:
            self._stopping.clear()
            self._thread = threading.Thread(target=self._run, args=(self._stopping,), name=self._name, daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Ask it to end, and wait until it has, except on the thread itself."""
        self._stopping.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        self._thread = None
