"""What a node does with the messages that it receives: counts, and their diagnostic."""

from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from tactile_node.ros.message_checks import RejectReason


class MessageCounts(NamedTuple):
    """Of one subscription since its node started. received = processed + the sum of ``dropped``."""

    received: int
    processed: int
    dropped: Mapping[RejectReason, int]  #: only the reasons that have occurred


def health_status(node: str, now: Mapping[str, MessageCounts], before: Mapping[str, MessageCounts]) -> DiagnosticStatus:
    """Return the status of ``node``, by its full name; counts are by topic, of now and of the last status.

    WARN: messages were dropped since then; STALE: a topic has brought none; else OK.
    """
    dropped = Counter(_dropped(now))
    grown = dropped - Counter(_dropped(before))
    silent = [topic for topic, counts in now.items() if counts.received == before[topic].received]
    processed = _sum(now, 'processed') - _sum(before, 'processed')
    if grown:
        texts = ', '.join(f'{count} ({reason.key})' for reason, count in sorted(grown.items()))
        level, text = DiagnosticStatus.WARN, f'messages dropped: {texts}'
    elif silent:
        level, text = DiagnosticStatus.STALE, f'nothing received on {", ".join(silent)}'
    else:
        level, text = DiagnosticStatus.OK, f'{processed} messages, none dropped'
    values = {'received': _sum(now, 'received'), 'processed': _sum(now, 'processed'),
              **{f'dropped_{reason.key}': dropped[reason] for reason in RejectReason if reason}}
    return DiagnosticStatus(level=level, name=node, message=text,
                            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()])


def _sum(counts: Mapping[str, MessageCounts], field: str) -> int:
    return sum(getattr(of_topic, field) for of_topic in counts.values())


def _dropped(counts: Mapping[str, MessageCounts]) -> Counter[RejectReason]:
    total: Counter[RejectReason] = Counter()
    for of_topic in counts.values():
        total.update(of_topic.dropped)
    return total
