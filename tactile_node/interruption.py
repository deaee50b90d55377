"""Turn Ctrl-C, SIGTERM and the end of another process into an event.

With this event, a command can stop cleanly: it closes its log and switches its devices off.
"""

import logging
import os
import select
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tactile_node.threads import ReportedThread

logger = logging.getLogger(__name__)


@contextmanager
def interruption() -> Iterator[threading.Event]:
    """Yield an event that SIGINT or SIGTERM sets. When the block ends, the function restores the previous signal
    handlers."""
    stop_requested = threading.Event()
    with _handled_by(lambda *_: stop_requested.set(), signal.SIGINT, signal.SIGTERM):
        yield stop_requested


@contextmanager
def interrupted_once() -> Iterator[None]:
    """Raise KeyboardInterrupt at the first signal that would end or suspend the process, and ignore further signals.

    The block can then stop a machine without being interrupted again. The signals are SIGINT, SIGTERM, SIGHUP (the
    terminal was closed) and SIGTSTP (Ctrl-Z).
    """
    numbers = signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP

    def interrupt(*_: object) -> None:
        for number in numbers:
            signal.signal(number, signal.SIG_IGN)
        raise KeyboardInterrupt
    with _handled_by(interrupt, *numbers):
        yield


@contextmanager
def _handled_by(handler: Callable[..., None], *numbers: int) -> Iterator[None]:
    """Call ``handler`` for the signals ``numbers``, until the block ends."""
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


def stop_with(process_id: int, stop_requested: threading.Event) -> None:
    """Set the event when another process ends for any reason.

    The function works on Linux. On other systems, it does nothing.

    When `ros2 launch` receives SIGTERM, it leaves its processes running ("using SIGTERM can result in orphaned
    processes").

    Parameters
    ----------
    process_id : int
        The other process.
    stop_requested : threading.Event
        Event to set.
    """
    if not hasattr(os, 'pidfd_open'):
        return
    try:
        process = os.pidfd_open(process_id)
    except ProcessLookupError:
        stop_requested.set()
        return
    except OSError as error:  # an old kernel does not provide this call, and a container may forbid it
        logger.warning('Process %d cannot be watched (%s). Stop this program yourself when that process ends.',
                       process_id, error)
        return
    ReportedThread(_set_at_end, 'end_with', process, stop_requested).start()


def _set_at_end(process: int, stop_requested: threading.Event) -> None:
    select.select([process], [], [])  # a process descriptor becomes readable when the process ends; see pidfd_open(2)
    os.close(process)
    stop_requested.set()


def ignore_interruptions() -> None:
    """Ignore SIGINT and SIGTERM from now on.

    While a process is ending, a second Ctrl-C must not make a clean exit look like a crash.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
