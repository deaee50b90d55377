"""Parameters of the gripper node; see settings.py."""

from dataclasses import dataclass

from tactile_node.gripper.rules.touch_settings import TouchSettings
from tactile_node.parameter import parameter
from tactile_node.ros.settings import ReceiverSettings


@dataclass(frozen=True)
class GripperSettings(TouchSettings, ReceiverSettings):
    """Parameters of the gripper node: the settings of its rules, and the properties of the gripper's own action."""

    gripper_action: str = parameter('gripper_controller/gripper_cmd', "name of the gripper's own action, to which this "
                                    'node forwards commands')
    action_type: str = parameter('ParallelGripperCommand', 'type of both actions: ParallelGripperCommand or '
                                 'GripperCommand (control_msgs); a GripperCommand carries no speed')
    joint: str = parameter('', 'name of the joint in a ParallelGripperCommand; empty: the commands of this node name '
                           'no joint, and a goal may name any joint')
    gap_scale: float = parameter(1.0, "change of the opening per metre or radian of the gripper's position: opening = "
                                 'gap_offset + gap_scale * position; below 0 if the gripper closes as its position '
                                 'rises', -1000, 1000)
    gap_offset: float = parameter(0.0, 'opening when the position is 0 [m]', -10, 10)
    gripper_effort: float = parameter(10.0, "effort limit sent with every command, in the gripper's unit; the limit "
                                      'still holds after this node has ended', 1e-6, 1e6)
