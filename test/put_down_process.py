"""Run examples/put_down.py with an arm that only prints its movements: python put_down_process.py.

Each line is an event and the time on the steady clock, which all processes of a machine share.
"""

import subprocess
import sys
import threading
import time
from pathlib import Path

from built_messages import environment_with


class PlannerProcess:
    """Runs this program in another process, and keeps the events that the program prints."""

    def __init__(self):
        self.events = []  # pairs of an event and its time [s]
        self._process = subprocess.Popen([sys.executable, __file__], env=environment_with('control_msgs'),
                                         stdout=subprocess.PIPE, text=True)
        threading.Thread(target=self._read, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self._process.kill()
        self._process.wait()

    def _read(self):
        for line in iter(self._process.stdout.readline, ''):
            event, _, at = line.partition(' ')
            self.events.append((event, float(at)))

    @property
    def is_moving(self):
        return bool(self.events) and self.events[-1][0] == 'moves'

    @property
    def has_ended(self):
        return bool(self.events) and self.events[-1][0] not in ('moves', 'stops')

    def moves_or_has_ended(self):
        return self.is_moving or self.has_ended

    def stopped_at(self):
        return max(at for event, at in self.events if event == 'stops')


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


def main():
    import rclpy

    from tactile_node.gripper.touch_client import TouchClient

    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'examples'))
    import put_down
    rclpy.init()
    planner = rclpy.create_node('planner')
    client = TouchClient(planner)
    while not client.is_ready_to_put_down:
        rclpy.spin_once(planner, timeout_sec=0.1)
    found = put_down.put_down(client, planner, PrintingArm(), highest_table=0.05)
    say('gone' if found is None else f'outcome_{found.outcome}')


if __name__ == '__main__':
    main()
