"""Use the skin from another host, as a planner and a lifecycle manager do, and print the result as one line of JSON.

    python test/hosts_client.py
"""

import json
import sys
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import GetParameters
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile

from tactile_skin.action import WaitForGrasp
from tactile_skin.msg import GraspRequirement, SkinStatus
from tactile_skin.srv import CheckGrasp, Tare

TIMEOUT = 60.0  #: Time limit on a busy machine [s].
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
HEARD = {'status': (SkinStatus, 'skin_driver/status', LATCHED), 'log': (Log, '/rosout', LATCHED),
         'diagnostics': (DiagnosticArray, '/diagnostics', 10)}


def main() -> int:
    rclpy.init(args=[])
    node = rclpy.create_node('client')
    heard: dict[str, list] = {name: [] for name in HEARD}
    for name, (kind, topic, qos) in HEARD.items():
        node.create_subscription(kind, topic, heard[name].append, qos)
    found = grasps(node) | driver(node)

    def is_active() -> bool:
        return bool(heard['status']) and heard['status'][-1].active

    def is_logged() -> bool:
        return any(log.name == 'skin_driver' for log in heard['log'])
    wait(node, lambda: is_active() and is_logged() and heard['diagnostics'])
    found |= {'active': is_active(), 'logged': is_logged(),
              'reported': sorted({each.name for message in heard['diagnostics'] for each in message.status})}
    print(json.dumps(found), flush=True)
    return 0


def grasps(node) -> dict:
    requirement = GraspRequirement()
    end, check = time.monotonic() + TIMEOUT, CheckGrasp.Response()
    # On a busy machine, the grasp may be stale for a moment.
    while check.outcome != CheckGrasp.Response.HELD and time.monotonic() < end:
        check = called(node, CheckGrasp, 'grasp/check_grasp', CheckGrasp.Request(requirement=requirement))
    client = ActionClient(node, WaitForGrasp, 'grasp/wait_for_grasp')
    if not client.wait_for_server(TIMEOUT):
        sys.exit('no action server')
    goal = WaitForGrasp.Goal(requirement=requirement)
    goal.timeout.sec = int(TIMEOUT)
    handle = spun(node, client.send_goal_async(goal))
    result = spun(node, handle.get_result_async()).result
    return {'check': check.outcome, 'waited': result.outcome, 'held': CheckGrasp.Response.HELD}


def driver(node) -> dict:
    """Return the result of a refused tare, and the states after a stop and a start.

    The driver refuses a tare while an object is held.
    """
    tare = called(node, Tare, 'skin_driver/tare', Tare.Request(frames=5))
    parameters = called(node, GetParameters, 'skin_driver/get_parameters', GetParameters.Request(names=['pads']))
    states = [called(node, GetState, 'skin_driver/get_state', GetState.Request()).current_state.id]
    for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVATE):
        request = ChangeState.Request(transition=Transition(id=transition))
        assert called(node, ChangeState, 'skin_driver/change_state', request).success
        states.append(called(node, GetState, 'skin_driver/get_state', GetState.Request()).current_state.id)
    return {'tare_refusal': tare.refusal, 'contact': Tare.Response.REFUSAL_CONTACT,
            'pressed': Tare.Response.REFUSAL_PRESSED, 'pads': parameters.values[0].string_array_value,
            'states': states, 'expected_states': [State.PRIMARY_STATE_ACTIVE, State.PRIMARY_STATE_INACTIVE,
                                                  State.PRIMARY_STATE_ACTIVE]}


def called(node, kind, name, request):
    client = node.create_client(kind, name)
    if not client.wait_for_service(TIMEOUT):
        sys.exit(f'no service {name}')
    return spun(node, client.call_async(request))


def spun(node, future):
    rclpy.spin_until_future_complete(node, future, timeout_sec=TIMEOUT)
    return future.result()


def wait(node, condition) -> None:
    end = time.monotonic() + TIMEOUT
    while not condition() and time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.1)


if __name__ == '__main__':
    sys.exit(main())
