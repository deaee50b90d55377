"""Client that tells a grasp planner how to correct each grasp between two tactile pads.

    python examples/planner_client.py --ros-args -r grasp:=/gripper/grasp -p 'left_rpy:=[-1.57, 0.0, 0.0]'

Give the client the same left_rpy as the grasp node. Without left_rpy, the client uses the grasp node's default. The
client reports its corrections in the frame of the left pad. docs/planning.md shows how to convert a correction to a
pose of the hand.

The actions `shift`, `rotate`, `tilt` and `regrasp` need an open gripper: open, move, close again
(examples/grasp_loop.py).

The client acts only on current grasps. The action `hold` means that the state of the grasp is unknown and the gripper
must keep still. A grasp is current while its age, including the time since its arrival, is at most MAX_AGE, and while
the last grasp arrived at most MAX_SILENCE ago. A watchdog renews the decision if no grasp arrives.
"""

import time
from math import degrees, hypot, inf, isfinite, pi, remainder
from typing import NamedTuple

import numpy as np

from tactile_node.grasp.gripper import PadPose
from tactile_node.grasp.trust import MAX_AGE, MAX_SILENCE
from tactile_node.pose.events import Moving, Observable

MIN_CONFIDENCE = 0.8         # if the shape of a fully visible object is less probable, grasp the object elsewhere
MAX_OFFSET = 0.002           # largest offset of the contacts' centres across the closing direction [m]
MAX_ANGLE = 5 * pi / 180     # largest angle between the object's edges and the pad's edges [rad]
MAX_MISALIGNMENT = 3 * pi / 180  # largest tilt of the faces or of the contacts' line [rad]
TAUGHT = 8                   # ContactShape.OTHER
SLIDES = Observable.ALONG_X | Observable.ALONG_Y  # slides that the pad has to be able to detect

# Pressure per depth of the skin [Pa/m]. If the value is too high, the corrections of the tilt are too small.
STIFFNESS = 25e6
FLUSH = 0.015                # largest tilt that does not show which way a face leans, if the face may be a dome [rad]
FLAT_FLUSH = 0.005           # largest such tilt of a flat face, which has corners [rad]
CORNERED = (4, 5, 6, 7)      # ContactShape.SQUARE, RECTANGLE, RIGHT_TRIANGLE, ISOSCELES_TRIANGLE
WATCHDOG_PERIOD = 0.02       # period of the watchdog [s]
REPORT_PERIOD = 0.5          # period of reports while the action is unchanged [s]


class Correction(NamedTuple):
    """The next step for the gripper, with its move and rotation in the frame of the left pad."""

    action: str                         # 'hold', 'wait', 'open', 'regrasp', 'shift', 'rotate', 'tilt' or 'lift'
    shift: tuple[float, float] = (0.0, 0.0)  # [m]
    angle: float = 0.0                  # rotation about the pad's z axis [rad]
    tilt: tuple[float, float, float] = (0.0, 0.0, 0.0)  # rotation vector about the midpoint of the contacts [rad]
    is_part: bool = False               # True for a lift at an unknown place along a long object


HOLD = Correction('hold')  # keeps the gripper still
WAIT = Correction('wait')
DEFAULT_LEFT = PadPose().rotation


def asked_for(grasp, aim: tuple[float, float], left: np.ndarray = DEFAULT_LEFT) -> Correction:
    """Return the correction for a current grasp.

    The function corrects the worst flaw first. Contacts that do not oppose each other are corrected before all other
    flaws, because neither shape nor place is reliable on oblique faces.

    Parameters
    ----------
    grasp
        Grasp message.
    aim
        Desired place of the object's centre on the left pad [m].
    left
        Axes of the left pad in the frame of the gripper, as the columns of a matrix (3, 3).
    """
    codes = type(grasp)
    if not grasp.fresh or grasp.contact in (codes.NOT_KNOWN, codes.UNSEEN):
        return HOLD
    if grasp.contact == codes.NO_CONTACT:  # both pads are reported as empty, so the gripper holds nothing
        return Correction('open')
    if grasp.contact != codes.TWO_SIDED:
        return WAIT
    shift = (grasp.centre[0] - aim[0], grasp.centre[1] - aim[1])
    if grasp.line_is_bound:
        return from_the_edge(grasp, shift)
    if not isfinite(grasp.offset) or grasp.class_name == 'unknown' and any(grasp.hidden_taxels):
        return WAIT  # the object's place or shape is only partly known
    # In its first frames, a contact has too few taxels for a slope and for a sure shape, so wait until it is stable.
    regrasp = Correction('regrasp') if grasp.stable else WAIT
    tilt = opposing(grasp, left)
    if grasp.offset > MAX_OFFSET or grasp.misalignment > MAX_MISALIGNMENT or hypot(*tilt) > MAX_MISALIGNMENT:
        return Correction('tilt', tilt=tilt) if all(map(isfinite, tilt)) else regrasp
    if not is_sure(grasp):
        return regrasp
    if hypot(*shift) > MAX_OFFSET:
        return Correction('shift', shift)
    angle = nearest_edge(grasp.yaw, grasp.symmetry)
    if abs(angle) > MAX_ANGLE:
        return Correction('rotate', angle=angle)
    return Correction('lift') if grasp.stable else WAIT


