"""A gripper with its action server, pads that press on a simulated spring, and a client, as nodes on one executor.

Time is virtual. In each STEP of virtual time, the gripper moves and the pads measure the result. A bench runs in real
time only if its gripper node or its pads run in another process.
"""

import math
import subprocess
import sys
from contextlib import contextmanager

from built_messages import environment_with
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.parameter import Parameter
from ros_bench import TimedBench
from virtual_gripper import AGE, PERIOD, START, STEP, THRESHOLD, Motor, Pads

from tactile_node.gripper.duplicate_watch import HOLD_TIME
from tactile_node.gripper.gripper_node import GripperNode
from tactile_node.gripper.messages import GripperState, gripper_interface
from tactile_node.gripper.touch_client import TouchClient
from tactile_node.ros.message_age import age_message
from tactile_node.ros.time_messages import time_message
from tactile_skin.msg import ContactShape, Grasp, GripperOutcome

ANSWER_TIME = 2.0  #: Time after which an unanswered goal to another process is sent again [s].


class ServedGoal:
    """A goal of the gripper's own action, as its motor sees it."""

    def __init__(self, motor, handle):
        values = motor.interface.values(handle.request)
        self._motor, self._handle = motor, handle
        self.position, self.effort = values.position, values.effort
        self.opening = motor.offset + motor.scale * values.position
        self.speed = abs(motor.scale) * values.speed

    @property
    def is_cancel_requested(self):
        return self._handle.is_cancel_requested

    def publish(self, opening):
        self._handle.publish_feedback(self._fill('Feedback'))

    def end(self, status, **flags):
        result = self._motor.interface.action.Result() if self._motor.is_terse else self._fill('Result', **flags)

        def execute(_):
            getattr(self._handle, status)()
            return result
        self._handle.execute(execute)

    def _fill(self, kind, **flags):
        motor = self._motor
        state = GripperState((motor.opening - motor.offset) / motor.scale, 1.0, **flags)
        return motor.interface.fill(getattr(motor.interface.action, kind)(), state)


class ServedMotor(Motor):
    """A motor with the action server of the gripper's controller."""

    def __init__(self, bench, interface, scale=1.0, offset=0.0):
        super().__init__(bench.steady)
        self._bench = bench
        self.interface, self.scale, self.offset = interface, scale, offset
        self.is_terse = False  #: True if the results of the motor have empty fields
        self._servers = []
        self.start()

    def start(self):
        """Serve its action.

        An earlier server that does not respond stays in the ROS graph, like the server of a killed process.
        """
        self.is_silent, self._goal = False, None
        self.node = self._bench.add('motor')
        self._bench.stack.callback(self.kill)  # the servers use the node, so they must be destroyed first
        self.server = ActionServer(
            self.node, self.interface.action, '/gripper_controller/gripper_cmd', execute_callback=lambda handle: None,
            goal_callback=lambda goal: GoalResponse.ACCEPT if self.is_accepting else GoalResponse.REJECT,
            cancel_callback=lambda handle: CancelResponse.REJECT if self.stays else CancelResponse.ACCEPT,
            handle_accepted_callback=lambda handle: self.accept(ServedGoal(self, handle)))
        self._servers.append(self.server)

    def restart(self):
        """Start a second server for the motor's action, and wait until the gripper node sees it."""
        self.start()
        self._bench.until_served(len(self._servers))

    def fall_silent(self, goes_on=False):
        self._bench.executor.remove_node(self.node)
        self.is_silent, self.goes_on = True, goes_on

    def wake(self):
        """Respond to all requests that arrived while the server was silent."""
        self._bench.executor.add_node(self.node)
        self.is_silent = False

    def die(self):
        """Destroy the motor's action server, and wait until the gripper node has noticed."""
        self.kill()
        self._bench.until_joined(lambda: not self._bench.node._client.is_there)

    def kill(self):
        while self._servers:
            self._servers.pop().destroy()


class PublishedPads(Pads):
    """Pads whose grasp is published. ``change`` modifies the message."""

    def __init__(self, bench, motor, **options):
        super().__init__(motor, **options)
        self._bench = bench
        self.sent = 0  #: Number of published messages.
        self._publisher = bench.add('pads').create_publisher(Grasp, '/grasp', 10)

    def send(self):
        forces, nan = self.forces(), math.nan
        states = [Grasp.SIDE_TOUCHED if force > THRESHOLD else Grasp.SIDE_EMPTY for force in forces]
        contact = Grasp.NO_CONTACT + states.count(Grasp.SIDE_TOUCHED)
        nowhere = dict.fromkeys(('creep', 'width', 'offset', 'misalignment', 'centre_sd', 'yaw', 'yaw_sd', 'grip_force',
                                 'grip_force_sd', 'force_imbalance'), nan)
        message = Grasp(contact=contact, side_states=states, fresh=True, forces=forces, shape=ContactShape.UNKNOWN,
                        class_name='unknown', centre=[nan, nan], lean=[nan, nan], pads_seen=[True, True],
                        gap=self._motor.opening if self.knows_gap else nan,
                        gap_source=Grasp.GAP_JOINT_STATES if self.knows_gap else Grasp.GAP_NOT_KNOWN, **nowhere)
        for point in (message.midpoint, message.left_centre, message.right_centre):
            point.x = point.y = point.z = nan
        message.header.stamp = time_message(1.7e9 + self._bench.steady() - AGE)
        message.age = age_message(AGE)
        self._publisher.publish(self.change(message))
        self.sent += 1


