"""The client of a gripper node reports how the goal with a given id ended.

The client accepts the result and the outcome in either order.
"""

import threading
import time

import pytest
from action_msgs.msg import GoalStatus
from rclpy.action import ActionServer, GoalResponse
from ros_bench import RosBench
from waiting import until

from tactile_node.gripper.messages import GripperState, gripper_interface
from tactile_node.gripper.rules.closing import Outcome
from tactile_node.gripper.touch_client import OUTCOME_WAIT, TouchClient
from tactile_node.nodes.spinner import spinning
from tactile_skin.msg import GripperOutcome

pytestmark = [pytest.mark.ros, pytest.mark.bus, pytest.mark.usefixtures('control_msgs')]

OTHER_ID = [7] * 16


class Server:
    """A gripper node that ends goals and publishes outcomes when the test tells it to."""

    def __init__(self, node):
        self.interface, self.handles, self.rejects = gripper_interface('ParallelGripperCommand', ''), [], False
        self._outcomes = node.create_publisher(GripperOutcome, 'touch_gripper/outcome', 10)
        self.action = ActionServer(
            node, self.interface.action, 'touch_gripper/gripper_cmd', execute_callback=self._execute,
            goal_callback=lambda goal: GoalResponse.REJECT if self.rejects else GoalResponse.ACCEPT,
            handle_accepted_callback=self.handles.append)

    def _execute(self, handle):
        handle.succeed()
        return self.interface.fill(self.interface.action.Result(), GripperState(0.03, 2.0, stalled=True))

    def publish(self, outcome, goal_id=None, of_hold=False):
        goal_id = self.handles[-1].goal_id.uuid if goal_id is None else goal_id
        self._outcomes.publish(GripperOutcome(goal_id=goal_id, outcome=int(outcome), of_hold=of_hold))


@pytest.fixture
def world(ros):
    """Return a bench, a server, a client, and the client's stopped clock [s]."""
    bench, clock = RosBench(ros), [100.0]
    server = Server(bench.add('touch_gripper'))
    ros.callback(server.action.destroy)
    client = TouchClient(bench.add('planner'), steady=lambda: clock[0])
    ros.callback(client.destroy)
    bench.until(lambda: client.is_ready)
    return bench, server, client, clock


def sent_goal(bench, server, client):
    goal = client.send(position=0.0, effort=2.0)
    bench.until(lambda: goal.handle is not None and server.handles)
    return goal


@pytest.mark.parametrize('is_result_first', [True, False])
def test_result_and_outcome_are_of_the_same_goal(world, is_result_first):
    bench, server, client, _ = world
    goal = sent_goal(bench, server, client)
    server.publish(Outcome.LOST, OTHER_ID)
    steps = [lambda: server.handles[-1].execute(), lambda: server.publish(Outcome.FORCE_REACHED)]
    for step in steps if is_result_first else reversed(steps):
        assert goal.ending is None
        step()
        bench.wait(0.3)
    assert goal.ending.status == GoalStatus.STATUS_SUCCEEDED
    assert goal.ending.state == GripperState(0.03, 2.0, stalled=True)
    assert goal.ending.outcome.outcome == Outcome.FORCE_REACHED and goal.of_hold is None
    server.publish(Outcome.HOLD_ENDED, of_hold=True)
    bench.until(lambda: goal.of_hold)
    assert goal.of_hold.outcome == Outcome.HOLD_ENDED and goal.ending.outcome.outcome == Outcome.FORCE_REACHED


def test_a_lost_outcome_ends_the_wait(world):
    bench, server, client, clock = world
    goal = sent_goal(bench, server, client)
    server.handles[-1].execute()
    bench.wait(0.3)
    assert goal.ending is None
    clock[0] += OUTCOME_WAIT + 0.01
    assert goal.ending.status == GoalStatus.STATUS_SUCCEEDED and goal.ending.outcome is None


def test_a_rejected_goal_ends(world):
    bench, server, client, clock = world
    server.rejects = True
    goal = client.send(position=0.0)
    bench.until(lambda: goal._result)
    clock[0] += OUTCOME_WAIT + 0.01
    assert goal.ending.status == GoalStatus.STATUS_UNKNOWN and goal.handle is None


@pytest.fixture
def planner(ros):
    """A planner's node, which no executor spins, and its client."""
    import rclpy
    node = rclpy.create_node('planner')
    ros.callback(node.destroy_node)
    client = TouchClient(node)
    ros.callback(client.destroy)
    return node, client


@pytest.mark.parametrize('is_spun', [True, False])
def test_a_program_without_an_executor_waits_as_well(ros, planner, is_spun):
    """A gripper node without pads refuses to close.

    Either the client or another thread spins the client's node.
    """
    from tactile_node.gripper.gripper_node import GripperNode
    gripper, (node, client) = GripperNode(), planner
    ros.callback(gripper.destroy_node)
    with spinning([gripper, node] if is_spun else [gripper]):
        goal = client.send(position=0.0)
        ending = client.wait(goal, 60.0, spin=not is_spun)
        assert (ending.status, ending.outcome.outcome) == (GoalStatus.STATUS_ABORTED, Outcome.NOT_SEEN)


@pytest.mark.parametrize('spin', [True, False])
def test_the_wait_is_bounded(planner, spin):
    _, client = planner
    with pytest.raises(TimeoutError, match='touch_gripper/gripper_cmd: the goal has not ended') as raised:
        client.wait(client.send(position=0.0), 0.2, spin=spin)
    assert ('spin=True' in str(raised.value)) is not spin


def test_waiting_leaves_the_node_to_its_executor(planner):
    """If the client also spun the node, rclpy would take the node away from its executor, and one of the two fails."""
    node, client = planner
    with spinning([node]):
        executor = node.executor
        with pytest.raises(TimeoutError):
            client.wait(client.send(position=0.0), 0.2)
        assert node.executor is executor


class LateRegister(dict):
    """rclpy's register of requests without a response.

    This thread registers a request so late that the response arrives first.
    """

    def __init__(self):
        self._sender = threading.current_thread()
        super().__init__()

    def __contains__(self, number):
        if threading.current_thread() is self._sender:
            time.sleep(0.3)
        return super().__contains__(number)


def test_a_response_that_arrives_before_the_request_is_registered_is_not_lost(ros):
    import rclpy
    nodes = [rclpy.create_node(name, start_parameter_services=False) for name in ('touch_gripper', 'planner')]
    for node in nodes:
        ros.callback(node.destroy_node)
    server, client = Server(nodes[0]), TouchClient(nodes[1])
    ros.callback(server.action.destroy)
    ros.callback(client.destroy)
    for name in ('goal', 'cancel', 'result'):
        assert hasattr(client._client, f'_pending_{name}_requests')
        setattr(client._client, f'_pending_{name}_requests', LateRegister())
    with spinning([nodes[0]]), spinning([nodes[1]]):
        until(lambda: client.is_ready)
        goal = client.send(position=0.0)
        until(lambda: goal.handle is not None)
        answer, result = goal.cancel(), goal.handle.get_result_async()
        server.handles[-1].execute()
        until(lambda: answer.done() and result.done())
