"""A grasp planner's client: takes each grasp of two tactile pads and reports how to correct it.

    python examples/planner_client.py --ros-args -r grasp:=/gripper/grasp

`shift`, `rotate`, `tilt` and `regrasp` are for an open gripper: open, move, close again (examples/grasp_loop.py).

It acts on what is current and seen, and on nothing else: `hold` means that nothing is known, keep still. A grasp is
current while its age, with the time since it arrived, is below MAX_AGE, and grasps have not stopped for MAX_SILENCE:
a watchdog decides again when none comes.
"""

import time
from math import atan2, degrees, hypot, inf, isfinite, nan, pi, remainder
from typing import NamedTuple

MIN_CONFIDENCE = 0.8         # below, on either side: let go and try elsewhere
MAX_OFFSET = 0.002           # of the two contacts' centres across the closing direction [m]
MAX_ANGLE = 5 * pi / 180     # of the object's edges against the pad's [rad]
MAX_MISALIGNMENT = 5 * pi / 180  # of the line between the contacts against the closing direction [rad]
MAX_AGE = 0.3                # of an acquisition [s]
CLOSING = (0.0, 0.0, 1.0)    # from the left pad to the right one in the gripper's frame, as the grasp node's defaults
MAX_SILENCE = 0.1            # since the latest grasp arrived [s]
WATCHDOG_PERIOD = 0.02       # [s]
REPORT_PERIOD = 0.5          # of an action that stays the same [s]


class Side(NamedTuple):
    """What of one pad's ContactShape decides; angle and symmetry as in the message."""

    confidence: float
    centre: tuple[float, float]         # of the contact, in the pad's frame [m]
    aim: tuple[float, float]            # where on the pad it should be [m]
    angle: float = 0.0                  # [rad]
    symmetry: int = 0
    is_bound: bool = False              # too much of it is hidden


class Line(NamedTuple):
    """What of the line between the contacts decides."""

    offset: float                       # of the two centres across the closing direction [m]; NaN: not known
    misalignment: float = nan           # [rad]; NaN: not known, without an opening
    axis: tuple[float, float, float] = (nan, nan, nan)  # from left to right, in the gripper's frame


class Correction(NamedTuple):
    """What to do next; moves and rotations are the gripper's, in the left pad's frame."""

    action: str                         # 'hold', 'wait', 'open', 'regrasp', 'shift', 'rotate', 'tilt' or 'lift'
    shift: tuple[float, float] = (0.0, 0.0)  # [m]
    angle: float = 0.0                  # about the pad's z [rad]
    tilt: tuple[float, float, float] = (0.0, 0.0, 0.0)  # rotation vector in the gripper's frame [rad]


HOLD = Correction('hold')               # what the gripper holds is not known: keep still


def choose(left: Side, right: Side, line: Line, stable: bool) -> Correction:
    """Decide on the worst flaw of a grasp that both pads touch first.

    Contacts that do not oppose come before all others: on oblique faces neither shape nor place can be relied on.
    """
    if left.is_bound or right.is_bound or not isfinite(line.offset):
        return Correction('wait')  # where the object is, is known in part only
    if line.offset > MAX_OFFSET or line.misalignment > MAX_MISALIGNMENT:
        tilt = opposing(line)
        return Correction('tilt', tilt=tilt) if all(map(isfinite, tilt)) else Correction('regrasp')
    if min(left.confidence, right.confidence) < MIN_CONFIDENCE:
        return Correction('regrasp' if stable else 'wait')  # more frames may still decide, unless nothing moves
    shift = off_aim(left)
    if hypot(*shift) > MAX_OFFSET:
        return Correction('shift', shift)
    angle = nearest_edge(left.angle, left.symmetry)
    if abs(angle) > MAX_ANGLE:
        return Correction('rotate', angle=angle)
    return Correction('lift' if stable else 'wait')


