"""A subscription whose messages cannot stop its node, and who publishes its topic."""

import logging
import math
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Generic, Protocol, TypeAlias, TypeGuard

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from tactile_node.bus.message_pace import Reminder
from tactile_node.ros.message_age import AgedMessage, Arrival, InputAge
from tactile_node.ros.message_checks import Check, Message, RejectReason
from tactile_node.ros.message_health import MessageCounts, StreamHealth
from tactile_node.ros.qos import is_lossless
from tactile_node.ros.rosout_handler import of_node
from tactile_node.ros.source_guard import SourceGuard, StampGuard
from tactile_node.ros.time_messages import seconds

logger = logging.getLogger(__name__)

#: A larger gap in the sequence than both allow is another count, not frames that were missed.
MOST_SKIPPED = 10_000
FASTEST = 1000.0  #: frames a second, of the time that has passed: a link may be cut for hours


FrameKey: TypeAlias = tuple[int, int, int]  #: sequence number and stamp


class ChainMessage(AgedMessage, Protocol):
    """A message about one taxel frame."""

    sequence: int


class GuardedSubscription(Generic[Message]):
    """Calls ``callback`` with each message that ``check`` accepts; drops, counts and logs the others by reason.

    An exception of the callback is logged with its traceback and counted as PROCESSING_FAILED: it would end the
    executor, and with it every node of the process.

    Messages of our chain have stamp, age and sequence: one whose stamp runs ahead of the others is dropped too, unless
    ``qos`` is that of a lossless replay, and gaps in the sequence are counted. Their topic has one source: while two
    send, or a publisher has another version of the message, all messages of the topic are dropped.

    With ``newest_only`` a callback that cannot keep up gets the newest of the messages that wait; those that it
    overtakes are counted. Of a lossless replay it gets all. ``steady``: the clock of the arrivals [s].
    """

    def __init__(self, node: Node, kind: type[Message], topic: str, callback: Callable[[Message], None],
                 qos: QoSProfile, *, check: Check[Message], newest_only: bool = False,
                 steady: Callable[[], float] = time.monotonic):
        self._node = node
        self._steady = steady
        self._callback = callback
        self._check = check
        self._received = 0
        self._processed = 0
        self._dropped: Counter[RejectReason] = Counter()
        self._reminders: defaultdict[RejectReason, Reminder] = defaultdict(Reminder)
        self._kind_is_of_chain = all(hasattr(kind, field) for field in ('header', 'age', 'sequence'))
        self._stamps = None if is_lossless(qos) else StampGuard()
        self._sources = None if is_lossless(qos) else SourceGuard()
        self._age = InputAge(lossless=is_lossless(qos), steady=steady)
        self._arrival: Arrival | None = None  # of the newest message that was used
        self._sequence: int | None = None
        self._stamp = 0.0  # of the same message [s, the sender's clock]
        self._publishers = 0  # how many the topic has, for the messages under work
        self._typed_publishers = 0  # when it was last asked of which type they are
        self._other_types: tuple[str, ...] = ()
        self._skipped = 0
        self._overtaken = 0
        #: frames just before the message under work that this node or one before it left out on purpose
        self.left_out = 0
        self.takes_newest = newest_only and not is_lossless(qos)
        self._subscribe = partial(node.create_subscription, kind, topic, self._on_message, qos)
        self._subscription: Subscription | None = self._subscribe()
        self.topic: str = self._subscription.topic_name  #: its full name

    @property
    def counts(self) -> MessageCounts:
        return MessageCounts(self._received, self._processed, dict(self._dropped), self._skipped, self._overtaken)

    @property
    def arrival(self) -> Arrival:
        """Arrival of the chain's message that ``callback`` is called with. Raises RuntimeError before the first."""
        if self._arrival is None:
            raise RuntimeError(f'{self.topic}: no message of the chain has arrived')
        return self._arrival

    @property
    def health(self) -> StreamHealth:
        """Its counts, the age and the stamp of its newest data now, and who publishes it."""
        age = math.inf if self._arrival is None else self._arrival.age(self._steady())
        if not self._kind_is_of_chain:
            return StreamHealth(self.counts, age)
        stamps_offset = self._stamp + age - time.time() if age < math.inf else math.nan
        self._other_types = publishers_of_other_type(self._node, self.topic)
        return StreamHealth(self.counts, age, tuple(publisher_names(self._node, self.topic)), self._other_types,
                            stamps_offset)

    def destroy(self) -> None:
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None

    def _on_message(self, message: Message) -> None:
        self._count_publishers()
        self._work_on([each for each in (message, *self._waiting()) if self._is_usable(each)], self._callback)

    def _count_publishers(self) -> None:
        """Ask the graph once, for all messages that wait.

        `Node.count_publishers` takes twice as long: it expands and checks the name, which is full here.
        """
        if self._kind_is_of_chain:
            with self._node.handle:
                self._publishers = self._node.handle.get_count_publishers(self.topic)

    def _work_on(self, usable: Sequence[Any], callback: Callable[[Any], None]) -> None:
        """Call ``callback`` with the last of what can be used; the others are left out for it."""
        if not usable:
            return
        self._overtaken += len(usable) - 1
        self.left_out = len(usable) - 1 + sum(map(_left_out_before, usable))
        try:
            callback(usable[-1])
            self._processed += 1
        except Exception as error:
            self._failed(error)

    def _waiting(self) -> list[Message]:
        """Take what has come since the executor took its message."""
        found: list[Message] = []
        while self.takes_newest and self._subscription is not None:
            with self._subscription.handle:
                taken = self._subscription.handle.take_message(self._subscription.msg_type, self._subscription.raw)
            if taken is None:
                break
            found.append(taken[0])
        return found

    def _is_usable(self, message: Any, acquired: float | None = None) -> bool:
        """Check and note a message; count one that cannot be used.

        ``acquired`` [s, steady clock]: it was handed over in this process, where its content needs no check.
        """
        self._received += 1
        try:
            reason = (self._check_type(message) or (self._check(message) if acquired is None else None)
                      or self._check_stamp(message) or self._check_source(message))
            if reason is None:
                self._note(message, acquired)
                return True
            self._drop(reason)
        except Exception as error:
            self._failed(error)
        return False

    def _failed(self, error: Exception) -> None:
        if not self._node.context.ok():  # nothing can be published: the process ends
            raise error
        self._drop(RejectReason.PROCESSING_FAILED, error)

    def _is_of_chain(self, message: object) -> TypeGuard[ChainMessage]:
        return self._kind_is_of_chain

    def _check_type(self, message: Message) -> RejectReason | None:
        """Ask for the types when the publishers may be others: their number has changed, or the sequence breaks off."""
        if not self._is_of_chain(message):
            return None
        is_next = self._sequence is not None and message.sequence == self._sequence + 1
        if self._publishers != self._typed_publishers or not is_next:
            self._typed_publishers = self._publishers
            self._other_types = publishers_of_other_type(self._node, self.topic)
        return RejectReason.OTHER_TYPE if self._other_types else None

    def _check_stamp(self, message: Message) -> RejectReason | None:
        if self._stamps is None or not self._is_of_chain(message):
            return None
        is_accepted = self._stamps.accepts(self._steady(), seconds(message.header.stamp))
        return None if is_accepted else RejectReason.STAMP_AHEAD

    def _check_source(self, message: Message) -> RejectReason | None:
        if self._sources is None or not self._is_of_chain(message):
            return None
        is_accepted = self._sources.accepts(self._steady(), message.sequence, seconds(message.header.stamp),
                                            _left_out_before(message))
        return None if is_accepted else RejectReason.OTHER_SOURCE

    def _note(self, message: Message, acquired: float | None) -> None:
        """Note age and sequence of a message that is used."""
        if not self._is_of_chain(message):
            return
        now = self._steady()
        self._arrival = self._age.arrived(message) if acquired is None else Arrival(now, now - acquired)
        stamp = seconds(message.header.stamp)
        if self._sequence is not None:
            gap = message.sequence - self._sequence - 1
            most = max(MOST_SKIPPED, FASTEST * (stamp - self._stamp))
            self._skipped += max(gap - _left_out_before(message), 0) if 0 < gap <= most else 0
        self._sequence, self._stamp = message.sequence, stamp

    def _drop(self, reason: RejectReason, error: Exception | None = None) -> None:
        self._dropped[reason] += 1
        if self._reminders[reason].is_due(reason.key, self._steady()):
            logger.warning('message on %s dropped: %s (%d so far)', self.topic, reason.key, self._dropped[reason],
                           exc_info=error, extra=of_node(self._node))


