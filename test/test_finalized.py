"""Tests that a process exits cleanly once its node is finalized.

A finalized node can do nothing more, but its process would still look alive to a launch file.
"""

import subprocess
import sys
import time
from contextlib import ExitStack

import pytest
import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from tactile_node.ros.qos import STATUS_QOS
from tactile_skin.msg import SkinStatus

pytestmark = [pytest.mark.ros, pytest.mark.bus]

TIMEOUT = 60.0  # Timeout for the process, long enough for a busy machine [s].
SHUTDOWN = {SkinStatus.UNCONFIGURED: Transition.TRANSITION_UNCONFIGURED_SHUTDOWN,
            SkinStatus.INACTIVE: Transition.TRANSITION_INACTIVE_SHUTDOWN,
            SkinStatus.ACTIVE: Transition.TRANSITION_ACTIVE_SHUTDOWN}
NO_TRANSITION = 77
DRIVER = [sys.executable, '-m', 'tactile_node.nodes.driver_node', '--ros-args', '-p', 'interface:=virtual']
BRINGUP = [sys.executable, '-m', 'tactile_node.cli.main', 'bringup', '--simulate', '--pads', 'left,right',
           '--node-id', '32,64']


@pytest.mark.parametrize(('command', 'state'), [
    pytest.param([*DRIVER, '-p', 'autostart:=false'], SkinStatus.UNCONFIGURED, marks=pytest.mark.long),
    ([*DRIVER, '-p', 'boot_timeout:=0.2'], SkinStatus.UNCONFIGURED),  # This driver is waiting for a device.
    (BRINGUP, SkinStatus.ACTIVE)], ids=['driver', 'driver that waits', 'all nodes in one process'])
def test_the_transition_shutdown_is_answered_and_ends_the_process(command, state, tmp_path):
    errors = tmp_path / 'errors'  # In a pipe that nobody reads, the logged refusals would block the driver.
    rclpy.init()
    with ExitStack() as stack:
        stack.callback(rclpy.shutdown)
        node, heard = rclpy.create_node('manager'), []
        stack.callback(node.destroy_node)
        node.create_subscription(SkinStatus, '/skin_driver/status', heard.append, STATUS_QOS)
        client = node.create_client(ChangeState, '/skin_driver/change_state')
        process = subprocess.Popen(command, stderr=stack.enter_context(errors.open('w')))
        stack.callback(process.kill)

        def wait(condition):
            deadline = time.monotonic() + TIMEOUT
            while not condition():
                assert time.monotonic() < deadline and process.poll() is None, heard[-1:]
                rclpy.spin_once(node, timeout_sec=0.1)
        wait(lambda: heard and heard[-1].lifecycle_state == state and client.service_is_ready())

        def change(transition, seconds=TIMEOUT):
            answer = client.call_async(ChangeState.Request(transition=Transition(id=transition)))
            rclpy.spin_until_future_complete(node, answer, timeout_sec=seconds)
            return answer.result()
        # The first answers may be lost, because DDS has not discovered this node yet.
        while change(NO_TRANSITION, 2.0) is None:
            assert process.poll() is None
        # A waiting driver refuses to shut down while it is configuring, which it does from time to time.
        while not (answer := change(SHUTDOWN[state])).success:
            assert answer is not None and state == SkinStatus.UNCONFIGURED
        assert process.wait(TIMEOUT) == 0
        assert 'Traceback' not in errors.read_text()
        while heard[-1].lifecycle_state != SkinStatus.FINALIZED:
            rclpy.spin_once(node, timeout_sec=1.0)
