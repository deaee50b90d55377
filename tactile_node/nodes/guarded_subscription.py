"""Subscribe to a topic, and call a function with those of its messages that a node may use."""

import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from tactile_node.nodes.guarded_input import GuardedInput
from tactile_node.ros.message_checks import Check, Message


class GuardedSubscription(GuardedInput[Message]):
    """Subscribes to a topic, and calls a callback with the usable messages, on the executor's thread.

    Parameters
    ----------
    node : Node
        Node that subscribes.
    kind : type
        Type of the messages.
    topic : str
        Name of the topic.
    callback : callable
        Function that is called with each usable message.
    qos : QoSProfile
        QoS of the subscription.
    check : callable
        Function that returns the reason why a message cannot be used, or None.
    newest_only : bool
        True to call the callback only with the newest waiting message, and to count the other waiting messages as
        overtaken. In a lossless replay, the callback always gets all messages.
    lossless : bool
        True for a lossless replay.
    steady : callable
        Steady clock that gives the arrival times [s].
    """

    def __init__(self, node: Node, kind: type[Message], topic: str, callback: Callable[[Any], None], qos: QoSProfile,
                 *, check: Check[Message], newest_only: bool = False, lossless: bool = False,
                 steady: Callable[[], float] = time.monotonic):
        super().__init__(node, kind, topic, check=check, lossless=lossless, steady=steady)
        self._callback = callback
        self._takes_newest = newest_only and not lossless
        self._subscription: Subscription | None = None  # a message may arrive before the next line has ended
        self._subscription = node.create_subscription(kind, topic, self._on_message, qos)

    def destroy(self) -> None:
        """End the subscription."""
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)

    def _on_message(self, message: Message) -> None:
        self.count_publishers()
        usable = [each for each in (message, *self._take_waiting()) if self.admit(each)]
        if usable:
            self.count_overtaken(len(usable) - 1)
            self.process(self._callback, usable[-1])

    def _take_waiting(self) -> list[Message]:
        """Take all messages that have arrived since the executor took the current message."""
        found: list[Message] = []
        while self._takes_newest and self._subscription is not None:
            with self._subscription.handle:
                taken = self._subscription.handle.take_message(self._subscription.msg_type, self._subscription.raw)
            if taken is None:
                break
            found.append(taken[0])
        return found
