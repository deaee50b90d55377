"""The part of a recording that is read."""

import math
from typing import NamedTuple

SECOND = 1_000_000_000  # ns


class Window(NamedTuple):
    """From ``start`` [s] after the begin of the recording, for ``duration`` [s]."""

    start: float = 0.0
    duration: float = math.inf

    @property
    def end(self) -> float:
        return self.start + self.duration

    def of(self, begin: int) -> tuple[int, int | None]:
        """Return its begin and end [ns], None: the recording's, of a recording that begins at ``begin`` [ns].

        >>> Window(1.5, 2.0).of(10**9), Window().of(10**9)
        ((2500000000, 4500000000), (1000000000, None))
        """
        until = None if math.isinf(self.end) else begin + round(self.end * SECOND)
        return begin + round(self.start * SECOND), until


WHOLE = Window()
