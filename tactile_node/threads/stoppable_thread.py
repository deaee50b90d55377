"""A thread that can be stopped and started again."""

import threading
from collections.abc import Callable


class StoppableThread:
    """Runs ``run(stopping)`` on its own daemon thread; ``run`` returns once the event ``stopping`` is set."""

    def __init__(self, run: Callable[[threading.Event], None], name: str):
        self._run = run
        self._name = name
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin; nothing where it has begun and was not stopped."""
        if self._thread is None:
            self._stopping.clear()
            self._thread = threading.Thread(target=self._run, args=(self._stopping,), name=self._name, daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Stop it and wait for its end, except on the thread itself."""
        self._stopping.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        self._thread = None
