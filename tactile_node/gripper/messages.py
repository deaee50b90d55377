"""Convert the messages of a gripper's action to numbers and back, and extract the touch from a grasp.

The actions `GripperCommand` and `ParallelGripperCommand` come from control_msgs, which is an optional package.
"""

import math
from typing import Any, NamedTuple

from tactile_node.errors import ConfigurationError, RefusedGoalError
from tactile_node.grasp.tracker import GraspContact, SideState
from tactile_node.gripper.rules.closing import ForceReading, TouchReading
from tactile_node.gripper.rules.put_down import HeldContact, HeldReading
from tactile_node.ros.shape_messages import contact_pitch, fitted_angle
from tactile_skin.msg import ContactShape, Grasp, GraspSides

INTERFACES = PARALLEL, SINGLE = 'ParallelGripperCommand', 'GripperCommand'


class GoalValues(NamedTuple):
    """Content of a goal in the gripper's own units.

    A speed or effort is 0 if the goal gives no value, and NaN if the goal gives several values.
    """

    position: float
    speed: float = 0.0
    effort: float = 0.0


class GripperState(NamedTuple):
    """State that the gripper reports in its own units, with NaN for unknown values."""

    position: float = math.nan
    effort: float = math.nan
    stalled: bool = False
    reached_goal: bool = False


class _Single:
    """Converts the messages of a GripperCommand action."""

    commands_speed = False

    def __init__(self, action: Any):
        self.action = action

    def values(self, goal: Any) -> GoalValues:
        """Return the values that ``goal`` contains."""
        return GoalValues(goal.command.position, 0.0, goal.command.max_effort)

    def goal(self, values: GoalValues) -> Any:
        goal = self.action.Goal()
        goal.command.position, goal.command.max_effort = values.position, values.effort
        return goal

    def state(self, message: Any) -> GripperState:
        """Return the state that a feedback or result message contains."""
        return GripperState(message.position, message.effort, message.stalled, message.reached_goal)

    def fill(self, message: Any, state: GripperState) -> Any:
        """Write ``state`` into a feedback or result message, and return the message."""
        message.position, message.effort = state.position, state.effort
        message.stalled, message.reached_goal = state.stalled, state.reached_goal
        return message


class _Parallel:
    """Converts the messages of a ParallelGripperCommand action, whose feedback lacks stalled and reached_goal."""

    commands_speed = True

    def __init__(self, action: Any, joint: str):
        self.action, self._joint = action, joint

    def values(self, goal: Any) -> GoalValues:
        """Return the values in ``goal``. Raises RefusedGoalError unless it has one position for the joint."""
        asked = goal.command
        names, count = list(asked.name), len(asked.position)
        if count != 1 or (self._joint and names and names != [self._joint]):
            raise RefusedGoalError('command', expected=f'one position of {self._joint or "one joint"}',
                                   got=f'{count} of {", ".join(names) or "no name"}',
                                   remedy='Command the joint that is set in the parameter joint.')
        speed, effort = (math.nan if len(each) > 1 else _first(each, 0.0) for each in (asked.velocity, asked.effort))
        return GoalValues(asked.position[0], speed, effort)

    def goal(self, values: GoalValues) -> Any:
        goal = self.action.Goal()
        goal.command.name = [self._joint] if self._joint else []
        goal.command.position, goal.command.effort = [values.position], [values.effort]
        goal.command.velocity = [values.speed] if values.speed else []
        return goal

    def state(self, message: Any) -> GripperState:
        names = list(message.state.name)
        at = names.index(self._joint) if self._joint in names else len(names) if self._joint else 0
        return GripperState(_first(message.state.position[at:], math.nan), _first(message.state.effort[at:], math.nan),
                            getattr(message, 'stalled', False), getattr(message, 'reached_goal', False))

    def fill(self, message: Any, state: GripperState) -> Any:
        message.state.name = [self._joint] if self._joint else []
        message.state.position, message.state.effort = [state.position], [state.effort]
        if hasattr(message, 'stalled'):
            message.stalled, message.reached_goal = state.stalled, state.reached_goal
        return message


GripperInterface = _Single | _Parallel


def gripper_interface(name: str, joint: str) -> GripperInterface:
    """Return the converter for the messages of an action type.

    Parameters
    ----------
    name
        ParallelGripperCommand or GripperCommand.
    joint
        Name of the joint in a ParallelGripperCommand; '' for any joint.

    Raises
    ------
    ConfigurationError
        Raised if the name is unknown, or if control_msgs is not installed.
    """
    if name not in INTERFACES:
        raise ConfigurationError('action_type', expected=' or '.join(INTERFACES), got=repr(name),
                                 remedy="`ros2 action list -t` lists the type of the gripper's own action.")
    try:
        from control_msgs import action
    except ImportError:
        raise ConfigurationError('control_msgs', expected='the package with the gripper actions', got='none',
                                 remedy='Run apt install ros-$ROS_DISTRO-control-msgs, or, without a ROS installation, '
                                 'make messages; source build/messages/setup.bash.') from None
    return _Parallel(action.ParallelGripperCommand, joint) if name == PARALLEL else _Single(action.GripperCommand)


def _first(values: Any, default: float) -> float:
    return values[0] if len(values) else default


def touch_of(grasp: Grasp, acquired: float) -> TouchReading:
    """Return the touch described by a grasp message.

    If a force is a bound although the contact does not reach the pad's edge, hidden or saturated taxels are the cause,
    perhaps in another contact.

    Parameters
    ----------
    grasp
        Grasp message.
    acquired
        Acquisition time of the taxels, on the steady clock [s].
    """
    pads = [ForceReading(force, is_bound, bool(hidden or saturated or not seen or is_bound and not at_edge))
            for force, is_bound, hidden, saturated, seen, at_edge in zip(
                grasp.forces, grasp.force_is_bound, grasp.hidden_taxels, grasp.saturated_taxels, grasp.pads_seen,
                grasp.at_edge)]
    slides = [each.direction if each.moving & each.SLIDING else math.nan for each in grasp.motions]
    return TouchReading(acquired, grasp.fresh, GraspContact(grasp.contact), (pads[0], pads[1]),
                        force_sd=2 * grasp.grip_force_sd, slides=(slides[0], slides[1]))


def held_reading(message: GraspSides, acquired: float) -> HeldReading:
    """Return the readings of both pads that a put-down needs.

    Parameters
    ----------
    message
        Results of both pads.
    acquired
        Acquisition time of the older result, on the steady clock [s].
    """
    states = SideState(message.side_states[0]), SideState(message.side_states[1])
    left, right = (_held_contact(side) for side in message.sides)
    pads = None if left is None or right is None else (left, right)
    return HeldReading(acquired, GraspContact.of(states), pads,
                       (message.sides[0].sequence, message.sides[1].sequence))


def _held_contact(side: ContactShape) -> HeldContact | None:
    """Return the contact of a pad, or None if the pad has no contact or several, or if CAN frames were lost."""
    place = side.centre_of_pressure
    if side.contacts != 1 or side.missing_can_frames or not (math.isfinite(place.x) and math.isfinite(place.y)):
        return None
    contact = HeldContact((place.x, place.y), side.pad_force, contact_pitch(side))
    if not side.fit_valid:
        return contact
    return contact._replace(outline=side.class_name, angle=fitted_angle(side), symmetry=side.symmetry)
