"""The gripper node serves an action that closes the gripper until both pads are touched, and an action to put down.

The node forwards commands to the gripper's own action. The node is not a safety function.
"""

import logging
import math
import sys
import time
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile

from tactile_node.errors import RefusedGoalError
from tactile_node.grasp.opening import GapSource, LinearGap
from tactile_node.gripper.duplicate_watch import DuplicateWatch
from tactile_node.gripper.gripper_client import GripperClient
from tactile_node.gripper.gripper_settings import GripperSettings
from tactile_node.gripper.health import gripper_status, unseen_text, unserved_text
from tactile_node.gripper.messages import GripperState, gripper_interface, touch_of
from tactile_node.gripper.put_down_watch import RESULT_TIMEOUT, PutDownWatch
from tactile_node.gripper.rules.closing import FAILURES, NO_TOUCH, Outcome
from tactile_node.gripper.rules.control import Ending, TouchControl, Wish
from tactile_node.nodes.grasp_requests import allow_feedback
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.nodes.node_health import MessageHealth, publish_status
from tactile_node.nodes.run import run_node
from tactile_node.ros.grasp_checks import check_grasp
from tactile_node.ros.message_age import InputAge, age_seconds
from tactile_node.ros.parameters import declare, read
from tactile_node.ros.publishers import publisher_names
from tactile_node.ros.rosout_handler import of_node
from tactile_skin.msg import Grasp, GripperOutcome

LOOK_PERIOD = 0.01  #: Time between two checks of a goal [s]. The goal is also checked at each new grasp.
CANCEL_PERIOD = 0.2  #: Time after which an unanswered cancel request is sent again [s].
#: Sources whose opening counts as measured. The value of a parameter does not count, because it may be old.
MEASURED = (int(GapSource.JOINT_STATES), int(GapSource.TF))

logger = logging.getLogger(__name__)


