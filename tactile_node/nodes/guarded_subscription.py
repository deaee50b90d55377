"""A subscription whose messages cannot stop its node."""

import logging
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from typing import Generic

from rclpy.node import Node
from rclpy.qos import QoSProfile

from tactile_node.ros.message_checks import Check, Message, RejectReason
from tactile_node.ros.message_health import MessageCounts
from tactile_node.threads.reminder import Reminder

logger = logging.getLogger(__name__)


class GuardedSubscription(Generic[Message]):
    """Calls ``callback`` with each message that ``check`` accepts; drops, counts and logs the others by reason.

    An exception of the callback is logged with its traceback and counted as PROCESSING_FAILED: it would end the
    executor, and with it every node of the process.
    """

    def __init__(self, node: Node, kind: type[Message], topic: str, callback: Callable[[Message], None],
                 qos: QoSProfile, *, check: Check[Message]):
        self._node = node
        self._callback = callback
        self._check = check
        self._received = 0
        self._processed = 0
        self._dropped: Counter[RejectReason] = Counter()
        self._reminders: defaultdict[RejectReason, Reminder] = defaultdict(Reminder)
        self._subscription = node.create_subscription(kind, topic, self._on_message, qos)
        self.topic: str = self._subscription.topic_name  #: its full name

    @property
    def counts(self) -> MessageCounts:
        return MessageCounts(self._received, self._processed, dict(self._dropped))

    def destroy(self) -> None:
        self._node.destroy_subscription(self._subscription)

    def _on_message(self, message: Message) -> None:
        self._received += 1
        try:
            reason = self._check(message)
            if reason is None:
                self._callback(message)
                self._processed += 1
                return
        except Exception as error:
            if not self._node.context.ok():  # nothing can be published: the process ends
                raise
            self._drop(RejectReason.PROCESSING_FAILED, error)
            return
        self._drop(reason)

    def _drop(self, reason: RejectReason, error: Exception | None = None) -> None:
        self._dropped[reason] += 1
        if self._reminders[reason].is_due(reason.key, time.monotonic()):
            logger.warning('%s: message on %s dropped: %s (%d so far)', self._node.get_fully_qualified_name(),
                           self.topic, reason.key, self._dropped[reason], exc_info=error)
