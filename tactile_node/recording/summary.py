"""The fate of every CAN frame, as text."""

from tactile_node.frames.losses import BusStatistics


def summary(statistics: BusStatistics) -> str:
    """Return a table of what was published and the fate of every CAN frame."""
    lines = []
    for name, pad in statistics.pads.items():
        fates = {'used': pad.used} | {reason.key: count for reason, count in pad.losses.items() if count}
        lines.append(f'{name}: {pad.published} taxel frames, {pad.complete} complete, {pad.incomplete} incomplete; '
                     f'TPDOs: {pad.expected} expected, {pad.missing} brought no taxels; {pad.received} received: ' +
                     ', '.join(f'{count} {fate}' for fate, count in fates.items()))
    services = ', '.join(f'{count} {service}' for service, count in sorted(statistics.can_frames.items()))
    lines.append(f'CAN frames: {sum(statistics.can_frames.values())} ({services}); lines unread: {statistics.unread}')
    return '\n'.join(lines)
