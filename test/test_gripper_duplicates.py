"""Tests of two gripper nodes that share one gripper or one name.

No gripper may close, and both nodes must report the duplicate.
"""

import logging
import signal
import subprocess
import sys
from contextlib import contextmanager
from functools import partial

import pytest
from action_msgs.msg import GoalStatus
from built_messages import environment_with
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from gripper_bench import Client, GripperBench, started_node
from rclpy.parameter import Parameter

from tactile_node.gripper import duplicate_watch
from tactile_node.gripper.duplicate_watch import HEARTBEAT_PERIOD, HOLD_TIME, LISTEN_TIME
from tactile_node.gripper.gripper_node import GripperNode
from tactile_node.gripper.rules.closing import Outcome

pytestmark = [pytest.mark.ros, pytest.mark.bus, pytest.mark.usefixtures('control_msgs')]

ABORTED = GoalStatus.STATUS_ABORTED
LONG = pytest.mark.long
OTHER = '/other_gripper/gripper_cmd'
SAME_NAME, OTHER_NAME = (), ('-r', '__node:=other_gripper')


@pytest.fixture
def make_bench(ros):
    return partial(GripperBench, ros)


def servers(bench, action):
    return bench.client.node.count_services(f'{action}/_action/send_goal')


class Diagnostics:
    """Keeps the latest diagnostics entry for each name."""

    def __init__(self, bench):
        self.found: dict[str, DiagnosticStatus] = {}
        bench.add('diagnostics').create_subscription(DiagnosticArray, '/diagnostics', self._take, 10)

    def _take(self, message):
        self.found |= {each.name: each for each in message.status}

    def level(self, name):
        return self.found[name].level if name in self.found else None


# Tests with separate processes, in real time

@pytest.mark.parametrize(('ros_words', 'action'), [
    pytest.param(SAME_NAME, '/touch_gripper/gripper_cmd', marks=LONG, id='same_name'),
    pytest.param(OTHER_NAME, OTHER, id='other_name')])
def test_one_goal_to_close_is_not_carried_out_by_two_processes(make_bench, tmp_path, ros_words, action):
    """The client sends the first goal as soon as it sees the second process.

    The client sends later goals once both processes have heard each other.
    """
    bench, logs = make_bench(has_node=False), [tmp_path / name for name in ('first', 'second')]
    diagnostics = Diagnostics(bench)
    with logs[0].open('w') as first_log, logs[1].open('w') as second_log:
        with bench.node_as_process(log=first_log) as first:
            with started_node(ros=ros_words, log=second_log) as second:
                bench.until_joined(lambda: servers(bench, action) == 1 + (ros_words == SAME_NAME))
                other = bench.client if ros_words == SAME_NAME else Client(bench, bench.interface, action)
                other.until_ready()
                other.result(other.send(position=0.0))
                # Until the first process has heard the second process, the first process may close.
                assert bench.motor.directions.count('close') <= 1
                bench.until(lambda: all('a tactile commission is heard' in log.read_text() for log in logs))
                bench.until(lambda: not bench.motor.moves)
                assert bench.motor.directions.count('close') <= 1
                bench.motor.directions.clear()
                for client in (bench.client, other):
                    status, _, outcome = client.result(client.send(position=0.0, effort=5.0))
                    assert (status, outcome.outcome) == (ABORTED, Outcome.DUPLICATE)
                    assert 'ros2 topic info' in outcome.message
                bench.until(lambda: all(diagnostics.level(f'/{name}: gripper') == DiagnosticStatus.ERROR
                                        for name in ('touch_gripper', action.split('/')[1])))
                sent = other.send(position=0.08)
                bench.until(lambda: bench.motor.opening == 0.08 and sent.ending)
                assert 'close' not in bench.motor.directions
                second.send_signal(signal.SIGKILL)
                second.wait()
            assert first.poll() is None
            bench.motor.move_to(0.06)
            bench.until(lambda: bench.outcome(position=0.059) == Outcome.REACHED)
            bench.until(lambda: 'has ended' in logs[0].read_text())
            bench.until(lambda: diagnostics.level('/touch_gripper: gripper') == DiagnosticStatus.OK)


@LONG
def test_a_process_that_was_stopped_listens_again_before_it_closes(make_bench):
    """A process that is stopped by SIGSTOP does not count as a duplicate.

    When such a process continues, its queue may contain goals for the other process.
    """
    bench = make_bench(has_node=False)
    with bench.node_as_process():
        with started_node() as second:
            bench.until_joined(lambda: servers(bench, '/touch_gripper/gripper_cmd') == 2)
            bench.until(lambda: bench.outcome(position=0.0) == Outcome.DUPLICATE)
            second.send_signal(signal.SIGSTOP)
            bench.until(lambda: bench.outcome(position=0.059) == Outcome.REACHED)
            bench.motor.move_to(0.06)
            bench.motor.commands.clear()
            sent = bench.client.send(position=0.0)
            bench.until(lambda: bench.motor.commands)
            second.send_signal(signal.SIGCONT)
            assert bench.client.result(sent).outcome.outcome == Outcome.DUPLICATE
            bench.wait(1.0)
            assert len(bench.motor.commands) == 1 and not bench.motor.moves


