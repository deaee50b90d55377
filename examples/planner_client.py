"""A grasp planner's client: takes each grasp of two tactile pads and reports how to correct it.

    python examples/planner_client.py --ros-args -r grasp:=/gripper/grasp

`shift`, `rotate`, `tilt` and `regrasp` are for an open gripper: open, move, close again (examples/grasp_loop.py).

It acts on what is current and seen, and on nothing else: `hold` means that nothing is known, keep still. A grasp is
current while its age, with the time since it arrived, is below MAX_AGE, and grasps have not stopped for MAX_SILENCE:
a watchdog decides again when none comes.
"""

import time
from math import degrees, hypot, inf, isfinite, pi, remainder
from typing import NamedTuple

from tactile_node.grasp.trust import MAX_AGE, MAX_SILENCE

MIN_CONFIDENCE = 0.8         # probability of the class of what is seen whole; below: let go and try elsewhere
MAX_OFFSET = 0.002           # of the two contacts' centres across the closing direction [m]
MAX_ANGLE = 5 * pi / 180     # of the object's edges against the pad's [rad]
MAX_MISALIGNMENT = 3 * pi / 180  # angle of faces, or of the contacts' line, to the closing direction [rad]
TAUGHT = 8                   # ContactShape.OTHER
STILL, SLIDES = 1, 3         # ContactMotion: STILL; ALONG_X and ALONG_Y
STIFFNESS = 25e6             # pressure by depth of the skin: too high turns too little, too low too far [Pa/m]
FLUSH = 0.015                # least angle whose direction is known [rad]
WATCHDOG_PERIOD = 0.02       # [s]
REPORT_PERIOD = 0.5          # of an action that stays the same [s]


class Correction(NamedTuple):
    """What to do next; moves and rotations are the gripper's, in the left pad's frame."""

    action: str                         # 'hold', 'wait', 'open', 'regrasp', 'shift', 'rotate', 'tilt' or 'lift'
    shift: tuple[float, float] = (0.0, 0.0)  # [m]
    angle: float = 0.0                  # about the pad's z [rad]
    tilt: tuple[float, float, float] = (0.0, 0.0, 0.0)  # rotation vector [rad]; both frames have the same axes
    is_part: bool = False               # lift: of something longer than the pads, held anywhere along it


HOLD, WAIT = Correction('hold'), Correction('wait')  # hold: what the gripper holds is not known, keep still


def asked_for(grasp, aim: tuple[float, float]) -> Correction:
    """What a Grasp asks for while it is current; ``aim``: where on the left pad the object's centre should be [m].

    The worst flaw comes first. Contacts that do not oppose come before all others: on oblique faces neither shape nor
    place can be relied on.
    """
    codes = type(grasp)
    if not grasp.fresh or grasp.contact in (codes.NOT_KNOWN, codes.UNSEEN):
        return HOLD
    if grasp.contact == codes.NO_CONTACT:  # both pads are seen and empty: nothing is held
        return Correction('open')
    if grasp.contact != codes.TWO_SIDED:
        return WAIT
    shift = (grasp.centre[0] - aim[0], grasp.centre[1] - aim[1])
    if grasp.line_is_bound:
        return from_the_edge(grasp, shift)
    if not isfinite(grasp.offset) or grasp.class_name == 'unknown' and any(grasp.hidden_taxels):
        return WAIT  # where or what the object is, is known in part only
    tilt = opposing(grasp)
    if grasp.offset > MAX_OFFSET or grasp.misalignment > MAX_MISALIGNMENT or hypot(*tilt) > MAX_MISALIGNMENT:
        return Correction('tilt', tilt=tilt) if all(map(isfinite, tilt)) else Correction('regrasp')
    if not is_sure(grasp):
        return Correction('regrasp') if grasp.stable else WAIT  # more frames may still decide, unless nothing moves
    if hypot(*shift) > MAX_OFFSET:
        return Correction('shift', shift)
    angle = nearest_edge(grasp.yaw, grasp.symmetry)
    if abs(angle) > MAX_ANGLE:
        return Correction('rotate', angle=angle)
    return Correction('lift') if grasp.stable else WAIT


