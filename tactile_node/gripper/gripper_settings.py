"""Parameters of the gripper node; see settings.py. Most parameters set the limits of `TouchLimits` and `HoldLimits`."""

from dataclasses import dataclass
from typing import TypeVar

from tactile_node.grasp.opening import HIGHEST_GAP
from tactile_node.gripper.rules.closing import TouchLimits
from tactile_node.gripper.rules.holding import HoldLimits
from tactile_node.ros.settings import ReceiverSettings, parameter

LIMITS, HOLD = TouchLimits(), HoldLimits()

Limits = TypeVar('Limits', TouchLimits, HoldLimits)


@dataclass(frozen=True)
class GripperSettings(ReceiverSettings):
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
    stop_by: str = parameter('cancel', "way to stop the gripper: cancel (cancel the gripper's action), or goal (send a "
                             'goal at the present position)')
    answer_timeout: float = parameter(0.5, 'time allowed for the gripper to accept a command and to confirm a stop [s]',
                                      0.02, 60)
    widest: float = parameter(LIMITS.widest, 'jaw opening when the gripper is fully open [m]; a goal of at least this '
                              'opening opens the gripper, unless the gripper is measured to be wider',
                              1e-3, HIGHEST_GAP)
    fast_speed: float = parameter(LIMITS.fast_speed, 'closing speed until the first touch [m/s]; for a GripperCommand, '
                                  "give the gripper's own speed", 1e-5, 10)
    slow_speed: float = parameter(LIMITS.slow_speed, 'closing speed after the first touch, or below slow_from '
                                  '[m/s]', 1e-5, 10)
    slow_from: float = parameter(LIMITS.slow_from, 'opening below which the gripper closes slowly [m]; 0: the gripper '
                                 'closes slowly only after the first touch', 0, HIGHEST_GAP)
    touch_force: float = parameter(LIMITS.touch_force, 'force limit for a goal without effort: the gripper closes '
                                   'until both pads are touched or the more strongly pressed pad reaches this force '
                                   '[N]', 1e-3, 1e4)
    highest_force: float = parameter(LIMITS.highest_force, 'maximum effort that a goal may have [N]', 1e-3, 1e4)
    edge_share: float = parameter(LIMITS.edge_share, 'fraction of the force that a pad is assumed to measure if its '
                                  'contact extends beyond the pad', 0.01, 1)
    one_sided_travel: float = parameter(LIMITS.one_sided_travel, 'travel for which the gripper keeps closing while '
                                        'only one pad is touched [m]; 0: the gripper stops immediately', 0, HIGHEST_GAP)
    max_age: float = parameter(LIMITS.max_age, "age of the pads' data above which the gripper stops [s]", 1e-3, 10)
    latency: float = parameter(LIMITS.latency, 'time from a touch until the gripper stops [s]', 1e-3, 10)
    stiffness: float = parameter(LIMITS.stiffness, 'stiffness of pads and object together, as force per metre of '
                                 'opening [N/m]; with latency, the stiffness limits the speed', 1, 1e7)
    hold: bool = parameter(False, 'true: after a goal with an effort that ended as FORCE_REACHED, keep adjusting the '
                           'opening so that the force stays the same')
    gripper_step: float = parameter(HOLD.gripper_step, 'smallest change of the opening that the gripper can make [m]; '
                                    'with stiffness and slow_speed, this step determines how accurate the force is',
                                    1e-6, 0.01)
    hold_travel: float = parameter(HOLD.hold_travel, 'total travel of all corrections after which a hold ends [m]',
                                   1e-5, HIGHEST_GAP)
    slide_force_step: float = parameter(HOLD.slide_force_step, 'step by which the held force rises if the object '
                                        'slides in one direction [N]; at most one step per second, up to '
                                        'highest_force; 0: the force never rises', 0, 1e4)


def limits_of(kind: type[Limits], settings: GripperSettings) -> Limits:
    """Return limits of the given kind, with each value taken from the parameter of the same name."""
    return kind(**{name: getattr(settings, name) for name in kind.__dataclass_fields__})
