"""The fate of every CAN frame, as text."""

from tactile_node.frames.losses import BusStatistics


def summary(statistics: BusStatistics) -> str:
    """Return a table of what was published and the fate of every CAN frame."""
    lines = []
    for name, pad in statistics.pads.items():
        losses = ', '.join(f'{count} {reason.key}' for reason, count in pad.losses.items() if count) or 'none lost'
        lines.append(f'{name}: {pad.published} taxel frames, {pad.complete} complete, {pad.incomplete} incomplete; '
                     f'TPDOs: {pad.expected} expected, {pad.received} received, {pad.used} used, {losses}')
    services = ', '.join(f'{count} {service}' for service, count in sorted(statistics.can_frames.items()))
    lines.append(f'CAN frames: {sum(statistics.can_frames.values())} ({services}); lines unread: {statistics.unread}')
    return '\n'.join(lines)
