"""Ctrl-C and SIGTERM as an event, so that a command can end in order: log closed, devices off."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interruption() -> Iterator[threading.Event]:
    """Give an event that SIGINT or SIGTERM sets; the previous handlers are restored at the end."""
    stop_requested = threading.Event()
    before = {number: signal.signal(number, lambda *_: stop_requested.set())
              for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop_requested
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def ignore_interruptions() -> None:
    """For the last moments of a process: a second Ctrl-C must not make a clean end look like a crash."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
