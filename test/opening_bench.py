"""What the tests of the sources of an opening share: they run an executor until something is received."""

import time
from collections.abc import Callable

from tactile_node.grasp.opening import Opening

TIMEOUT = 60.0  # s


class OpeningBench:
    """Has an ``executor`` of the nodes and a ``source`` of the opening."""

    def wait(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.01)

    def until(self, condition: Callable[[], bool], failure: str) -> None:
        end = time.monotonic() + TIMEOUT
        while not condition():
            assert time.monotonic() < end, failure
            self.executor.spin_once(timeout_sec=0.01)

    def current(self) -> Opening:
        return self.source.current(time.monotonic())
