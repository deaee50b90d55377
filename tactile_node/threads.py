"""Define the threads of this package. Each thread logs an unexpected exception with its traceback."""

import logging
import threading
from collections.abc import Callable

logger = logging.getLogger(__name__)

OnDeath = Callable[[Exception], object]


class ReportedThread(threading.Thread):
    """A thread that logs an uncaught exception and then passes it to ``on_death``."""

    def __init__(self, run: Callable[..., object], name: str, *args: object,
                 on_death: OnDeath = lambda error: None, daemon: bool = True):
        super().__init__(target=run, name=name, args=args, daemon=daemon)
        self._on_death = on_death

    def run(self) -> None:
        error = call_guarded(super().run)
        if error is not None:
            self._on_death(error)


class StoppableThread:
    """A thread that can be started and stopped repeatedly.

    Parameters
    ----------
    run : callable
        Function of the thread. The function is called with an event and must return soon after the event is set.
    name : str
        Name of the thread.
    on_death : callable
        Function that is called with the exception that ends the thread.
    """

    def __init__(self, run: Callable[[threading.Event], None], name: str, on_death: OnDeath = lambda error: None):
        self._run = run
        self._name = name
        self._on_death = on_death
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Start the thread, unless it is already running."""
        if self._thread is None:
            self._stopping.clear()
            self._thread = ReportedThread(self._run, self._name, self._stopping, on_death=self._on_death)
            self._thread.start()

    def stop(self) -> None:
        """Stop the thread and wait until it has ended. If the thread stops itself, the call does not wait."""
        self._stopping.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        self._thread = None


def call_guarded(call: Callable[..., object], *args: object) -> Exception | None:
    """Call a function. If the function raises an exception, log and return the exception."""
    try:
        call(*args)
    except Exception as error:
        logger.exception('Internal error in the thread %r', threading.current_thread().name)
        return error
    return None