def from_the_edge(grasp, shift: tuple[float, float]) -> Correction:
    """Return the correction for a contact that extends beyond the edge of a pad.

    If the contacts extend beyond both pads while the centre of their visible part is at the aim, the object is longer
    than the pads, like a bar or a bottle. The function then returns `lift`, whatever the shape, once the motion is
    observable and shows no slide. The place along the object remains unknown. The function waits if taxels have no
    value, because the hidden part may be anywhere.
    """
    if not any(grasp.at_edge) or not all(grasp.pads_seen) or any(grasp.hidden_taxels):
        return WAIT
    if hypot(*shift) > MAX_OFFSET:
        return Correction('shift', shift)
    is_oblique = grasp.misalignment > MAX_MISALIGNMENT or any(  # NaN means unknown and does not count as oblique
        abs(lean) > MAX_MISALIGNMENT * STIFFNESS for lean in grasp.lean)
    rests = all(motion.moving == Moving.STILL and motion.observable & SLIDES for motion in grasp.motions)
    is_held = (all(grasp.at_edge) and grasp.offset <= MAX_OFFSET and not is_oblique
               and not any(grasp.saturated_taxels))  # saturated taxels make the centre uncertain in every direction
    return Correction('lift', is_part=True) if is_held and rests else WAIT


def opposing(grasp, left: np.ndarray = DEFAULT_LEFT) -> tuple[float, float, float]:
    """Return the rotation of the gripper about the midpoint [rad] that makes the contacts oppose, or NaN if unknown.

    The gripper aligns with the faces if they lean, and otherwise with the line of the contacts. The lean is in the
    frame of the left pad, and ``left`` converts the line from the frame of the gripper to this frame.
    """
    about_x, about_y = (lean / STIFFNESS for lean in grasp.lean)
    # If the faces lean, the line of the contacts is a diagonal, because friction holds such faces at opposite edges.
    is_flat = grasp.shape in CORNERED and grasp.confidence >= MIN_CONFIDENCE
    if hypot(about_x, about_y) <= (FLAT_FLUSH if is_flat else FLUSH):
        x, y, _ = left.T @ (grasp.axis.x, grasp.axis.y, grasp.axis.z)
        sine = hypot(x, y) or 1.0
        about_x, about_y = -grasp.misalignment * y / sine, grasp.misalignment * x / sine
    return about_x, about_y, 0.0


def is_sure(grasp) -> bool:
    """Return True if the shape is reliable. Only a taught shape may lack a size and an angle."""
    has_fit = len(grasp.dimensions) and not (grasp.symmetry and not isfinite(grasp.yaw))
    return grasp.confidence >= MIN_CONFIDENCE and (has_fit or grasp.shape == TAUGHT)


def nearest_edge(angle: float, symmetry: int) -> float:
    """Return the smallest rotation of the gripper that aligns an edge with an axis of the left pad [rad]."""
    edges = (angle + k * 2 * pi / symmetry for k in range(symmetry))  # angles of all equivalent edges
    return min((remainder(edge, pi / 2) for edge in edges), key=abs, default=0.0)


class Planner:
    """Decides from the latest grasp while this grasp is current. All times come from a steady clock [s]."""

    def __init__(self) -> None:
        self._correction = HOLD
        self._arrival = -inf
        self._age_on_arrival = inf

    def receive(self, correction: Correction, arrival: float, age: float) -> None:
        """Store the correction for a grasp that arrived at ``arrival`` with an ``age`` [s], or inf if unknown."""
        self._correction = correction
        self._arrival = arrival
        self._age_on_arrival = age

    def decide(self, now: float) -> Correction:
        """Return the correction to apply at the time ``now``."""
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
        reason = check_grasp(grasp)  # ignore malformed messages
        if reason is not None:
            node.get_logger().warning(f'grasp dropped: {reason.key}', throttle_duration_sec=10.0)
            return
        arrival = ages.arrived(grasp)  # this age includes the transport delay
        aim = tuple(node.get_parameter('aim').value)
        planner.receive(asked_for(grasp, aim, left), arrival.steady, arrival.age_on_arrival)
        act()

    def act() -> None:
        """Report the decision immediately after it has changed, so that nobody acts on an outdated decision."""
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
    left = PadPose(rpy=tuple(node.declare_parameter('left_rpy', [0.0, 0.0, 0.0]).value)).rotation
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
