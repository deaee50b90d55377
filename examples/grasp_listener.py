"""Print what two pads hold, in the smallest program that uses the topic `grasp`.

    python examples/grasp_listener.py
"""

import time

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from tactile_node.grasp.trust import Doubt, doubt
from tactile_skin.msg import Grasp

PERIOD = 0.05  #: Period of the checks [s]. The checks also detect that grasps have stopped arriving.


class GraspListener(Node):
    """Prints the held object, or the reason why a planner must not act, whenever one of them changes."""

    def __init__(self):
        super().__init__('grasp_listener')
        self._grasp, self._arrived, self._last = Grasp(), 0.0, ''
        self.create_subscription(Grasp, 'grasp', self._on_grasp, 1)  # a depth of 1 keeps only the latest grasp
        self.create_timer(PERIOD, self._check, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_grasp(self, grasp: Grasp) -> None:
        self._grasp, self._arrived = grasp, time.monotonic()

    def _check(self) -> None:
        reason = doubt(self._grasp, time.monotonic() - self._arrived)
        text = self._grasp.class_name if reason is Doubt.NONE else f'wait: {reason.value}'
        if text != self._last:
            x, y = (1e3 * each for each in self._grasp.centre)
            print(f'{text}, at {x:.1f}, {y:.1f} mm of the left pad' if reason is Doubt.NONE else text, flush=True)
        self._last = text


def main() -> None:
    rclpy.init()
    try:
        rclpy.spin(GraspListener())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