@pytest.mark.parametrize('number', [pytest.param(signal.SIGTERM, marks=LONG), signal.SIGKILL])
def test_a_node_ends_with_the_process_that_is_named(make_bench, number):
    """SIGTERM to `ros2 run` would leave the node behind, so the node exits with the process named by --end-with.

    The node also accepts ROS arguments alongside --end-with.
    """
    bench = make_bench(has_node=False)
    parent = subprocess.Popen(['sleep', '1000'])
    try:
        with bench.node_as_process(words=['--end-with', str(parent.pid)]) as process:
            assert process.poll() is None
            parent.send_signal(number)
            parent.wait()
            assert process.wait(60) == 0
    finally:
        parent.kill()


@LONG
def test_a_process_id_that_is_not_a_number_causes_one_error(tmp_path):
    done = subprocess.run([sys.executable, '-m', 'tactile_node.gripper.gripper_node', '--end-with', 'launch'],
                          env=environment_with('control_msgs'), capture_output=True, text=True, timeout=60)
    assert done.returncode == 2 and '--end-with' in done.stderr and 'Traceback' not in done.stderr


# Tests in virtual time

def add_second(bench, name='second', **parameters):
    given = [Parameter(key, value=value) for key, value in parameters.items()]
    return bench.add(bench.timed(GripperNode)(parameter_overrides=given,
                                              cli_args=['--ros-args', '-r', f'__node:={name}']))


@contextmanager
def paused(bench, node):
    """Run no callback of ``node``, like the process of a node that is stopped by SIGSTOP."""
    timers = [each for each in bench.time.timers if each.node is node]
    bench.time.timers = [each for each in bench.time.timers if each.node is not node]
    bench.executor.remove_node(node)
    yield
    bench.executor.add_node(node)
    bench.time.timers += timers


def test_a_node_that_was_paused_listens_again_before_it_closes(make_bench):
    """A paused node of the same name does not count as a duplicate, and its queue receives the goals for both nodes."""
    bench = make_bench()
    second = add_second(bench, name=bench.node.get_name())
    bench.until_joined(lambda: servers(bench, '/touch_gripper/gripper_cmd') == 2)
    bench.until(lambda: bench.node._watch.topics)
    with paused(bench, second):
        bench.until(lambda: not bench.node._watch.topics)
        sent = bench.client.send(position=0.0)
        bench.until(lambda: bench.motor.commands)
    assert bench.client.result(sent).outcome.outcome == Outcome.DUPLICATE
    bench.wait(1.0)
    assert len(bench.motor.commands) == 1 and not bench.motor.moves


def test_a_duplicate_is_an_error_and_its_end_is_information(make_bench, caplog):
    caplog.set_level(logging.INFO, duplicate_watch.__name__)
    bench = make_bench()
    second = add_second(bench)
    bench.until(lambda: bench.node._watch.topics)
    bench.wait(2 * HEARTBEAT_PERIOD)
    second.destroy_node()
    bench.until(lambda: not bench.node._watch.topics)
    bench.wait(2 * HEARTBEAT_PERIOD)
    told = [(each.levelno, each.message.split(',')[0]) for each in caplog.records
            if each.name == duplicate_watch.__name__ and each.node == bench.node.get_logger().name]
    assert told == [(logging.ERROR, 'closing is disabled'), (logging.INFO, 'the other touch_gripper has ended')]


def test_a_goal_to_close_waits_after_a_start_and_one_to_open_does_not(make_bench):
    bench = make_bench()
    bench.node.destroy_node()
    bench.node = bench.add(bench.timed(GripperNode)())
    bench.client.until_ready()
    bench.until_joined(lambda: bench.node.count_publishers('/grasp'))
    bench.until_seen()
    began = bench.steady()
    sent = bench.client.send(position=0.0)
    bench.wait(0.5)
    assert sent.ending is None and not bench.motor.commands
    assert bench.close(position=0.08).outcome.outcome == Outcome.REACHED and len(bench.motor.commands) == 1
    assert sent.ending.outcome.outcome == Outcome.REPLACED
    sent = bench.client.send(position=0.0)
    assert bench.client.result(sent).outcome.outcome == Outcome.TOUCHED
    assert LISTEN_TIME - HOLD_TIME < bench.steady() - began < LISTEN_TIME + 2.0
