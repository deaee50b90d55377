"""Close the simulated gripper, correct the hand until the item is centred and faces the pads, then lift the item.

    python -m examples.simulated_gripper.corrected_grasp

docs/howto/simulated_gripper.md shows how to start the other programs. `corrected` converts a correction of
examples/planner_client.py to a pose of the hand, as docs/planning.md describes.
"""

import sys
import time
from math import degrees, hypot

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from scipy.spatial.transform import Rotation
from tf2_msgs.msg import TFMessage

from examples.grasp_loop import GraspLoop, Order
from examples.planner_client import Correction, Planner, asked_for
from examples.simulated_gripper.first_grasp import UNSEEN, FirstGrasp
from examples.simulated_gripper.hand_interface import HAND, TABLE, TARGET
from tactile_node.grasp.frame_tree import FrameTree, Transform
from tactile_node.ros.grasp_checks import check_grasp
from tactile_node.ros.message_age import InputAge
from tactile_node.ros.opening_messages import transform
from tactile_skin.msg import Grasp, GripperOutcome

AIM = (0.015, 0.015)   #: desired place of the item's centre on the left pad: the centre of the pad [m]
LIGHT = 2.0            #: force of each pad while the planner looks at the grasp [N]
FIRM = 5.0             #: force of each pad for the lift [N]
OPENED = 0.085         #: opening of the gripper while the hand moves [m]
LIFT = 0.1             #: height of the lift [m]
GOAL_TIMEOUT = 30.0    #: time allowed for a goal of the gripper [s]
MOVE_TIMEOUT = 10.0    #: time allowed for a move of the hand [s]
ARRIVED = 0.0005       #: distance from the target at which the hand has arrived [m]
TURNED = 0.005         #: angle from the target at which the hand has arrived [rad]
TRIES = 4              #: largest number of attempts to close, each of which begins with an open gripper
SEEN_TIMEOUT = 20.0    #: time allowed until both pads are seen again [s]
AGAIN = *UNSEEN, GripperOutcome.ONE_SIDED  #: outcomes after which the gripper opens and closes again


def corrected(hand: Transform, left: np.ndarray, midpoint: np.ndarray, correction: Correction) -> Transform:
    """Return the corrected pose of the hand. The hand turns about the midpoint of the contacts.

    The simulated hand turns about its z axis only, so the function uses this part of the rotation.

    Parameters
    ----------
    hand
        Present pose of the gripper frame in the frame of the robot.
    left
        Axes of the left pad in the gripper frame, as the columns of a matrix (3, 3).
    midpoint
        Midpoint of the contacts in the gripper frame, (3,) [m].
    correction
        Correction in the frame of the left pad.
    """
    shift = left @ (*correction.shift, 0.0)
    turn = left @ (correction.tilt + np.array((0.0, 0.0, correction.angle)))
    rotation = Rotation.from_rotvec((0.0, 0.0, turn[2])).as_matrix()  # with a full wrist: from_rotvec(turn)
    about = np.nan_to_num(midpoint)  # NaN if the opening is not known
    return hand @ Transform(rotation, about - rotation @ about + shift)