class Client:
    """Commands the gripper node as a planner does."""

    def __init__(self, bench, interface, action='/touch_gripper/gripper_cmd'):
        self._bench = bench
        node = self.node = bench.add('client')
        self._client = TouchClient(node, action, action_type=interface.action.__name__, steady=bench.steady)
        bench.stack.callback(self._client.destroy)
        self.outcomes: list[GripperOutcome] = []  #: outcomes of all goals and holds
        node.create_subscription(GripperOutcome, f'{action.rpartition("/")[0]}/outcome', self.outcomes.append, 10)

    def until_ready(self):
        self._bench.until_joined(lambda: self._client.is_ready)

    def until_answered(self, position):
        """Wait until the gripper node in another process responds to a goal.

        A response may be lost until both processes have discovered all endpoints of each other.
        """
        self.until_ready()
        sent, sent_at = None, -math.inf

        def is_answered():
            nonlocal sent, sent_at
            if self._bench.steady() - sent_at > ANSWER_TIME:
                sent, sent_at = self._client.send(position), self._bench.steady()
            return sent.handle is not None
        self._bench.until(is_answered)

    def send(self, position=0.0, speed=0.0, effort=0.0, goal=None):
        """Send a goal, and return its handle once the goal has been accepted."""
        sent = self._client.send(position, speed, effort, goal=goal)
        self._bench.until(lambda: sent.handle is not None)
        return sent

    def put_down(self, timeout):
        """Send a goal to put down the object, and return it once it has been accepted."""
        sent = self._client.put_down(timeout)
        self._bench.until(lambda: sent.handle is not None)
        return sent

    def result(self, sent):
        """Return the status, the state and the outcome of a goal."""
        self._bench.until(lambda: sent.ending is not None)
        return sent.ending


@contextmanager
def started_node(*parameters, words=(), ros=(), log=None):
    """Run a gripper node in a separate process.

    ``words`` and ``ros`` are additional arguments, and ``log`` is the file for the node's log.
    """
    given = [word for each in ('max_age:=5.0', 'fast_speed:=0.002', 'slow_speed:=0.002', *parameters)
             for word in ('-p', each)]
    process = subprocess.Popen([sys.executable, '-m', 'tactile_node.gripper.gripper_node', *words, '--ros-args', *given,
                                *ros], env=environment_with('control_msgs'), stderr=log)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


class GripperBench(TimedBench):
    """The motor, the pads, the gripper node and a client.

    If ``pads`` is None, another process publishes the pads in real time. If ``has_node`` is False, the method
    node_as_process starts the node.
    """

    def __init__(self, stack, kind='ParallelGripperCommand', parameters=(), scale=1.0, offset=0.0, pads=(),
                 has_node=True):
        super().__init__(stack, STEP, is_real_time=pads is None or not has_node)
        self.interface = gripper_interface(kind, '')
        self.motor = ServedMotor(self, self.interface, scale, offset)
        self.pads = None if pads is None else PublishedPads(self, self.motor, **dict(pads))
        self.client = Client(self, self.interface)
        if not has_node:
            return
        given = {'action_type': kind, 'gap_scale': scale, 'gap_offset': offset, **dict(parameters)}
        self.node = self.add(self.timed(GripperNode)(
            start_parameter_services=False,  # no test needs parameter services, and each service slows every wait
            parameter_overrides=[Parameter(name, value=value) for name, value in given.items()]))
        self.client.until_ready()
        self.until_joined(lambda: self.node.count_publishers('/grasp'))
        self.until_listened()
        self.until_seen()

    def on_step(self):
        self.motor.step()
        if self.pads is not None:
            self.pads.step()

    @contextmanager
    def node_as_process(self, *parameters, **options):
        """Run the gripper node in another process, and kill the process at the end.

        The gripper moves ten times as fast as it is commanded to. At this speed, no pad counts as unseen and the
        gripper does not count as too slow, even on a busy machine.
        """
        self.motor.slowness = 0.1
        with started_node(*parameters, **options) as process:
            self.client.until_answered(START - 0.001)
            self.until(lambda: self.outcome(position=START - 0.001) not in (None, GripperOutcome.NOT_SEEN))
            self.motor.commands.clear()
            self.motor.directions.clear()
            yield process

    def until_listened(self):
        """Wait until the node accepts goals to close.

        Before the node accepts goals to close, it listens for other gripper nodes.
        """
        while not self.node._watch.has_listened:
            if self.time is None:
                self.wait(STEP)
            else:  # advance the virtual time in one step
                self.time.advance(HOLD_TIME)
                self.settle()

    def until_served(self, servers):
        """Wait until the gripper node sees ``servers`` servers of the gripper's own action."""
        service = '/gripper_controller/gripper_cmd/_action/send_goal'
        self.until_joined(lambda: self.node.count_services(service) == servers)

    def until_seen(self):
        """Wait until the gripper node has estimated the age of the pads' frames and uses them."""
        self.until(lambda: self.node._control.is_current)

    def open(self):
        """Open the gripper from any state, and clear the list of commands."""
        self.motor.move_to(START)
        self.motor.commands.clear()
        self.pads.change, self.pads.is_silent, self.pads.strongest = (lambda message: message), False, 0.0
        self.wait(2 * PERIOD)
        self.until_seen()

    def close(self, **goal):
        """Close the gripper until the goal ends, and return the status, the state and the outcome."""
        return self.client.result(self.client.send(**goal))

    def outcome(self, **goal):
        """Close the gripper until the goal ends, and return the outcome, or None if late discovery lost its message."""
        ending = self.close(**goal)
        return ending.outcome and ending.outcome.outcome
