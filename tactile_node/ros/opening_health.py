"""The diagnostic of the opening of the gripper: whether it is known, and what was dropped of its messages."""

import math
from collections import Counter
from collections.abc import Iterable

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from tactile_node.grasp.opening import GapSource, Opening
from tactile_node.ros.message_checks import RejectReason
from tactile_node.ros.message_health import MessageCounts


def total(counts: Iterable[MessageCounts]) -> Counter[RejectReason]:
    """Return what was dropped of all subscriptions."""
    return sum((Counter(each.dropped) for each in counts), Counter())


def why_not_known(opening: Opening, remedy: str) -> str:
    """Return why the gap of ``opening`` is NaN; ``remedy``: what its source lacks without a value."""
    if opening.source is GapSource.NOT_KNOWN:
        return remedy
    if opening.age == math.inf:
        return 'its stamps do not advance with time, so it may be of any age (one publisher? a clock that is set?)'
    return f'its last value is {opening.age:.1f} s old; {remedy}'


def opening_status(node: str, opening: Opening, dropped: Counter[RejectReason], before: Counter[RejectReason],
                   remedy: str) -> DiagnosticStatus:
    """Return the status of the opening of ``node``; ``before``: what was dropped until the last status.

    STALE: the opening is not known; WARN: it is, and messages were dropped since the last status; else OK.
    """
    grown = ', '.join(f'{count} ({reason.key})' for reason, count in sorted((dropped - before).items()))
    is_known = not math.isnan(opening.gap)
    texts = [f'{1e3 * opening.gap:.1f} mm' if is_known else f'not known: {why_not_known(opening, remedy)}',
             *([f'messages dropped: {grown}'] if grown else [])]
    level = DiagnosticStatus.STALE if not is_known else DiagnosticStatus.WARN if grown else DiagnosticStatus.OK
    values = {'gap_m': f'{opening.gap:.4f}', 'source': opening.source.name.lower(),
              'age_s': f'{opening.age:.3f}' if opening.age < math.inf else 'not known',
              **{f'dropped_{reason.key}': dropped[reason] for reason in RejectReason if reason}}
    return DiagnosticStatus(level=level, name=f'{node}: opening', message='; '.join(texts),
                            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()])
