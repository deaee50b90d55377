"""Counts and ages of the messages that a node receives, and the diagnostic status derived from these numbers."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from enum import IntEnum
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from tactile_node.skin.taxel_array import RejectReason

OLD = 1.0  #: age above which arriving data counts as held back [s]
LONGEST_WAY = 0.5  #: longest usual delay of a message [s]. Stamps that are further behind come from another clock.
MOST_OVERTAKEN = 0.05  #: fraction of overtaken messages since the last status above which a node counts as overloaded


class StreamFault(IntEnum):
    """Faults in the messages that a node receives. The codes never change."""

    NOT_KNOWN = 0
    NONE = 1
    DROPPED = 2             #: messages were dropped for the reasons in RejectReason
    SKIPPED = 3             #: missing sequence numbers show that frames never reached the node
    OLD = 4                 #: messages arrive, but their data is older than OLD
    SEVERAL_PUBLISHERS = 5  #: several nodes publish the same topic
    SILENT = 6              #: no message was received on a topic since the last status
    OVERLOADED = 7          #: the node is too slow: the fraction of overtaken messages exceeds MOST_OVERTAKEN
    CLOCKS_APART = 8        #: stamps are ahead of the clock of this host, or seem to lag behind it
    OTHER_TYPE = 9          #: a publisher uses another version of the message type, so no message on the topic is used


class MessageCounts(NamedTuple):
    """Counts of one subscription since its node started.

    The number received equals processed + overtaken + the sum of ``dropped``.
    """

    received: int
    processed: int
    dropped: Mapping[RejectReason, int]  #: number of dropped messages for each reason that has occurred
    skipped: int = 0  #: number of lost frames, which are missing between the received frames
    overtaken: int = 0  #: number of usable messages that the node did not process, because a newer one was waiting


def total(counts: Iterable[MessageCounts]) -> MessageCounts:
    """Return the sum of the counts of all subscriptions."""
    received, processed, dropped, skipped, overtaken = zip(MessageCounts(0, 0, {}), *counts)
    return MessageCounts(sum(received), sum(processed), sum(map(Counter, dropped), Counter()), sum(skipped),
                         sum(overtaken))


class StreamHealth(NamedTuple):
    """Current health of one subscription."""

    counts: MessageCounts
    age: float = math.inf  #: age of the data in the newest message [s]; inf if not known

    #: full names of the nodes that publish the topic; empty unless the topic belongs to the chain
    publishers: tuple[str, ...] = ()
    other_types: tuple[str, ...] = ()  #: publishers that use another version of the message type

    #: stamp plus age of the newest message, minus the clock of this host [s]; NaN if not known
    stamps_offset: float = math.nan


def health_status(node: str, now: Mapping[str, StreamHealth], before: Mapping[str, MessageCounts],
                  period: float, max_clock_offset: float = math.inf) -> DiagnosticStatus:
    """Return the diagnostic status of a node.

    The level is WARN if messages were dropped or skipped, if many messages were overtaken, if data is old, if a topic
    has several publishers, or if stamps and clock differ. If none of these conditions applies, the level is STALE if a
    topic was silent, otherwise OK.

    Parameters
    ----------
    node
        Full name of the node.
    now
        Current health of each topic, by topic name.
    before
        Message counts at the last status, by topic name.
    period
        Time since the last status [s].
    max_clock_offset
        Largest accepted offset between stamps and the clock of this host [s]; inf to accept any offset.
    """
    counts, earlier = total(stream.counts for stream in now.values()), total(before.values())
    found = dict(_found(now, before, counts, earlier, max_clock_offset))
    processed = counts.processed - earlier.processed
    values = {'faults': ', '.join(fault.name for fault in found) or StreamFault.NONE.name,
              'received': counts.received, 'processed': counts.processed, 'rate_hz': f'{processed / period:.1f}',
              'age_s': _age(now), 'skipped': counts.skipped, 'overtaken': counts.overtaken,
              'publishers': max((len(stream.publishers) for stream in now.values()), default=0),
              'stamps_offset_s': _stamps_offset(now, max_clock_offset), **dropped_values(counts)}
    return status_of(node, _level(found), '; '.join(found.values()) or f'{processed} messages, none dropped', values)


def dropped_values(counts: MessageCounts) -> dict[str, object]:
    """Return the number of dropped messages for each reason, as values of a diagnostic status."""
    return {f'dropped_{reason.key}': counts.dropped.get(reason, 0) for reason in RejectReason if reason}


def dropped_since(counts: MessageCounts, before: MessageCounts) -> str:
    """Return the number of messages dropped since ``before`` for each reason, as text, or '' if none were dropped."""
    grown = Counter(counts.dropped) - Counter(before.dropped)
    return ', '.join(f'{count} ({reason.key})' for reason, count in sorted(grown.items()))


def status_of(name: str, level: bytes, message: str, values: Mapping[str, object],
              hardware_id: str = '') -> DiagnosticStatus:
    return DiagnosticStatus(level=level, name=name, message=message, hardware_id=hardware_id,
                            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()])


def topics_of_several(now: Mapping[str, StreamHealth]) -> dict[str, tuple[str, ...]]:
    """Return each topic that has several publishers, with the names of the publishing nodes."""
    return {topic: stream.publishers for topic, stream in now.items() if len(stream.publishers) > 1}


def _found(now: Mapping[str, StreamHealth], before: Mapping[str, MessageCounts], counts: MessageCounts,
           earlier: MessageCounts, max_clock_offset: float) -> Iterable[tuple[StreamFault, str]]:
    """Yield each fault with its message. ``counts`` and ``earlier`` are sums over all topics."""
    if dropped := dropped_since(counts, earlier):
        yield StreamFault.DROPPED, f'messages dropped: {dropped}'
    if counts.skipped > earlier.skipped:
        yield StreamFault.SKIPPED, (f'{counts.skipped - earlier.skipped} frames skipped, because they did not '
                                    'arrive or waited too long')
    overtaken, received = counts.overtaken - earlier.overtaken, counts.received - earlier.received
    if overtaken > MOST_OVERTAKEN * received:
        yield StreamFault.OVERLOADED, f'overloaded: {overtaken} of {received} messages overtaken by newer ones'
    silent = [topic for topic, stream in now.items() if stream.counts.received == before[topic].received]
    old = [f'{topic} {stream.age:.1f} s' for topic, stream in now.items()
           if topic not in silent and OLD < stream.age < math.inf]
    if old:
        yield StreamFault.OLD, f'data is old: {", ".join(old)}'
    apart = [clock_text(topic, stream.stamps_offset) for topic, stream in now.items()
             if topic not in silent and is_apart(stream.stamps_offset, max_clock_offset)]
    if apart:
        yield StreamFault.CLOCKS_APART, '; '.join(apart)
    for topic, publishers in topics_of_several(now).items():
        yield StreamFault.SEVERAL_PUBLISHERS, several_text(topic, publishers)
    for topic, stream in now.items():
        if stream.other_types:
            yield StreamFault.OTHER_TYPE, other_type_text(topic, stream.other_types)
    if silent:
        yield StreamFault.SILENT, f'nothing received on {", ".join(silent)}'


def is_apart(stamps_offset: float, limit: float) -> bool:
    """Return True if stamps are ahead by more than ``limit``, or behind by more than both ``limit`` and LONGEST_WAY.

    A message cannot arrive before it is sent, so stamps that are ahead certainly come from another clock.

    >>> is_apart(0.06, limit=0.05), is_apart(-0.4, limit=0.05), is_apart(-0.6, limit=0.05)
    (True, False, True)
    """
    return stamps_offset > limit or -stamps_offset > max(limit, LONGEST_WAY)


def clock_text(topic: str, stamps_offset: float) -> str:
    """Return the message for a topic whose stamps differ from the clock of this host by ``stamps_offset`` [s]."""
    if stamps_offset > 0:
        return (f'stamps on {topic} are {stamps_offset:.3f} s ahead of the clock of this host: tf lookups fail, but '
                'ages are right')
    return (f'stamps on {topic} are {-stamps_offset:.3f} s behind the clock of this host: the clocks differ, the data '
            'is replayed, or every message is delayed by this time without its age showing it')


def several_text(topic: str, publishers: Iterable[str]) -> str:
    """Return the message for a topic that several nodes publish."""
    return f'{topic} has several publishers: {", ".join(publishers)}'


def other_type_text(topic: str, publishers: Iterable[str]) -> str:
    """Return the message for a topic on which a publisher uses another version of the message type."""
    return (f'{topic}: expected the message type of this version of tactile_skin, got another version from '
            f'{", ".join(publishers)}; install the same version on every host')


def _level(found: Iterable[StreamFault]) -> bytes:
    faults = set(found)
    if faults - {StreamFault.SILENT}:
        return DiagnosticStatus.WARN
    return DiagnosticStatus.STALE if faults else DiagnosticStatus.OK


def _age(now: Mapping[str, StreamHealth]) -> str:
    """Return the age of the newest data, for the topic with the oldest data."""
    oldest = max((stream.age for stream in now.values()), default=math.inf)
    return f'{oldest:.3f}' if oldest < math.inf else 'not known'


def _stamps_offset(now: Mapping[str, StreamHealth], max_clock_offset: float) -> str:
    """Return the offset between stamps and the clock of this host, for the topic with the largest offset."""
    known = [stream.stamps_offset for stream in now.values() if not math.isnan(stream.stamps_offset)]
    return f'{max(known, key=abs):+.3f}' if known and max_clock_offset < math.inf else 'not known'
