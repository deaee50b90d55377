"""Count how closing goals of the gripper node end if nothing fails, with the stages in one or several processes.

Two simulated pads press an object with about 10 N and measure --rate frames per second. A simulated gripper executes
every command. Each closing goal has a force limit of 19 N, well above 10 N, and should therefore end as REACHED. The
skin, the stages, the gripper and the gripper node run in separate processes. If the grasp is too old, the gripper node
stops the gripper and ends the goal as NOT_SEEN after half a second.

Grasps are late on a busy machine. The script therefore also prints the CPU load of all other processes.

    python bench/bench_closes.py [--closes 100] [--rate 50] [FORM ...]
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import ExitStack
from pathlib import Path

import rclpy
from bench_launch import (
    BRINGUP,
    FORMS,
    NODE_IDS,
    OF_BUS,
    busy_seconds,
    cpu_seconds,
    ended,
    executables,
    started,
)

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test'))
from built_messages import BUILT, built_messages, environment_with  # noqa: E402

from tactile_node.gripper.rules.closing import Outcome  # noqa: E402
from tactile_node.gripper.touch_client import TouchClient  # noqa: E402
from tactile_skin.msg import Grasp  # noqa: E402

GRIPPER = Path(__file__).resolve().parents[1] / 'test' / 'gripper_process.py'
EFFORT = 19.0  #: Force limit of the gripper [N].
PARAMETERS = {'widest': 0.05, 'fast_speed': 0.02, 'slow_speed': 0.02, 'highest_force': 20.0}
START_TIMEOUT = 60.0  #: Time allowed for the chain and the gripper to start [s].
SETTLE = 5.0  #: Pause after the start, while starting processes still compete for the processor [s].
GOAL_TIMEOUT = 30.0  #: Time allowed for one goal [s].


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('forms', nargs='*', default=['one', 'executables'], metavar='FORM',
                        help='form of bench_launch.py')
    parser.add_argument('--closes', type=int, default=100)
    parser.add_argument('--rate', type=float, default=50.0, help='SYNC messages per second (default: %(default)s)')
    args = parser.parse_args()
    with built_messages('control_msgs', BUILT):
        for form in args.forms:
            counts, messages, others = closes(form, args.closes, args.rate)
            print(f'{form}: ' + ', '.join(f'{count} {name}' for name, count in counts.most_common())
                  + f'; other processes used {100 * others:.0f} % of a core', flush=True)
            for message, count in messages.most_common(5):
                print(f'    {count} x {message}')
    return 0


def closes(form: str, number: int, rate: float) -> tuple[Counter[str], Counter[str], float]:
    """Send ``number`` closing goals, and count their outcomes.

    Returns the counts of outcomes and of error messages, and the CPU load of other processes [cores].
    """
    with ExitStack() as stack:
        channel = stack.enter_context(tempfile.TemporaryDirectory()) + '/skin'
        skin = started(['simulate', '--pty', '--link', channel, '--node-id', NODE_IDS, '--shapes', 'square', '--areas',
                        '49', '--hold', '100000', '--pause', '1'], stdout=subprocess.PIPE)
        stack.callback(ended, [skin])
        while b'Simulated skin' not in skin.stdout.readline():
            pass
        words = [[*BRINGUP, *each] for each in FORMS[form]]
        if words:
            words[-1] += [*OF_BUS, channel, '--ros-args', '-p', f'skin_driver:sync_period:={1 / rate}']
        chain = [started(each) for each in words] or executables(channel, rate)
        stack.callback(ended, chain)
        environment = environment_with('control_msgs')
        given = [word for name, value in PARAMETERS.items() for word in ('-p', f'{name}:={value}')]
        gripper = [
            subprocess.Popen([sys.executable, *process], env=environment, stdout=subprocess.DEVNULL,
                             stderr=subprocess.DEVNULL, start_new_session=True)
            for process in ([str(GRIPPER), 'works'],
                            ['-m', 'tactile_node.gripper.gripper_node', '--ros-args', *given])]
        stack.callback(ended, gripper)
        rclpy.init()
        stack.callback(rclpy.try_shutdown)
        node = rclpy.create_node('planner')
        grasps: list[Grasp] = []
        node.create_subscription(Grasp, 'grasp', lambda grasp: grasps.__setitem__(slice(None), [grasp]), 1)
        client = TouchClient(node)
        wait_for(node, lambda: client.is_ready and grasps and grasps[-1].contact == Grasp.TWO_SIDED
                 and grasps[-1].fresh)
        end = time.monotonic() + SETTLE
        wait_for(node, lambda: time.monotonic() > end)
        counts, messages = Counter[str](), Counter[str]()

        def used() -> float:
            """Return the CPU time that all other processes have used so far [s]."""
            return busy_seconds() - cpu_seconds([skin, *chain, *gripper]) - time.process_time()
        begun, before = time.monotonic(), used()
        for _ in range(number):
            client.wait(client.send(PARAMETERS['widest']), GOAL_TIMEOUT, spin=True)
            outcome = client.wait(client.send(0.0, effort=EFFORT), GOAL_TIMEOUT, spin=True).outcome
            ending = Outcome(outcome.outcome) if outcome is not None else Outcome.NOT_KNOWN
            counts[ending.name] += 1
            if ending is not Outcome.REACHED:
                messages[outcome.message if outcome is not None else 'no outcome'] += 1
        return counts, messages, (used() - before) / (time.monotonic() - begun)


def wait_for(node: rclpy.node.Node, condition: object) -> None:
    """Spin until ``condition`` is true, and exit with a message after START_TIMEOUT."""
    end = time.monotonic() + START_TIMEOUT
    while not condition():
        if time.monotonic() > end:
            raise SystemExit(f'expected an object between both pads within {START_TIMEOUT:g} s, got none')
        rclpy.spin_once(node, timeout_sec=0.02)


if __name__ == '__main__':
    sys.exit(main())
