"""Wait in real time for another thread, node or process. On a busy machine, the wait may take long."""

import time
from collections.abc import Callable


def wait_until(condition: Callable[[], object], timeout: float = 60.0) -> bool:
    """Return True once ``condition()`` is true, or False after ``timeout`` [s]."""
    end = time.monotonic() + timeout
    while not (is_met := bool(condition())) and time.monotonic() < end:
        time.sleep(0.01)
    return is_met


def until(condition: Callable[[], object], timeout: float = 60.0) -> None:
    """Wait until ``condition()`` is true, and fail the test after ``timeout`` [s]."""
    assert wait_until(condition, timeout), 'timeout'
