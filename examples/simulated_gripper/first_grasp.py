"""Close the simulated gripper on the item, lift the item, and print the grasp.

    python -m examples.simulated_gripper.first_grasp

docs/howto/simulated_gripper.md shows how to start the other programs.
"""

import math
import sys
import time
from collections.abc import Callable

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node

from examples.simulated_gripper.hand_interface import TABLE, TARGET
from tactile_node.grasp.trust import Doubt, doubt
from tactile_node.gripper.touch_client import TouchClient
from tactile_skin.msg import Grasp, GripperOutcome

EFFORT = 2.0           #: force of each pad [N]
LIFTED = 0.15          #: height of the hand above the table after the lift [m]
START_TIMEOUT = 20.0   #: time allowed for the other programs to appear [s]
CLOSE_TIMEOUT = 30.0   #: time allowed for closing [s]; after its start, touch_gripper first waits for 5 s
LIFT_TIME = 4.0        #: time for the lift, which takes 2 s [s]
STABLE_TIMEOUT = 5.0   #: time allowed after the lift until the grasp is stable [s]
#: outcomes after which the gripper opens and closes again, because the data of the pads were missing or late
UNSEEN = GripperOutcome.NOT_SEEN, GripperOutcome.FORCE_NOT_KNOWN, GripperOutcome.LOST


class FirstGrasp(Node):
    """Planner with one client of the gripper, one publisher for the hand, and the last grasp."""

    def __init__(self):
        super().__init__('first_grasp')
        self.gripper = TouchClient(self)
        self.hand = self.create_publisher(PoseStamped, TARGET, 1)
        self.grasp = Grasp()
        self._arrived = -math.inf  # arrival of the last grasp, on the steady clock [s]
        self.create_subscription(Grasp, 'grasp', self._on_grasp, 1)

    def _on_grasp(self, grasp: Grasp) -> None:
        self.grasp, self._arrived = grasp, time.monotonic()

    def lift(self) -> None:
        target = PoseStamped()
        target.header.frame_id, target.pose.position.z, target.pose.orientation.w = TABLE, LIFTED, 1.0
        self.hand.publish(target)

    def missing(self) -> list[str]:
        """Return the names of the programs and data that are still missing."""
        found = {'touch_gripper': self.gripper.is_ready, 'the gripper': self.hand.get_subscription_count() > 0,
                 'a fresh grasp of the perception': self.grasp.fresh}
        return [name for name, is_there in found.items() if not is_there]

    def doubt(self) -> Doubt:
        """Return the reason why a planner must not act on the last grasp, or Doubt.NONE."""
        return doubt(self.grasp, time.monotonic() - self._arrived)

    def held_text(self) -> tuple[bool, str]:
        """Wait until the grasp may be acted on. Return True if it may, and a text."""
        is_held = self.spin(STABLE_TIMEOUT, lambda: self.doubt() is Doubt.NONE)
        return is_held, 'held' if is_held else f'not reported as held ({self.doubt().value})'

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
    print('first_grasp: closing', flush=True)
    goal = planner.gripper.send(0.0, effort=EFFORT)
    outcome = planner.gripper.wait(goal, CLOSE_TIMEOUT, spin=True).outcome
    if outcome is None or outcome.outcome != GripperOutcome.FORCE_REACHED:
        text = outcome.message if outcome else 'the outcome was lost'
        is_unseen = outcome is None or outcome.outcome in UNSEEN
        remedy = 'Type `open`' if is_unseen else 'Type `open` and `place 0`'
        print(f'first_grasp: no item is held: {text}. {remedy} into the shell of the gripper, and try again.'
              + ' On a slow machine, give tactile bringup a longer sync_period.' * is_unseen, file=sys.stderr)
        return 1
    planner.lift()
    planner.spin(LIFT_TIME)
    (is_held, text), grasp = planner.held_text(), planner.grasp
    print(f'{text}: {grasp.class_name}, {1e3 * grasp.width:.1f} mm wide, '
          f'pads press {grasp.forces[0]:.1f} and {grasp.forces[1]:.1f} N')
    return 0 if is_held else 1


if __name__ == '__main__':
    sys.exit(main())
