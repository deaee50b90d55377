"""Serve a gripper's own action until a test stops or kills this process: python gripper_process.py KIND [TRAVEL].

KIND is works, hangs or rejects. With hangs, the process accepts a goal and then sends no further response. TRAVEL is
the distance by which the gripper closes in a step of 0.02 s [m]. By default, the gripper closes as far in each step as
it opens. The process prints one line for each event. The first event is the discovery of the action client. Before the
process reports that it has reached a goal, it waits for a line of input, so that its opening is published first.
"""

import sys
import threading

import rclpy
from control_msgs.action import ParallelGripperCommand
from rclpy.action import ActionServer, CancelResponse, GoalResponse

PERIOD = 0.02  #: Duration of a step [s].
TRAVEL = 0.001  #: Movement of the gripper per step [m].
START = 0.06  #: Opening of the gripper at the start [m].
ACTION = '/gripper_controller/gripper_cmd'


class Gripper:
    """A gripper on which each new goal replaces the current one."""

    def __init__(self, kind, travel=TRAVEL):
        self.kind, self.closes_by, self.opening, self.goal = kind, float(travel), START, None
        self.node = rclpy.create_node('gripper')
        self.server = ActionServer(
            self.node, ParallelGripperCommand, ACTION, execute_callback=lambda handle: None,
            goal_callback=lambda goal: GoalResponse.REJECT if kind == 'rejects' else GoalResponse.ACCEPT,
            cancel_callback=lambda handle: CancelResponse.ACCEPT, handle_accepted_callback=self.accept)
        self.node.create_timer(PERIOD, self.step)

    def accept(self, handle):
        if self.goal is not None:
            self.end(self.goal.abort)
        self.goal = handle
        say('accepted', handle.request.command.position[0])

    def step(self):
        if self.goal is None:
            return
        if self.kind == 'hangs':
            threading.Event().wait()
        if self.goal.is_cancel_requested:
            self.end(self.goal.canceled)
            say('cancelled', self.opening)
            return
        target = self.goal.request.command.position[0]
        self.opening += max(-self.closes_by, min(TRAVEL, target - self.opening))
        if self.opening == target:
            say('reached', target)
            sys.stdin.readline()
            self.end(self.goal.succeed, reached_goal=True)

    def end(self, end, **flags):
        handle, self.goal = self.goal, None

        def execute(_):
            end()
            return ParallelGripperCommand.Result(**flags)
        handle.execute(execute)


def say(event, opening):
    print(event, f'{opening:g}', flush=True)


if __name__ == '__main__':
    rclpy.init()
    gripper = Gripper(*sys.argv[1:])
    while not gripper.node.count_clients(f'{ACTION}/_action/send_goal'):
        rclpy.spin_once(gripper.node, timeout_sec=PERIOD)
    print('ready', flush=True)
    rclpy.spin(gripper.node)
