"""A simulated CAN wire with senders and receivers. All events depend only on the times passed to ``run``."""

import heapq
import itertools
import math
from collections.abc import Callable

from tactile_node.simulator.wire import Carried, Sender, Wire
from tactile_node.threads import call_guarded

Receive = Callable[[Carried], None]
Call = Callable[[], None]


class Segment:
    """Delivers each CAN frame at its end to all participants except its sender, and makes calls at given wire times.

    Each participant receives the exact end time of the CAN frame, even if the computer is running late. An immediate
    response therefore takes part in the next arbitration. Times are in seconds. The class is not thread-safe.
    """

    def __init__(self, wire: Wire):
        self.wire = wire
        self.now = -math.inf  #: current time of the wire [s]
        self._receivers: list[tuple[Sender, Receive]] = []
        self._timers: list[tuple[float, int, Call]] = []
        self._count = itertools.count()

    def join(self, receive: Receive, by_priority: bool = False) -> Sender:
        """Add a participant and return its queue. ``receive`` is called with each frame of the other participants."""
        sender = self.wire.join(by_priority=by_priority)
        self._receivers.append((sender, receive))
        return sender

    def submit(self, call: Call) -> None:
        """Make a call that may queue frames or set timers. A `WireGateway` makes the call on its thread."""
        call()

    def at(self, when: float, call: Call) -> None:
        """Schedule ``call`` for the wire time ``when`` [s]."""
        heapq.heappush(self._timers, (when, next(self._count), call))

    def run(self, until: float) -> None:
        """Advance the wire to the time ``until`` [s]: transmit and deliver frames, and make due calls."""
        while True:
            due = self._timers[0][0] if self._timers else math.inf
            carried = self.wire.carry(min(until, due))
            if carried is not None:
                self.now = carried.end
                self.on_carried(carried)
                for sender, receive in self._receivers:
                    if sender is not carried.sender:
                        call_guarded(receive, carried)
            elif self._timers and due <= until:
                self.now, _, call = heapq.heappop(self._timers)
                call_guarded(call)
            else:
                self.now = max(self.now, until)
                return

    def on_carried(self, carried: Carried) -> None:
        """Process each transmitted frame before any participant receives it."""

    @property
    def next_timer(self) -> float:
        return self._timers[0][0] if self._timers else math.inf
