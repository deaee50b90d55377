"""The grasp node combines the shapes on two opposing pads into one grasp."""

import math
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from tactile_node.chain import Step
from tactile_node.grasp.gripper import Gripper, PadPose
from tactile_node.grasp.steadiness import SteadinessSettings
from tactile_node.grasp.tracker import SIDES, GraspSettings, GraspTracker
from tactile_node.node_graph import Role
from tactile_node.nodes.grasp_requests import CurrentGrasp, GraspRequests
from tactile_node.nodes.on_demand_publisher import OnDemandPublisher
from tactile_node.nodes.opening_source import make_opening_source
from tactile_node.nodes.pad_transforms import publish_pad_frames
from tactile_node.nodes.run import run_node
from tactile_node.nodes.stage import StageInput, Stages
from tactile_node.nodes.stage_node import StageNode
from tactile_node.ros.grasp_messages import grasp_message, side_result, sides_message
from tactile_node.ros.message_checks import check_contact_shape
from tactile_node.ros.parameters import declare, read
from tactile_node.ros.settings import GraspNodeSettings
from tactile_node.ros.shape_messages import PadShape, pad_shape_of
from tactile_node.ros.time_messages import seconds
from tactile_skin.msg import ContactShape, Grasp, GraspSides

#: If a stamp goes back by more than this time, another log is being replayed [s]. The stamps of the pads in one log
#: differ by less.
ANOTHER_LOG = 60.0
SILENCE_PERIOD = 0.02  #: Time between two checks whether a pad is silent [s].


