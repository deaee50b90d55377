"""The parameters of the gripper node; see settings.py. Most are the limits of closing, with their defaults."""

from dataclasses import dataclass
from typing import TypeVar

from tactile_node.grasp.closing import TouchLimits
from tactile_node.grasp.holding import HoldLimits
from tactile_node.grasp.opening import HIGHEST_GAP
from tactile_node.ros.settings import ReceiverSettings, parameter

LIMITS, HOLD = TouchLimits(), HoldLimits()

Limits = TypeVar('Limits', TouchLimits, HoldLimits)


@dataclass(frozen=True)
class GripperSettings(ReceiverSettings):
    gripper_action: str = parameter('gripper_controller/gripper_cmd', "the gripper's own action, which this node "
                                    'stands in front of')
    action_type: str = parameter('ParallelGripperCommand', 'type of both actions: ParallelGripperCommand or '
                                 'GripperCommand (control_msgs); the latter has no speed')
    joint: str = parameter('', 'name of the joint in a ParallelGripperCommand; empty: none is given, any is taken')
    gap_scale: float = parameter(1.0, "opening for a metre or a radian of the gripper's position: opening = gap_offset "
                                 '+ gap_scale * position; < 0: it closes as that rises', -1000, 1000)
    gap_offset: float = parameter(0.0, 'opening at position 0 [m]', -10, 10)
    gripper_effort: float = parameter(10.0, "limit of effort that every command to the gripper has, in the gripper's "
                                      'unit: what it may do when this node ends', 1e-6, 1e6)
    stop_by: str = parameter('cancel', 'how the gripper is stopped: cancel (its action), or goal (at where it is)')
    answer_timeout: float = parameter(0.5, 'time for the gripper to accept a command, and to confirm a stop [s]', 0.02,
                                      60)
    widest: float = parameter(LIMITS.widest, 'opening of the gripper when it is open [m]; a goal of this or more '
                              'opens, unless the gripper is measured wider', 1e-3, HIGHEST_GAP)
    fast_speed: float = parameter(LIMITS.fast_speed, 'speed of the opening until the first touch [m/s]; with a '
                                  "GripperCommand, the gripper's own", 1e-5, 10)
    slow_speed: float = parameter(LIMITS.slow_speed, 'speed from the first touch on, or from slow_from on [m/s]', 1e-5,
                                  10)
    slow_from: float = parameter(LIMITS.slow_from, 'opening from which on it closes slowly [m]; 0: from the first '
                                 'touch on', 0, HIGHEST_GAP)
    touch_force: float = parameter(LIMITS.touch_force, 'limit of the force on the stronger pad where a goal has no '
                                   'effort: it closes until both pads are touched, or up to this [N]', 1e-3, 1e4)
    highest_force: float = parameter(LIMITS.highest_force, 'highest effort that a goal may have [N]', 1e-3, 1e4)
    edge_share: float = parameter(LIMITS.edge_share, 'share of its force that a pad is taken to read of a contact that '
                                  'goes on beyond it', 0.01, 1)
    one_sided_travel: float = parameter(LIMITS.one_sided_travel, 'travel for which it goes on with one pad touched '
                                        '[m]; 0: it stops at once', 0, HIGHEST_GAP)
    max_age: float = parameter(LIMITS.max_age, 'age of what the pads read from which on it stops [s]', 1e-3, 10)
    latency: float = parameter(LIMITS.latency, 'time from a touch until the gripper stops [s]', 1e-3, 10)
    stiffness: float = parameter(LIMITS.stiffness, 'of pads and object: force for a metre of the opening [N/m]; with '
                                 'latency it limits the speed', 1, 1e7)
    hold: bool = parameter(False, 'after a goal with an effort that ended as FORCE_REACHED the opening follows, so '
                           'that the force stays')
    gripper_step: float = parameter(HOLD.gripper_step, 'smallest change of the opening that the gripper makes [m]; '
                                    'with stiffness and slow_speed: how far the force may be off', 1e-6, 0.01)
    hold_travel: float = parameter(HOLD.hold_travel, 'travel of all corrections of a hold together, after which it '
                                   'ends [m]', 1e-5, HIGHEST_GAP)
    slide_force_step: float = parameter(HOLD.slide_force_step, 'by which the force that is held rises where the '
                                        'object slides one way, once a second at most and up to highest_force [N]; 0: '
                                        'not', 0, 1e4)


def limits_of(kind: type[Limits], settings: GripperSettings) -> Limits:
    """Return the limits that the parameters of these names give."""
    return kind(**{name: getattr(settings, name) for name in kind.__dataclass_fields__})
