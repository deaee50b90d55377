"""A wire with those who send and receive on it, in wire time: what happens follows from the time given to ``run``."""

import heapq
import itertools
import logging
import math
from collections.abc import Callable

from tactile_node.simulator.wire import Carried, Sender, Wire

logger = logging.getLogger(__name__)

Receive = Callable[[Carried], None]
Call = Callable[[], None]


class Segment:
    """Hands each frame, at its end, to all participants but its sender, and makes calls at given times of the wire.

    A participant that answers at once is asked at the exact end of the frame, however late the machine is: the wire
    decides what follows only after that. Times are in seconds; not for several threads.
    """

    def __init__(self, wire: Wire):
        self.wire = wire
        self.now = -math.inf  #: of the wire
        self._receivers: list[tuple[Sender, Receive]] = []
        self._timers: list[tuple[float, int, Call]] = []
        self._count = itertools.count()

    def join(self, receive: Receive, by_priority: bool = False) -> Sender:
        """A further participant."""
        sender = self.wire.join(by_priority=by_priority)
        self._receivers.append((sender, receive))
        return sender

    def submit(self, call: Call) -> None:
        """Make a call that puts frames or timers; a live segment makes it on its thread."""
        call()

    def at(self, when: float, call: Call) -> None:
        """Make ``call`` when the wire's time is ``when``."""
        heapq.heappush(self._timers, (when, next(self._count), call))

    def run(self, until: float) -> None:
        """Let the wire carry, and the participants answer, what ends up to ``until``."""
        while True:
            due = self._timers[0][0] if self._timers else math.inf
            carried = self.wire.carry(min(until, due))
            if carried is not None:
                self.now = carried.end
                self.on_carried(carried)
                for sender, receive in self._receivers:
                    if sender is not carried.sender:
                        guarded(receive, carried)
            elif self._timers and due <= until:
                self.now, _, call = heapq.heappop(self._timers)
                guarded(call)
            else:
                self.now = max(self.now, until)
                return

    def on_carried(self, carried: Carried) -> None:
        """Called before any participant has the frame."""

    @property
    def next_timer(self) -> float:
        return self._timers[0][0] if self._timers else math.inf


def guarded(call: Callable[..., None], *args: object) -> None:
    """Make the call; an error of a participant is logged."""
    try:
        call(*args)
    except Exception:  # canopen over a malformed frame; the wire must go on
        logger.exception('a participant of the simulated wire')
