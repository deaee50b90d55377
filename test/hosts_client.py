"""Asks the services of the skin from another host: prints one JSON line with the answers.

    python test/hosts_client.py
"""

import json
import sys

import rclpy
from rclpy.action import ActionClient

from tactile_skin.action import WaitForGrasp
from tactile_skin.msg import GraspRequirement
from tactile_skin.srv import CheckGrasp, Tare

TIMEOUT = 20.0  # s


def main() -> int:
    rclpy.init(args=[])
    node = rclpy.create_node('client')
    requirement = GraspRequirement()
    check = called(node, CheckGrasp, 'grasp/check_grasp', CheckGrasp.Request(requirement=requirement))
    tare = called(node, Tare, 'skin_driver/tare', Tare.Request(frames=5))
    client = ActionClient(node, WaitForGrasp, 'grasp/wait_for_grasp')
    if not client.wait_for_server(TIMEOUT):
        sys.exit('no action server')
    goal = WaitForGrasp.Goal(requirement=requirement)
    goal.timeout.sec = 10
    handle = spun(node, client.send_goal_async(goal))
    result = spun(node, handle.get_result_async()).result
    print(json.dumps({'check': check.outcome, 'held': CheckGrasp.Response.HELD, 'tare_refusal': tare.refusal,
                      'contact': Tare.Response.REFUSAL_CONTACT, 'pressed': Tare.Response.REFUSAL_PRESSED,
                      'waited': result.outcome}), flush=True)
    return 0


def called(node, kind, name, request):
    client = node.create_client(kind, name)
    if not client.wait_for_service(TIMEOUT):
        sys.exit(f'no service {name}')
    return spun(node, client.call_async(request))


def spun(node, future):
    rclpy.spin_until_future_complete(node, future, timeout_sec=TIMEOUT)
    return future.result()


if __name__ == '__main__':
    sys.exit(main())