def from_the_edge(grasp, shift: tuple[float, float]) -> Correction:
    """Follow a contact that the edge of a pad cuts: the rest of it is farther out on the same side.

    One that is cut still, at both pads, with the middle of what they see on theirs is longer than they are, as a bar or
    a bottle. It is lifted once no slide is seen and one would show, whatever it is: where along it the gripper holds
    is not known. What is hidden by taxels without a value may be anywhere.
    """
    if not any(grasp.at_edge) or not all(grasp.pads_seen) or any(grasp.hidden_taxels):
        return WAIT
    if hypot(*shift) > MAX_OFFSET:
        return Correction('shift', shift)
    is_oblique = grasp.misalignment > MAX_MISALIGNMENT or any(  # NaN: not known
        abs(lean) > MAX_MISALIGNMENT * STIFFNESS for lean in grasp.lean)
    rests = all(motion.moving == STILL and motion.observable & SLIDES for motion in grasp.motions)
    is_held = (all(grasp.at_edge) and grasp.offset <= MAX_OFFSET and not is_oblique
               and not any(grasp.saturated_taxels))  # which leave the centre a bound each way
    return Correction('lift', is_part=True) if is_held and rests else WAIT


def opposing(grasp) -> tuple[float, float, float]:
    """Return the gripper's rotation, about the midpoint, onto faces that lean, else along the line; NaN: not known."""
    about_x, about_y = (lean / STIFFNESS for lean in grasp.lean)
    if hypot(about_x, about_y) <= FLUSH:  # else the line is a diagonal: friction holds such faces at opposite edges
        sine = hypot(grasp.axis.x, grasp.axis.y) or 1.0
        about_x, about_y = -grasp.misalignment * grasp.axis.y / sine, grasp.misalignment * grasp.axis.x / sine
    return about_x, about_y, 0.0


def is_sure(grasp) -> bool:
    """Whether the object can be relied on: with a size and an angle, but of a shape that was taught, which has none."""
    has_fit = len(grasp.dimensions) and not (grasp.symmetry and not isfinite(grasp.yaw))
    return grasp.confidence >= MIN_CONFIDENCE and (has_fit or grasp.shape == TAUGHT)


def nearest_edge(angle: float, symmetry: int) -> float:
    """Return the smallest rotation of the gripper that brings an edge along one of the left pad's axes."""
    edges = (angle + k * 2 * pi / symmetry for k in range(symmetry))  # all that look the same
    return min((remainder(edge, pi / 2) for edge in edges), key=abs, default=0.0)


class Planner:
    """Decides on the latest grasp as long as it is current. Times are of a steady clock [s]."""

    def __init__(self) -> None:
        self._correction = HOLD
        self._arrival = -inf
        self._age_on_arrival = inf

    def receive(self, correction: Correction, arrival: float, age: float) -> None:
        """Take what a grasp asks for, which arrived at ``arrival`` with an ``age`` [s]; inf: not known."""
        self._correction = correction
        self._arrival = arrival
        self._age_on_arrival = age

    def decide(self, now: float) -> Correction:
        """Return what to do at ``now``."""
        since = now - self._arrival
        return self._correction if since <= MAX_SILENCE and self._age_on_arrival + since <= MAX_AGE else HOLD


def main() -> None:
    import rclpy
    from rclpy.clock import Clock, ClockType
    from rclpy.executors import ExternalShutdownException
    from rclpy.qos import QoSProfile, ReliabilityPolicy

    from tactile_node.ros.grasp_checks import check_grasp
    from tactile_node.ros.message_age import InputAge
    from tactile_skin.msg import Grasp

    def on_grasp(grasp: Grasp) -> None:
        reason = check_grasp(grasp)  # a malformed message is no information
        if reason is not None:
            node.get_logger().warning(f'grasp dropped: {reason.key}', throttle_duration_sec=10.0)
            return
        arrival = ages.arrived(grasp)  # its age counts what held it back on the way here
        aim = tuple(node.get_parameter('aim').value)
        planner.receive(asked_for(grasp, aim), arrival.steady, arrival.age_on_arrival)
        act()

    def act() -> None:
        """Report the decision: at once when it changes, so that nothing acts on what is over."""
        nonlocal reported, reported_at
        now = time.monotonic()
        correction = planner.decide(now)
        if correction.action == reported and now - reported_at < REPORT_PERIOD:
            return
        reported, reported_at = correction.action, now
        x, y = (1e3 * each for each in correction.shift)
        node.get_logger().info(f'{correction.action}: shift {x:.1f}, {y:.1f} mm, '
                               f'rotate {degrees(correction.angle):.1f} degrees, '
                               f'tilt {degrees(hypot(*correction.tilt)):.1f} degrees')

    rclpy.init()
    node = rclpy.create_node('planner_client')
    node.declare_parameter('aim', [0.015, 0.015])
    planner, ages = Planner(), InputAge()
    reported, reported_at = '', -inf
    node.create_subscription(Grasp, 'grasp', on_grasp, QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT))
    node.create_timer(WATCHDOG_PERIOD, act, clock=Clock(clock_type=ClockType.STEADY_TIME))
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == '__main__':
    main()