class CorrectedGrasp(FirstGrasp):
    """A planner that also knows the pose of the hand, and corrects this pose."""

    def __init__(self):
        super().__init__()
        self._frames = FrameTree()
        self._ages = InputAge()
        self._planner = Planner()
        self.create_subscription(TFMessage, '/tf', self._on_frames, 100)

    def _on_frames(self, message: TFMessage) -> None:
        for each in message.transforms:
            self._frames.set(each.child_frame_id, each.header.frame_id, transform(each.transform))

    def _on_grasp(self, grasp: Grasp) -> None:
        pad = self._frames.find('left_pad', HAND)
        if check_grasp(grasp) is None and pad is not None:
            self.grasp, arrival = grasp, self._ages.arrived(grasp)
            correction = asked_for(grasp, AIM, pad.transform.rotation)
            self._planner.receive(correction, arrival.steady, arrival.age_on_arrival)

    @property
    def hand_pose(self) -> Transform:
        return self._frames.find(HAND, TABLE).transform

    def close(self, force: float) -> GripperOutcome:
        """Close until the pads read a force [N], and return the outcome. After missing data, open and try again."""
        outcome = self.command(0.0, force)
        for _ in range(TRIES - 1):
            if outcome.outcome not in AGAIN:
                break
            print(f'close again: {outcome.message}', flush=True)
            self.command(OPENED, 0.0)
            self.spin(SEEN_TIMEOUT, lambda: self.grasp.fresh and self.grasp.contact == Grasp.NO_CONTACT)
            outcome = self.command(0.0, force)
        return outcome

    def command(self, opening: float, force: float) -> GripperOutcome:
        """Move the gripper, and return the outcome."""
        goal = self.gripper.send(opening, effort=force)
        return self.gripper.wait(goal, GOAL_TIMEOUT, spin=True).outcome or GripperOutcome(message='no outcome arrived')

    def move(self, pose: Transform) -> None:
        """Move the hand to a pose, and wait until tf shows that the hand has arrived."""
        target = PoseStamped()
        target.header.frame_id = TABLE
        at, turn = target.pose.position, target.pose.orientation
        at.x, at.y, at.z = map(float, pose.translation)
        turn.x, turn.y, turn.z, turn.w = map(float, Rotation.from_matrix(pose.rotation).as_quat())
        self.hand.publish(target)
        if not self.spin(MOVE_TIMEOUT, lambda: self._is_at(pose)):
            raise TimeoutError(f'{TARGET}: the hand has not arrived within {MOVE_TIMEOUT:g} s. Check that the '
                               'simulated gripper runs.')

    def _is_at(self, pose: Transform) -> bool:
        rest = self.hand_pose.inverse @ pose
        return (np.linalg.norm(rest.translation) < ARRIVED
                and Rotation.from_matrix(rest.rotation).magnitude() < TURNED)

    def next_order(self, loop: GraspLoop) -> Order:
        """Wait for the loop's next order after the gripper has closed."""
        loop.closed(time.monotonic())
        order = Order('wait')
        while order.kind == 'wait':
            rclpy.spin_once(self, timeout_sec=0.05)
            now = time.monotonic()
            order = loop.next(self._planner.decide(now), now)
        return order

    def correct(self, correction: Correction) -> None:
        """Open the gripper, and move the hand by a correction."""
        middle = self.grasp.midpoint
        pad = self._frames.find('left_pad', HAND).transform.rotation
        target = corrected(self.hand_pose, pad, np.array((middle.x, middle.y, middle.z)), correction)
        self.command(OPENED, 0.0)
        self.move(target)


def grasped(planner: CorrectedGrasp) -> str:
    """Close, correct, and close firmly. Return '' if the item is held, otherwise the reason."""
    loop = GraspLoop()
    while True:
        outcome = planner.close(LIGHT)
        if outcome.outcome != GripperOutcome.FORCE_REACHED:
            return outcome.message
        order = planner.next_order(loop)
        if order.kind == 'give_up':
            return f'{order.reason.name} after {loop.moves} moves'
        if order.kind == 'done':
            break
        (x, y), turn = order.correction.shift, hypot(*order.correction.tilt) + abs(order.correction.angle)
        print(f'{order.correction.action}: {1e3 * x:.1f}, {1e3 * y:.1f} mm, {degrees(turn):.1f} degrees', flush=True)
        planner.correct(order.correction)
    outcome = planner.close(FIRM)
    return '' if outcome.outcome == GripperOutcome.FORCE_REACHED else outcome.message


def main() -> int:
    rclpy.init()
    try:
        return _run(CorrectedGrasp())
    finally:
        rclpy.try_shutdown()


def _run(planner: CorrectedGrasp) -> int:
    if not planner.finds_programs('corrected_grasp'):
        return 2
    problem = grasped(planner)
    if problem:
        print(f'corrected_grasp: the item is not held: {problem}', file=sys.stderr)
        return 1
    planner.move(Transform(np.eye(3), np.array((0.0, 0.0, LIFT))) @ planner.hand_pose)
    (is_held, text), grasp = planner.held_text(), planner.grasp
    x, y = (1e3 * (place - goal) for place, goal in zip(grasp.centre, AIM))
    print(f'{text}: {grasp.class_name}, {x:.1f}, {y:.1f} mm off the aim')
    return 0 if is_held else 1


if __name__ == '__main__':
    sys.exit(main())
