"""Slows a log played as fast as possible to the pace of the last stage, which reports its progress."""

import threading
from collections.abc import Sequence
from functools import partial

from rclpy.node import Node
from rclpy.qos import QoSProfile

from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.ros.message_checks import RejectReason
from tactile_skin.msg import Progress

WINDOW = 500  # frames that may be under way; well below qos.REPLAY_DEPTH
TIMEOUT = 10.0  # how long no progress may come before the log is played without it [s]


class ReplayGate:
    """One gate for all pads of a log; ``wait`` is called on the log's thread, progress arrives on the node's."""

    def __init__(self, node: Node, pads: Sequence[str], qos: QoSProfile):
        self._node = node
        self._open = False
        self._played = dict.fromkeys(pads, -1)  # the last frame let through
        self._seen = dict.fromkeys(pads, -1)
        self._progress = threading.Condition()
        self._subscriptions = [
            GuardedSubscription(node, Progress, f'{pad}/progress', partial(self._on_progress, pad), qos,
                                check=partial(self._check, pad)) for pad in pads]

    def wait(self, pad: str, sequence: int) -> None:
        """Return when fewer than WINDOW frames before ``sequence`` are still under way."""
        with self._progress:
            while not self._open and sequence - self._seen[pad] > WINDOW:
                if not self._progress.wait(TIMEOUT):
                    self._open = True
                    self._node.get_logger().warning(
                        f'No progress for {TIMEOUT:.0f} s: the log is played without waiting for any.')
            self._played[pad] = sequence

    def destroy(self) -> None:
        """Stop listening and release a waiting log."""
        with self._progress:
            self._open = True
            self._progress.notify_all()
        for subscription in self._subscriptions:
            subscription.destroy()

    def _check(self, pad: str, message: Progress) -> RejectReason | None:
        """Progress of a frame that was not played yet would open the gate until the log gets there."""
        return RejectReason.WRONG_SEQUENCE if message.sequence > self._played[pad] else None

    def _on_progress(self, pad: str, message: Progress) -> None:
        with self._progress:
            self._seen[pad] = max(self._seen[pad], message.sequence)
            self._progress.notify_all()