class GripperNode(Node):
    """Serves the action `~/gripper_cmd`, which a client calls instead of the gripper's own action, and `~/put_down`.

    A goal has the status ACCEPTED (in Lyrical EXECUTING) until its result is known.

    Parameters
    ----------
    steady : callable
        Steady clock for ages and timeouts [s].
    **options
        Keyword arguments for rclpy's ``Node``.

    Raises
    ------
    ConfigurationError
        Raised if a parameter is invalid.
    """

    def __init__(self, *, steady: Callable[[], float] = time.monotonic, **options: Any):
        self._steady = steady
        self._ends: list[Callable[[], None]] = []  # set first, because Kilted destroys a node that has failed
        super().__init__('touch_gripper', **options)
        declare(self, GripperSettings)
        self._settings = settings = read(self, GripperSettings)
        self._law = LinearGap(settings.gap_offset, settings.gap_scale)
        self._interface = gripper_interface(settings.action_type, settings.joint)
        self._ages = InputAge(steady=steady)
        self._grasp: Grasp | None = None
        self._acquired = -math.inf
        self._client = GripperClient(self, self._interface, settings.gripper_action, self._law,
                                     settings.gripper_effort)
        self._ends.append(self._client.destroy)
        self._outcomes = self.create_publisher(GripperOutcome, '~/outcome', QoSProfile(depth=10))
        self._watch = DuplicateWatch(self, (f'{settings.gripper_action}/touch_gripper', '~/heartbeat'), steady=steady)
        self._control = TouchControl(settings, self._client, self._watch, self._on_end, why_unseen=self._why_unseen,
                                     commands_speed=self._interface.commands_speed, steady=steady)
        self._grasps = GuardedSubscription(self, Grasp, 'grasp', self._on_grasp, settings.input_qos, check=check_grasp,
                                           newest_only=True, lossless=settings.lossless, steady=steady)
        MessageHealth(self, [self._grasps], settings)
        publish_status(self, self._status)
        # The timers use the steady clock, because with use_sim_time and no /clock, the node could not stop a closing
        # gripper.
        self.create_timer(CANCEL_PERIOD, self._control.commands.repeat_cancels,
                          clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._timer = self.create_timer(LOOK_PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._timer.cancel()
        server = ActionServer(
            self, self._interface.action, '~/gripper_cmd', execute_callback=lambda handle: None,
            handle_accepted_callback=self._on_accepted, cancel_callback=lambda handle: CancelResponse.ACCEPT,
            result_timeout=RESULT_TIMEOUT)
        put_down = PutDownWatch(self, self._control, self._watch, settings, steady=steady)
        self._ends += [server.destroy, put_down.destroy, self._shut_down]

    def destroy_node(self) -> None:
        """Stop a closing gripper, because the node can no longer monitor it."""
        while self._ends:
            self._ends.pop()()
        super().destroy_node()

    def _shut_down(self) -> None:
        if self.context.ok():
            self._control.shut_down()

    def _on_grasp(self, grasp: Grasp) -> None:
        arrival, control = self._ages.arrived(grasp), self._control
        self._grasp, self._acquired = grasp, arrival.acquired
        is_only_one = self.count_publishers(self._grasps.topic) <= 1  # if two nodes publish grasps, either may be wrong
        control.touch = touch_of(grasp, arrival.acquired).after(control.touch) if is_only_one else NO_TOUCH
        # The age is NaN if neither age is known, and inf if only the age on arrival is not known.
        held_back = arrival.age_on_arrival - age_seconds(grasp.age)
        if is_only_one and held_back != math.inf and grasp.gap_source in MEASURED and math.isfinite(grasp.gap):
            sent = arrival.steady - (0.0 if math.isnan(held_back) else held_back)
            control.measure(grasp.gap, sent - age_seconds(grasp.gap_age))
        self._look()
        if (handle := control.goal_handle) is not None:
            handle.publish_feedback(self._interface.fill(self._interface.action.Feedback(), self._state()))

    def _on_accepted(self, handle: ServerGoalHandle) -> None:
        allow_feedback(handle)
        try:
            asked = self._interface.values(handle.request)
        except RefusedGoalError as error:
            self._control.refuse(handle, str(error))
            return
        self._timer.reset()
        self._control.accept(handle, Wish(self._law.gap(asked.position), asked.speed * abs(self._law.scale),
                                          asked.effort))

    def _look(self) -> None:
        self._control.look()
        if self._control.work == 'none':
            self._timer.cancel()

    def _why_unseen(self) -> str:
        topic = self._grasps.topic
        return unseen_text(topic, self._grasps.counts, publisher_names(self, topic), self._grasp,
                           self._steady() - self._acquired, self._settings.max_age)

    def _status(self) -> DiagnosticStatus:
        control = self._control
        return gripper_status(self.get_fully_qualified_name(), self.resolve_topic_name(self._settings.gripper_action),
                              duplicate=self._watch.text, is_served=self._client.is_there, work=control.work,
                              last=control.last, grasp_age=self._steady() - control.touch.acquired)

    def _state(self, outcome: Outcome | None = None) -> GripperState:
        """Return the gripper state for feedback or a result, in the units of the gripper.

        The effort field contains the force on the more strongly pressed pad.
        """
        return GripperState(self._law.reading(self._control.opening), self._control.force,
                            stalled=outcome in (Outcome.TOUCHED, Outcome.FORCE_REACHED, Outcome.STALLED),
                            reached_goal=outcome is Outcome.REACHED)

    def _on_end(self, handle: ServerGoalHandle, ending: Ending) -> None:
        """Publish the outcome of a goal or hold, and send the result of a goal."""
        if ending.outcome in FAILURES and not self._client.is_there:
            action = self.resolve_topic_name(self._settings.gripper_action)
            ending = ending._replace(reasons=(*ending.reasons, unserved_text(action)))
        message = GripperOutcome(goal_id=handle.goal_id.uuid, outcome=int(ending.outcome), of_hold=ending.is_hold,
                                 message=ending.text, opening=ending.opening,
                                 forces=[pad.force for pad in ending.pads],
                                 force_is_bound=[pad.is_bound for pad in ending.pads])
        message.header.stamp = self.get_clock().now().to_msg()
        self._outcomes.publish(message)
        if not ending.is_usual:
            level = logging.ERROR if ending.outcome is Outcome.REFUSED else logging.WARNING
            logger.log(level, '%s ended: %s', 'hold' if ending.is_hold else 'goal', ending.text,
                       extra=of_node(self))
        if ending.is_hold:
            return
        state = self._state(ending.outcome)

        def execute(handle: ServerGoalHandle) -> Any:
            end = handle.succeed if ending.succeeds else handle.abort
            (handle.canceled if ending.outcome is Outcome.CANCELED else end)()
            return self._interface.fill(self._interface.action.Result(), state)
        handle.execute(execute)


def main() -> int:
    """Run the node and return the exit code."""
    return run_node(GripperNode)


if __name__ == '__main__':
    sys.exit(main())
