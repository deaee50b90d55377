"""How far the clocks of the drivers' hosts, and their stamps, are from the clock of this one."""

import time
from collections.abc import Sequence
from functools import partial

from rclpy.node import Node
from rclpy.task import Future

from tactile_node.delay.clock_offset import Exchange, OffsetEstimator
from tactile_node.errors import InputError
from tactile_node.nodes.guarded_subscription import publisher_names
from tactile_node.ros.clock_facts import DriverClock, stamps_ahead_of
from tactile_node.ros.time_messages import seconds
from tactile_skin.srv import HostTime

PERIOD = 2.0  #: s between two exchanges with a driver; what has not come by then is given up
LOOKS = 5  #: at both clocks of this host, of which the quickest counts


class DriverClocks:
    """Of the drivers whose taxels lead to ``topics``: each publishes the topic `taxels` beside one of them.

    `look` never waits. A driver that is absent, or is none of ours (a player of bags), is left out.
    """

    def __init__(self, node: Node, topics: Sequence[str]):
        self._node = node
        self._taxels = tuple(dict.fromkeys(f'{topic.rsplit("/", 1)[0]}/taxels' for topic in topics))
        self._exchanges: dict[str, _Exchanges] = {}
        self._due = 0.0

    def look(self) -> dict[str, DriverClock]:
        """Return what is known, by the full name of the driver; call it from the node's executor, often."""
        now = time.monotonic()
        if now >= self._due:
            self._due = now + PERIOD
            self._ask()
        lead = wall_lead()
        return {name: exchanges.state(now, lead) for name, exchanges in self._exchanges.items()}

    def _ask(self) -> None:
        drivers = {name for topic in self._taxels for name in publisher_names(self._node, topic)}
        for gone in self._exchanges.keys() - drivers:
            self._exchanges.pop(gone).destroy()
        for driver in drivers:
            if driver not in self._exchanges:
                self._exchanges[driver] = _Exchanges(self._node, driver)
            self._exchanges[driver].ask()


class _Exchanges:
    """With one driver."""

    def __init__(self, node: Node, driver: str):
        self._node = node
        self._client = node.create_client(HostTime, f'{driver}/host_time')
        self._offset = OffsetEstimator()
        self._stamps_ahead = 0.0
        self._waiting: Future | None = None
        self._unanswered = 0

    def state(self, now: float, lead: float) -> DriverClock:
        """At ``now`` [s, steady], when the wall clock of this host is ``lead`` [s] ahead of the steady one."""
        return DriverClock(self._offset.at(now).against(lead), self._stamps_ahead, self._unanswered)

    def ask(self) -> None:
        """Give up the question before, where it was not answered, and ask again."""
        if self._waiting is not None:
            self._client.remove_pending_request(self._waiting)
            self._waiting = None
            self._unanswered += 1
        if self._client.service_is_ready():
            sent = time.monotonic()
            self._waiting = self._client.call_async(HostTime.Request())
            self._waiting.add_done_callback(partial(self._on_answer, sent))

    def _on_answer(self, sent: float, answer: Future) -> None:
        arrived = time.monotonic()
        if answer is not self._waiting:  # it was given up
            return
        self._waiting = None
        try:
            response = answer.result()
            stamps_ahead = stamps_ahead_of(response.stamps_ahead)
            self._offset.update(Exchange(sent, seconds(response.received), seconds(response.sent), arrived))
            self._stamps_ahead = stamps_ahead
        except InputError:
            self._unanswered += 1

    def destroy(self) -> None:
        self._node.destroy_client(self._client)


def wall_lead() -> float:
    """Return the wall clock of this host - its steady clock [s], both read at nearly one time."""
    looks = [(time.monotonic(), time.time(), time.monotonic()) for _ in range(LOOKS)]
    before, wall, after = min(looks, key=lambda look: look[2] - look[0])
    return wall - (before + after) / 2
