"""A grasp planner's client: takes each grasp of two tactile pads and reports how to correct it.

    python examples/planner_client.py --ros-args -r grasp:=/gripper/grasp
"""

from math import atan2, degrees, hypot, pi, remainder
from typing import NamedTuple

MIN_CONFIDENCE = 0.8         # below, on either side: let go and try elsewhere
MAX_OFFSET = 0.002           # of the two contacts' centres across the closing direction [m]
MAX_ANGLE = 5 * pi / 180     # of the object's edges against the pad's [rad]


class Side(NamedTuple):
    """What of one pad's ContactShape decides; angle and symmetry as in the message."""

    touched: bool
    confidence: float
    centre: tuple[float, float]         # of the contact, in the pad's frame [m]
    aim: tuple[float, float]            # where on the pad it should be [m]
    angle: float = 0.0                  # [rad]
    symmetry: int = 0


class Correction(NamedTuple):
    """What to do next; moves and rotations are the gripper's, in the left pad's frame."""

    action: str                         # 'wait', 'regrasp', 'shift', 'rotate' or 'lift'
    shift: tuple[float, float] = (0.0, 0.0)  # [m]
    angle: float = 0.0                  # about the pad's z [rad]


def choose(left: Side, right: Side, offset: float, stable: bool) -> Correction:
    """Decide on the worst flaw first. ``offset`` [m]: of the two centres across the closing direction."""
    if not (left.touched and right.touched):
        return Correction('wait')
    if min(left.confidence, right.confidence) < MIN_CONFIDENCE:
        return Correction('regrasp' if stable else 'wait')  # more frames may still decide, unless nothing moves
    shift = (left.centre[0] - left.aim[0], left.centre[1] - left.aim[1])
    if hypot(*shift) > MAX_OFFSET or offset > MAX_OFFSET:
        return Correction('shift', shift) if hypot(*shift) > MAX_OFFSET else Correction('regrasp')
    angle = nearest_edge(left.angle, left.symmetry)
    if abs(angle) > MAX_ANGLE:
        return Correction('rotate', angle=angle)
    return Correction('lift' if stable else 'wait')


def nearest_edge(angle: float, symmetry: int) -> float:
    """Return the smallest rotation of the gripper that brings the object's edge along one of the pad's axes."""
    edges = (angle + k * 2 * pi / symmetry for k in range(symmetry))  # all that look the same
    return min((remainder(edge, pi / 2) for edge in edges), key=abs, default=0.0)


def yaw(orientation) -> float:
    """Rotation about z of a quaternion message [rad]."""
    q = orientation
    return atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))


def main() -> None:
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from rclpy.qos import qos_profile_sensor_data

    from tactile_node.ros.message_checks import check_grasp
    from tactile_skin.msg import ContactShape, Grasp

    def side(shape: ContactShape, aim: tuple[float, float]) -> Side:
        place = shape.pose.pose
        return Side(touched=shape.shape != ContactShape.NONE, confidence=shape.confidence if shape.fit_valid else 0.0,
                    centre=(place.position.x, place.position.y), aim=aim, angle=yaw(place.orientation),
                    symmetry=shape.symmetry)

    def on_grasp(grasp: Grasp) -> None:
        reason = check_grasp(grasp)  # a malformed message is no information
        if reason is not None:
            node.get_logger().warning(f'grasp dropped: {reason.key}', throttle_duration_sec=10.0)
            return
        aim = tuple(node.get_parameter('aim').value)
        correction = choose(*(side(shape, aim) for shape in grasp.sides), grasp.offset, grasp.stable)
        x, y = (1e3 * each for each in correction.shift)
        node.get_logger().info(f'{correction.action}: shift {x:.1f}, {y:.1f} mm, '
                               f'rotate {degrees(correction.angle):.1f} degrees')

    rclpy.init()
    node = rclpy.create_node('planner_client')
    node.declare_parameter('aim', [0.015, 0.015])
    node.create_subscription(Grasp, 'grasp', on_grasp, qos_profile_sensor_data)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == '__main__':
    main()
