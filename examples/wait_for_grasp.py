"""Wait for a grasp and print the held object, in the smallest program that uses the action `wait_for_grasp`.

    python examples/wait_for_grasp.py
"""

import sys
from math import isfinite

import rclpy
from rclpy.action import ActionClient
from rclpy.node import Node

from tactile_skin.action import WaitForGrasp
from tactile_skin.msg import Grasp

TIMEOUT = 20  # time allowed for the grasp [s]
LATE = 15.0  # longest wait to find the node or, after TIMEOUT, for its answer, because a dead node never answers [s]


def wait_for_grasp(node: Node) -> tuple[Grasp | None, str]:
    """Return the grasp or None, and the outcome as text."""
    client = ActionClient(node, WaitForGrasp, 'grasp/wait_for_grasp')
    if not client.wait_for_server(timeout_sec=LATE):
        return None, 'expected the node of the grasp, found none. Start two pads: docs/howto/my_planner.md'
    goal = WaitForGrasp.Goal()
    goal.requirement.min_confidence, goal.timeout.sec = 0.8, TIMEOUT
    accepted = client.send_goal_async(goal)
    rclpy.spin_until_future_complete(node, accepted, timeout_sec=LATE)
    if not accepted.done():
        return None, 'the node of the grasp has not answered' if rclpy.ok() else 'interrupted'
    answered = accepted.result().get_result_async()  # request the result now, because the server discards it after 2 s

    rclpy.spin_until_future_complete(node, answered, timeout_sec=TIMEOUT + LATE)
    if not answered.done():
        return None, 'the node of the grasp has ended' if rclpy.ok() else 'interrupted'
    result = answered.result().result
    return (result.grasp if result.outcome == WaitForGrasp.Result.HELD else None), result.message


def main() -> int:
    rclpy.init()
    try:
        grasp, message = wait_for_grasp(rclpy.create_node('wait_for_grasp'))
    except KeyboardInterrupt:
        grasp, message = None, 'interrupted'
    finally:
        rclpy.try_shutdown()
    if grasp is None:
        print(f'wait_for_grasp: {message}', file=sys.stderr)
        return 1
    x, y = (1e3 * each for each in grasp.centre)
    width = f'{1e3 * grasp.width:.1f} mm wide' if isfinite(grasp.width) else 'width not known'
    print(f'{grasp.class_name}, {100 * grasp.confidence:.0f} %, at {x:.1f}, {y:.1f} mm of the left pad, {width}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
