"""Decide which messages and results of a topic a node may use, and count all of them."""

import logging
import math
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from typing import Any, Generic, TypeAlias

from rclpy.node import Node

from tactile_node.bus.log_throttle import LogThrottle
from tactile_node.ros.message_age import InputAge
from tactile_node.ros.message_checks import Check, Message
from tactile_node.ros.message_health import MessageCounts, StreamHealth
from tactile_node.ros.publishers import publisher_names, publishers_of_other_type
from tactile_node.ros.rosout_handler import of_node
from tactile_node.ros.source_guard import SourceGuard, StampGuard
from tactile_node.ros.time_messages import seconds
from tactile_node.skin.taxel_array import RejectReason

logger = logging.getLogger(__name__)

# The frames of a gap in the sequence count as lost (`skipped`) up to the larger of two limits. A larger gap means that
# the sender has restarted its count.
MOST_SKIPPED = 10_000  #: First limit on the gap [frames].
#: Second limit on the gap, as a rate over the time between the stamps [frames/s]. A rate allows for a link that is down
#: for hours.
FASTEST = 1000.0


FrameKey: TypeAlias = tuple[int, int, int]  #: Sequence number and stamp (s, ns) of a frame.


class GuardedInput(Generic[Message]):
    """Checks and counts the messages or results that a node receives on one topic.

    Messages that cannot be used are dropped, counted by reason and logged. If the node's function for a message raises
    an exception, the input logs the traceback and counts the message as PROCESSING_FAILED. If only publishing the
    result failed, the next stage of the process has used the result all the same.

    Messages of the processing chain have a stamp, an age and a sequence number. The input counts gaps in the sequence.
    Except in a lossless replay, it drops a message whose stamp is too far ahead of the earlier stamps. A topic of the
    chain must have a single source. While two sources send, or while a publisher uses another version of the message
    type, all messages on the topic are dropped.

    The same rules apply to results that a stage of the same process passes on, but neither their content nor their
    stamps need a check. If a stamp of this process advances too far, the wall clock was set forward, or a replay has
    skipped a gap of its log.

    The class receives nothing itself. A `GuardedSubscription` receives messages on the executor's thread, and a
    `StageInput` receives results or messages on the chain thread.

    Parameters
    ----------
    node : Node
        Node that reads the topic.
    kind : type
        Type of the messages.
    topic : str
        Name of the topic.
    check : callable
        Function that returns the reason why a message cannot be used, or None.
    lossless : bool
        True for a lossless replay.
    steady : callable
        Steady clock that gives the arrival times [s].

    Attributes
    ----------
    topic : str
        Full name of the topic.
    publishers : int
        Number of publishers of the topic at the last call of `count_publishers`.
    acquired : float
        Time when the taxels of the last usable message were acquired, on the steady clock [s]; -inf if not known.
    """

    def __init__(self, node: Node, kind: type[Message], topic: str, *, check: Check[Message], lossless: bool = False,
                 steady: Callable[[], float] = time.monotonic):
        self._node = node
        self._check = check
        self._steady = steady
        self.topic = node.resolve_topic_name(topic)
        self._received = 0
        self._processed = 0
        self._dropped: Counter[RejectReason] = Counter()
        self._throttles: defaultdict[RejectReason, LogThrottle] = defaultdict(LogThrottle)
        self._kind_is_of_chain = all(hasattr(kind, field) for field in ('header', 'age', 'sequence'))
        self._follows_sender = self._kind_is_of_chain and not lossless
        self._stamps = StampGuard()
        self._sources = SourceGuard()
        self._age = InputAge(lossless=lossless, steady=steady)
        self._sequence: int | None = None  # sequence number of the last message that was used
        self._stamp = 0.0  # stamp of the last message that was used, on the sender's clock [s]
        self._typed_publishers = 0  # number of publishers when their message types were last read
        self._other_types: tuple[str, ...] = ()
        self._skipped = 0
        self._overtaken = 0
        self.publishers = 0
        self.acquired = -math.inf

    @property
    def counts(self) -> MessageCounts:
        """Message counts since construction."""
        return MessageCounts(self._received, self._processed, dict(self._dropped), self._skipped, self._overtaken)

    @property
    def health(self) -> StreamHealth:
        """Message counts, age and stamp of the newest data, and the publishers of the topic."""
        age = self._steady() - self.acquired
        if not self._kind_is_of_chain:
            return StreamHealth(self.counts, age)
        stamps_offset = self._stamp + age - time.time() if age < math.inf else math.nan
        return StreamHealth(self.counts, age, tuple(publisher_names(self._node, self.topic)),
                            publishers_of_other_type(self._node, self.topic), stamps_offset)

    def count_publishers(self) -> None:
        """Read the number of publishers from the ROS graph.

        ``Node.count_publishers`` would take twice as long, because it expands and checks the name. The name of the
        topic is already a full name.
        """
        if self._kind_is_of_chain:
            with self._node.handle:
                self.publishers = self._node.handle.get_count_publishers(self.topic)

    def admit(self, message: Any, *, is_result: bool = False) -> bool:
        """Check a message and record it. Returns True if the message can be used, otherwise counts it as dropped.

        Parameters
        ----------
        message : message or result
            Message from the topic, or result of a stage in this process.
        is_result : bool
            True for a result, whose content and stamp need no check.
        """
        self._received += 1
        try:
            reason = (self._check_type(message, is_result) or (None if is_result else self._check(message))
                      or self._check_sender(message, is_result))
            if reason is None:
                self._note(message, is_result)
                return True
            self._drop(reason)
        except Exception as error:
            self._count_failure(error)
        return False

    def process(self, call: Callable[[Any], object], usable: object) -> None:
        """Call a function with a usable message or result, and count it as processed."""
        if self.attempt(call, usable):
            self._processed += 1

    def count_overtaken(self, usable: int) -> None:
        """Count usable messages that the node does not process, because newer messages are waiting."""
        self._overtaken += usable

    def attempt(self, call: Callable[..., object], *args: object) -> bool:
        """Call a function. If the function raises an exception, count PROCESSING_FAILED and return False."""
        try:
            call(*args)
        except Exception as error:
            self._count_failure(error)
            return False
        return True

    def _count_failure(self, error: Exception) -> None:
        """Log an exception of a processing function, and count it, because it must not end the calling thread."""
        if not self._node.context.ok():  # the process is ending, and can no longer publish anything
            raise error
        self._drop(RejectReason.PROCESSING_FAILED, error)

    def _check_type(self, message: Any, is_result: bool) -> RejectReason | None:
        """Return OTHER_TYPE if a publisher uses another version of the message type.

        The types are read again only if the publishers may have changed: if their number differs, if the sequence of
        the messages has a gap that overtaken frames do not explain, or as long as a publisher uses another version. A
        result of this process is never decoded, so a gap before it is no reason to read the types.
        """
        if not self._kind_is_of_chain:
            return None
        is_next = self._sequence is not None and message.sequence - self._sequence == 1 + _left_out_before(message)
        has_gap = not is_result and not is_next
        if self.publishers != self._typed_publishers or has_gap or self._other_types:
            self._typed_publishers = self.publishers
            self._other_types = publishers_of_other_type(self._node, self.topic)
        return RejectReason.OTHER_TYPE if self._other_types else None

    def _check_sender(self, message: Any, is_result: bool) -> RejectReason | None:
        """Return STAMP_AHEAD if the stamp of a message is too far ahead, or OTHER_SOURCE if two sources send."""
        if not self._follows_sender:
            return None
        now, stamp = self._steady(), seconds(message.header.stamp)
        if not is_result and not self._stamps.accepts(now, stamp):
            return RejectReason.STAMP_AHEAD
        is_accepted = self._sources.accepts(now, message.sequence, stamp, _left_out_before(message))
        return None if is_accepted else RejectReason.OTHER_SOURCE

    def _note(self, message: Any, is_result: bool) -> None:
        """Record the time of acquisition and the sequence number of a message that is used."""
        if not self._kind_is_of_chain:
            return
        self.acquired = message.acquired if is_result else self._age.arrived(message).acquired
        stamp = seconds(message.header.stamp)
        if self._sequence is not None:
            gap = message.sequence - self._sequence - 1
            most = max(MOST_SKIPPED, FASTEST * (stamp - self._stamp))
            self._skipped += max(gap - _left_out_before(message), 0) if 0 < gap <= most else 0
        self._sequence, self._stamp = message.sequence, stamp

    def _drop(self, reason: RejectReason, error: Exception | None = None) -> None:
        self._dropped[reason] += 1
        if self._throttles[reason].is_due(reason.key, self._steady()):
            logger.warning('message on %s dropped: %s (%d so far)', self.topic, reason.key, self._dropped[reason],
                           exc_info=error, extra=of_node(self._node))


def frame_key(message: Any) -> FrameKey:
    """Return the sequence number and the stamp of a message, which together identify its frame."""
    return message.sequence, message.header.stamp.sec, message.header.stamp.nanosec


def _left_out_before(message: object) -> int:
    """Return the number of frames before ``message`` that were overtaken at its sender or at an earlier node.

    Returns 0 for a message type without this number.
    """
    return int(getattr(message, 'left_out', 0))
