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


def call_guarded(call: Callable[..., object], *args: object) -> Exception | None:
    """Call a function. If the function raises an exception, log and return the exception."""
    try:
        call(*args)
    except Exception as error:
        logger.exception('Internal error in the thread %r', threading.current_thread().name)
        return error
    return None
