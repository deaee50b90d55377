"""Run examples/put_down.py with an arm that only prints its movements: python put_down_process.py.

Each line is an event and the time on the steady clock, which all processes of a machine share.
"""

import sys
import time
from pathlib import Path

import rclpy

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'examples'))

import put_down

from tactile_node.gripper.touch_client import TouchClient


class PrintingArm:
    """An arm far above the table, which never feels a contact."""

    def __init__(self):
        self._moves = False

    def height(self):
        return 1.0

    def lower(self, speed):
        if (speed > 0) != self._moves:
            self._moves = speed > 0
            say('moves' if self._moves else 'stops')

    def feels_contact(self):
        return False


def say(event):
    print(event, time.monotonic(), flush=True)


if __name__ == '__main__':
    rclpy.init()
    planner = rclpy.create_node('planner')
    touch_client = TouchClient(planner)
    while not touch_client.is_ready_to_put_down:
        rclpy.spin_once(planner, timeout_sec=0.1)
    found = put_down.put_down(touch_client, planner, PrintingArm(), highest_table=0.05)
    say('gone' if found is None else f'outcome_{found.outcome}')
