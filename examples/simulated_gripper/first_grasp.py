"""Close the simulated gripper on the item, lift the item, and print the grasp.

    python -m examples.simulated_gripper.first_grasp

docs/howto/simulated_gripper.md shows how to start the other programs.
"""

import sys
import time
from collections.abc import Callable

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node

from examples.simulated_gripper.hand_interface import TABLE, TARGET
from tactile_node.gripper.touch_client import TouchClient
from tactile_skin.msg import Grasp, GripperOutcome

EFFORT = 2.0           #: force of each pad [N]
LIFTED = 0.15          #: height of the hand above the table after the lift [m]
START_TIMEOUT = 20.0   #: time allowed for the other programs to appear [s]
LISTENING = 5.0        #: time for which touch_gripper listens for a duplicate after its start, and refuses to close [s]
CLOSE_TIMEOUT = 30.0   #: time allowed for closing [s]
LIFT_TIME = 4.0        #: time for the lift, which takes 2 s [s]
STABLE_TIMEOUT = 5.0   #: time allowed after the lift until the grasp is stable [s]


class FirstGrasp(Node):
    """Planner with one client of the gripper, one publisher for the hand, and the last grasp."""

    def __init__(self):
        super().__init__('first_grasp')
        self.gripper = TouchClient(self)
        self.hand = self.create_publisher(PoseStamped, TARGET, 1)
        self.grasp = Grasp()
        self.create_subscription(Grasp, 'grasp', self._on_grasp, 1)

    def _on_grasp(self, grasp: Grasp) -> None:
        self.grasp = grasp

    def lift(self) -> None:
        target = PoseStamped()
        target.header.frame_id, target.pose.position.z, target.pose.orientation.w = TABLE, LIFTED, 1.0
        self.hand.publish(target)

    def missing(self) -> list[str]:
        """Return the names of the programs and data that are still missing."""
        found = {'touch_gripper': self.gripper.is_ready, 'the gripper': self.hand.get_subscription_count() > 0,
                 'a fresh grasp of the perception': self.grasp.fresh}
        return [name for name, is_there in found.items() if not is_there]

    def is_held(self) -> bool:
        return self.grasp.fresh and self.grasp.stable and self.grasp.contact == Grasp.TWO_SIDED

    def spin(self, seconds: float, is_done: Callable[[], bool] = lambda: False) -> bool:
        """Spin for a time, or until ``is_done()``, and return the last answer of ``is_done``."""
        end = time.monotonic() + seconds
        while not (done := is_done()) and time.monotonic() < end:
            rclpy.spin_once(self, timeout_sec=0.05)
        return done

    def finds_programs(self, program: str) -> bool:
        """Wait for the other programs, and print which are missing. ``program`` is the name of this one."""
        if self.spin(START_TIMEOUT, lambda: not self.missing()):
            return True
        print(f'{program}: expected {" and ".join(self.missing())}, found none. Start the missing programs: '
              'docs/howto/simulated_gripper.md', file=sys.stderr)
        return False


def main() -> int:
    rclpy.init()
    try:
        return _grasp(FirstGrasp())
    finally:
        rclpy.try_shutdown()


def _grasp(planner: FirstGrasp) -> int:
    if not planner.finds_programs('first_grasp'):
        return 2
    print(f'first_grasp: closing in {LISTENING:g} s', flush=True)
    planner.spin(LISTENING)
    goal = planner.gripper.send(0.0, effort=EFFORT)
    outcome = planner.gripper.wait(goal, CLOSE_TIMEOUT, spin=True).outcome
    if outcome is None or outcome.outcome != GripperOutcome.FORCE_REACHED:
        text = outcome.message if outcome else 'the outcome was lost'
        print(f'first_grasp: no item is held: {text}. Type `open` and `place 0` into the shell of the gripper, and '
              'try again.', file=sys.stderr)
        return 1
    planner.lift()
    planner.spin(LIFT_TIME)
    is_held, grasp = planner.spin(STABLE_TIMEOUT, planner.is_held), planner.grasp
    print(f'{"held" if is_held else "not reported as held"}: {grasp.class_name}, {1e3 * grasp.width:.1f} mm wide, '
          f'pads press {grasp.forces[0]:.1f} and {grasp.forces[1]:.1f} N')
    return 0 if is_held else 1


if __name__ == '__main__':
    sys.exit(main())