def opposing(line: Line) -> tuple[float, float, float]:
    """Return the rotation of the gripper, about the grasp's midpoint, that closes it along the line; NaN: not known."""
    (a, b, c), (x, y, z) = CLOSING, line.axis
    across = (b * z - c * y, c * x - a * z, a * y - b * x)
    sine = hypot(*across)
    return tuple(line.misalignment * each / sine if sine else nan for each in across)


def off_aim(side: Side) -> tuple[float, float]:
    return side.centre[0] - side.aim[0], side.centre[1] - side.aim[1]


def nearest_edge(angle: float, symmetry: int) -> float:
    """Return the smallest rotation of the gripper that brings the object's edge along one of the pad's axes."""
    edges = (angle + k * 2 * pi / symmetry for k in range(symmetry))  # all that look the same
    return min((remainder(edge, pi / 2) for edge in edges), key=abs, default=0.0)


def yaw(orientation) -> float:
    """Rotation about z of a quaternion message [rad]."""
    q = orientation
    return atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))


def side(shape, aim: tuple[float, float]) -> Side:
    """What of a ContactShape decides; without a shape its confidence is 0.

    One that was taught (OTHER) has no pose: its centre of pressure stands for the centre, and nothing is to be rotated.
    """
    codes = type(shape)
    if shape.shape == codes.OTHER and not shape.fit_valid:
        place = shape.centre_of_pressure
        return Side(confidence=shape.confidence, centre=(place.x, place.y), aim=aim,
                    is_bound=shape.centre_of_pressure_is_bound)
    has_shape = shape.fit_valid and shape.shape not in (codes.NOT_KNOWN, codes.NONE, codes.UNKNOWN)
    place = shape.pose.pose
    return Side(confidence=shape.confidence if has_shape else 0.0, centre=(place.position.x, place.position.y),
                aim=aim, angle=yaw(place.orientation), symmetry=shape.symmetry,
                is_bound=shape.unknown_reason == codes.NOT_SEEN)


def asked_for(grasp, aim: tuple[float, float]) -> Correction:
    """What a Grasp asks for while it is current; ``aim``: where on the pad the contact should be [m]."""
    codes = type(grasp)
    if not grasp.fresh or grasp.contact in (codes.NOT_KNOWN, codes.UNSEEN):
        return HOLD
    if grasp.contact == codes.NO_CONTACT:  # both pads are seen and empty: nothing is held
        return Correction('open')
    if grasp.contact != codes.TWO_SIDED:
        return Correction('wait')
    if grasp.line_is_bound:
        return from_the_edge(grasp.sides, aim)
    line = Line(grasp.offset, grasp.misalignment, (grasp.axis.x, grasp.axis.y, grasp.axis.z))
    return choose(*(side(shape, aim) for shape in grasp.sides), line, grasp.stable)


def from_the_edge(shapes, aim: tuple[float, float]) -> Correction:
    """Follow a contact that the edge of a pad cuts: the rest of it is farther out on the same side.

    What is hidden by taxels without a value may be anywhere.
    """
    place = shapes[0].centre_of_pressure
    shift = (place.x - aim[0], place.y - aim[1])
    is_cut = any(shape.at_edge for shape in shapes)
    is_seen = all(shape.pad_seen and not shape.hidden_taxels + shape.hidden_ring_taxels for shape in shapes)
    return Correction('shift', shift) if is_cut and is_seen and hypot(*shift) > MAX_OFFSET else Correction('wait')


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
        is_current = since <= MAX_SILENCE and self._age_on_arrival + since <= MAX_AGE
        return self._correction if is_current else HOLD


def main() -> None:
    import rclpy
    from rclpy.clock import Clock, ClockType
    from rclpy.executors import ExternalShutdownException
    from rclpy.qos import qos_profile_sensor_data

    from tactile_node.ros.message_age import InputAge
    from tactile_node.ros.message_checks import check_grasp
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
    node.create_subscription(Grasp, 'grasp', on_grasp, qos_profile_sensor_data)
    node.create_timer(WATCHDOG_PERIOD, act, clock=Clock(clock_type=ClockType.STEADY_TIME))
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == '__main__':
    main()
