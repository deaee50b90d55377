"""What a driver that plays a log adds: the time of the log, and its pace where nothing may be lost."""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from threading import Event

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock

from tactile_node.assembly.frame_source import FrameSource
from tactile_node.bus.threads import Reminder
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.nodes.spinning import Spinner
from tactile_node.ros.message_checks import RejectReason
from tactile_node.ros.time_messages import time_message
from tactile_skin.msg import Progress

CLOCK_STEP = 0.01  # s of the log between two messages on /clock
WINDOW = 500  # frames that may be under way; well below qos.REPLAY_DEPTH
TIMEOUT = 10.0  # how long a pad's progress may stand still before its frames are played without waiting [s]


class ClockOutput:
    """Publishes the time of a log as it is played, for nodes with use_sim_time; it never goes back."""

    def __init__(self, node: Node):
        self._node = node
        self._due = 0.0
        self._publisher = node.create_publisher(Clock, '/clock', QoSProfile(depth=1))

    def show(self, stamp: float) -> None:
        """The CAN frame stamped ``stamp`` [s, Unix epoch] is played now."""
        if stamp >= self._due:
            self._due = stamp + CLOCK_STEP
            self._publisher.publish(Clock(clock=time_message(stamp)))

    def destroy(self) -> None:
        self._node.destroy_publisher(self._publisher)


class _Pad:
    """Frames of one pad that were let through and are not answered yet."""

    def __init__(self) -> None:
        self.under_way: deque[int] = deque()
        self.last = -1
        self.is_given_up = False  # until progress comes again

    def answered(self, sequence: int) -> None:
        self.is_given_up = False
        while self.under_way and self.under_way[0] <= sequence:
            self.under_way.popleft()


class ReplayGate:
    """One gate for each pad of a log; ``wait`` is called on the log's thread, progress arrives on the node's."""

    def __init__(self, node: Node, pads: Sequence[str], qos: QoSProfile):
        self._node = node
        self._pads = {pad: _Pad() for pad in pads}
        self._is_released = False
        self._progress = threading.Condition()
        self._subscriptions = [
            GuardedSubscription(node, Progress, f'{pad}/progress', partial(self._on_progress, pad), qos,
                                check=partial(self._check, pad)) for pad in pads]

    def wait(self, pad: str, sequence: int) -> None:
        """Return when fewer than WINDOW frames of ``pad`` are under way; ``sequence`` is one of them from now on."""
        state = self._pads[pad]
        with self._progress:
            while len(state.under_way) >= WINDOW and not (state.is_given_up or self._is_released):
                if not self._progress.wait_for(lambda: len(state.under_way) < WINDOW or self._is_released, TIMEOUT):
                    state.is_given_up = True
                    self._node.get_logger().warning(
                        f'Pad {pad}: {len(state.under_way)} frames are not answered, and none was for {TIMEOUT:g} s. '
                        'The log is played without waiting for this pad until one is. Check that its classifier runs, '
                        'with lossless: true.')
            if len(state.under_way) >= WINDOW:
                state.under_way.popleft()
            state.under_way.append(sequence)
            state.last = sequence

    def hold(self) -> None:
        """Let frames wait again after ``release``."""
        self._is_released = False

    def release(self) -> None:
        """Let everything through: the log is about to be stopped, and its thread must not wait for this one."""
        with self._progress:
            self._is_released = True
            self._progress.notify_all()

    def destroy(self) -> None:
        """Stop listening and release a waiting log."""
        self.release()
        for subscription in self._subscriptions:
            subscription.destroy()

    def _check(self, pad: str, message: Progress) -> RejectReason | None:
        """Progress of a frame that was not played yet would open the gate until the log gets there."""
        return RejectReason.WRONG_SEQUENCE if message.sequence > self._pads[pad].last else None

    def _on_progress(self, pad: str, message: Progress) -> None:
        with self._progress:
            self._pads[pad].answered(message.sequence)
            self._progress.notify_all()


logger = logging.getLogger(__name__)

DRAIN_TIMEOUT = 5.0  # s without a new shape: no more will come
POLL_PERIOD = 0.05  # s


def published_frames(source: FrameSource) -> int:
    """Taxel frames of all pads that the driver has published."""
    return sum(pad.published for pad in source.statistics().pads.values())


def drain(source: FrameSource, shapes: Callable[[], int], spinner: Spinner, stop_requested: Event) -> int:
    """Wait until ``shapes()`` counts as many as ``source`` has published, or none has come for DRAIN_TIMEOUT.

    Returns the count; raises what a callback has raised.
    """
    count, remaining, reminder = shapes(), DRAIN_TIMEOUT, Reminder()
    while remaining > 0 and not stop_requested.wait(POLL_PERIOD):
        spinner.check()
        before, count = count, shapes()
        if count >= published_frames(source):
            break
        if reminder.is_due(drain.__name__, time.monotonic()):
            logger.info('Waiting for the last shapes: %d of %d taxel frames so far.', count, published_frames(source))
        remaining = DRAIN_TIMEOUT if count > before else remaining - POLL_PERIOD
    return count
