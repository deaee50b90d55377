"""Input of a node whose messages pass a `MessageGuard`."""

from typing import Any

from tactile_node.nodes.message_guard import MessageGuard
from tactile_node.ros.message_age import Arrival
from tactile_node.ros.message_health import MessageCounts, StreamHealth


class GuardedInput:
    """Base class of inputs, which shows what the guard has counted.

    Parameters
    ----------
    topic : str
        Full name of the topic.
    guard : MessageGuard
        Guard of the messages on this topic.
    """

    def __init__(self, topic: str, guard: MessageGuard[Any]):
        self.topic = topic
        self._guard = guard

    @property
    def counts(self) -> MessageCounts:
        """Message counts since construction."""
        return self._guard.counts

    @property
    def arrival(self) -> Arrival:
        """Arrival of the last usable message. Raises RuntimeError before the first message arrives."""
        return self._guard.arrival

    @property
    def health(self) -> StreamHealth:
        """Message counts, age and stamp of the newest data, and the publishers of the topic."""
        return self._guard.health