def frame_key(message: Any) -> FrameKey:
    """Return what tells one frame of a source from another: sequence number and stamp."""
    return message.sequence, message.header.stamp.sec, message.header.stamp.nanosec


def _left_out_before(message: object) -> int:
    """Frames before ``message`` that its sender left out on purpose; not every message of the chain says so."""
    return int(getattr(message, 'left_out', 0))


def publisher_names(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that ``node`` sees publish ``topic``, a name for each publisher, sorted."""
    return sorted(map(_full_name, node.get_publishers_info_by_topic(topic)))


def publishers_of_other_type(node: Node, topic: str) -> tuple[str, ...]:
    """Return the full names of those whose message of ``topic`` has other fields than the one that ``node`` reads.

    The middleware joins publisher and subscription by the name of the type alone, and values are then read from the
    wrong places. What differs is the hash of the type's description (REP 2011). Empty also where it is not known.
    """
    own = [info.topic_type_hash for info in node.get_subscriptions_info_by_topic(topic)
           if _full_name(info) == node.get_fully_qualified_name()]
    return tuple(sorted({_full_name(info) for info in node.get_publishers_info_by_topic(topic)
                         if own and _is_known(info) and info.topic_type_hash != own[0]}))


# `info` is rclpy's TopicEndpointInfo: Lyrical has it in another module than Jazzy and Kilted.
def _full_name(info: Any) -> str:
    return f'{info.node_namespace.rstrip("/")}/{info.node_name}'


def _is_known(info: Any) -> bool:
    """A publisher of an older ROS 2 sends none."""
    return any(info.topic_type_hash.value)