class GraspNode(StageNode):
    """Publishes `grasp` and `grasp_sides` for the usable messages on `<pad>/shape` from its two pads.

    If shapes of both pads are waiting, the node publishes one grasp for both. In a lossless replay, the node
    publishes a grasp for every shape.

    While a pad publishes no shapes, the node publishes both topics again and again, so that the last grasp does not
    look current. A client uses the action `~/wait_for_grasp` or the service `~/check_grasp` to find out whether the
    grasp meets its requirement.

    The arguments are those of `StageNode`, and ``steady``, the steady clock for ages and timeouts [s]. The constructor
    raises ConfigurationError if a parameter is invalid.
    """

    def __init__(self, stages: Stages | None = None, *, steady: Callable[[], float] = time.monotonic,
                 **options: Any):
        # These attributes are set before rclpy's constructor, because Kilted calls destroy_node even after a failed
        # constructor.
        self._steady = steady
        # The chain updates the grasp, a ticker notices silences, and the executor answers requests. A chain that hangs
        # in another stage does not hold the lock, so it cannot hide a silence.
        self._lock = threading.RLock()
        self._received = -math.inf  # time when the latest shape was received [s]
        self._requests: GraspRequests | None = None
        super().__init__(Role.GRASP, stages, **options)
        declare(self, GraspNodeSettings)
        self._settings = settings = read(self, GraspNodeSettings)
        self._gripper = gripper = Gripper(PadPose(settings.left_xyz, settings.left_rpy),
                                          PadPose(settings.right_xyz, settings.right_rpy))
        self._tracker = GraspTracker(GraspSettings(
            gripper, SteadinessSettings(settings.max_creep, settings.centre_tolerance), min_hold=settings.min_hold,
            max_skew=settings.max_skew, max_age=settings.max_age))
        self._opening = make_opening_source(self, settings, gripper.closing, steady)
        publish_pad_frames(self, settings, gripper, self._opening, steady)
        self._latest = {side: pad_shape_of(ContactShape()) for side in SIDES}
        self._is_published = True  # False while a shape waits to be published in a grasp
        self._stamp = 0.0  # latest stamp, which serves as the clock of a lossless replay [s]
        qos, lossless = settings.qos, settings.lossless
        self._grasps = OnDemandPublisher(self, Grasp, 'grasp', qos, lossless=lossless)
        self._grasp_sides = OnDemandPublisher(self, GraspSides, 'grasp_sides', qos, lossless=lossless)
        self._requests = GraspRequests(self, self._current, steady)
        # time at which each side counts as silent unless another shape arrives, on the steady clock [s]
        self._silent_at = dict.fromkeys(SIDES, math.inf)
        self._shapes: dict[str, StageInput[ContactShape, PadShape]] = {
            side: StageInput(self, ContactShape, f'{pad}/shape', partial(self.accept, side), settings,
                             check=check_contact_shape, parse=pad_shape_of, stages=self._stages, steady=steady)
            for side, pad in zip(SIDES, (settings.left_pad, settings.right_pad))}
        self.begin_stage(settings, tuple(self._shapes.values()))
        self.tick(SILENCE_PERIOD, self._look_for_silence)

    def accept(self, side: str, shape: PadShape) -> None:
        """Update the grasp with a new shape from one pad, and publish the grasp after the waiting shapes.

        Parameters
        ----------
        side : str
            Side of the pad, one of SIDES.
        shape : PadShape
            Shape on the pad of this side.
        """
        stamp = seconds(shape.header.stamp)
        result = side_result(shape, stamp if self._settings.lossless else shape.acquired)
        with self._lock:
            self._received = self._steady()
            self._latest[side] = shape
            self._stamp = max(stamp, self._stamp) if self._stamp - stamp < ANOTHER_LOG else stamp
            self._tracker.update(side, result, self._now())
            self._is_published = False
            if not self._settings.lossless:
                self._silent_at[side] = self._steady() + self._tracker.silence_limit(side)
        # A grasp of unknown age waits for no other shape, because its order among the shapes is not known either.
        if self._settings.lossless or shape.acquired == -math.inf:
            self._publish_update()
        else:
            self._shapes[side].postpone(Step.COMBINE, shape.acquired, self._publish_update)

    def _publish_update(self) -> None:
        """Publish the grasp unless it has been published since the latest shape."""
        with self._lock:
            if not self._is_published:
                self._publish_at(self._now())

    def _now(self) -> float:
        """Return the current time [s]: the latest stamp in a lossless replay, otherwise the steady clock."""
        return self._stamp if self._settings.lossless else self._steady()

    def _look_for_silence(self) -> None:
        """Publish the grasp again and again while a side is silent, so that the last grasp does not look current."""
        now = self._steady()
        with self._lock:
            silent = [side for side in SIDES if now >= self._silent_at[side]]
            for side in silent:
                self._silent_at[side] = now + self._tracker.silence_limit(side)
            if silent:
                self._publish_at(self._now())

    def destroy_node(self) -> None:
        """Publish a grasp without results before the node ends, because the last grasp would otherwise look valid."""
        self.end_stage()
        if self.context.ok() and self._received > -math.inf:
            self._publish_at(math.inf)
        if self._requests is not None:
            self._requests.destroy()
        super().destroy_node()

    def _publish_at(self, now: float) -> None:
        """Compute the grasp at the time ``now`` [s] from the shapes received so far, and publish it."""
        with self._lock:
            grasp = self._grasp_at(now)
            self._grasps.publish(grasp.message)
            self._grasp_sides.publish(grasp.sides_message)
            self._is_published = True
            if self._requests is not None:
                self._requests.wake()

    def _current(self) -> CurrentGrasp:
        """Return the current grasp from the shapes received so far.

        The stamps stand still after a lossless replay has ended. All shapes therefore count as too old once no shape
        has arrived for max_age.
        """
        with self._lock:
            has_ended = self._settings.lossless and self._steady() - self._received > self._settings.max_age
            return self._grasp_at(math.inf if has_ended else self._now())

    def _grasp_at(self, now: float) -> CurrentGrasp:
        opening = self._opening.current()
        state = self._tracker.state(now, opening.gap)
        sides, ages = [self._latest[side] for side in SIDES], self._ages()
        return CurrentGrasp(
            state, sides,
            partial(grasp_message, state, sides, opening, self._settings.frame, ages, self._gripper),
            partial(sides_message, state, sides, self._settings.frame, ages))

    def _ages(self) -> list[float]:
        """Return the age of each side's latest shape [s], or inf if the side has none."""
        now = self._steady()
        return [now - self._latest[side].acquired for side in SIDES]


def main() -> int:
    """Run the node and return the exit code."""
    return run_node(GraspNode)


if __name__ == '__main__':
    sys.exit(main())
