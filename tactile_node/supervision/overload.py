"""Tells a slow process from a silent bus. Times are of the monotonic clock [s]."""

from collections.abc import Callable

from tactile_node.frames.health import Overload


class OverloadWatch:
    """Whether this process is so slow that what seems to be missing may only not be processed yet.

    ``put(call)`` makes a call on the assembler's thread after all that was received before. ``limit`` [s]: a delay
    beyond it is an overload, which counts as one for 2 ``limit`` after its last sign.
    """

    def __init__(self, put: Callable[[Callable[[], None]], None], limit: float):
        self._put = put
        self.limit = limit
        self._put_at: float | None = None  # when the call under way was put
        self._dropped = 0
        self._kind = Overload.NONE
        self._seen = 0.0  # the last sign
        self._excused = -float('inf')  # after a wait for another thread
        self.ran_again = 0.0  #: when the last stall, or wait for another thread, ended
        self.stalls = 0  #: times that this process did not run for long

    def restart(self) -> None:
        """The bus was closed: the call under way is forgotten."""
        self._put_at = None

    def woke(self, now: float, late: float) -> None:
        """A wait of this process has ended ``late`` [s] after its time."""
        if late > self.limit:
            self.stalls += 1
            self.ran_again = now
            self._see(Overload.STALLED, now)

    def waited(self, now: float, since: float) -> None:
        """It has waited for another thread for so long [s], and may not have run in between: no overload, but no
        measure either.
        """
        if since > self.limit:
            self._excused = self.ran_again = now

    def is_excused(self, now: float) -> bool:
        """Whether what seems to be missing may only not be processed yet."""
        return self._kind.is_overload or now - self._excused <= 2 * self.limit

    def update(self, now: float, dropped: int) -> Overload:
        """Return the overload now; ``dropped``: CAN frames that were not taken, so far."""
        if dropped != self._dropped:
            self._dropped = dropped
            self._see(Overload.DROPPED, now)
        put_at = self._put_at  # once: the assembler's thread may set it
        if put_at is None:
            self._put_at = now
            self._put(self._reached)
        elif now - put_at > self.limit:
            self._see(Overload.BEHIND, now)
        if now - self._seen > 2 * self.limit:
            self._kind = Overload.NONE
        return self._kind

    def _reached(self) -> None:
        self._put_at = None

    def _see(self, kind: Overload, now: float) -> None:
        self._kind, self._seen = kind, now
