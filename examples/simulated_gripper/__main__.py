"""Simulate a gripper with two tactile pads, to try a grasp planner without hardware.

    python -m examples.simulated_gripper --item square --seed 1 --link /tmp/skin
    tactile bringup --interface slcan --channel /tmp/skin --pads left,right --node-ids 32,64 \\
        --params-file examples/simulated_gripper/parameters.yaml

With --seed, the item is displaced from the aim of the hand by up to 8 mm and turned by up to 15 degrees. Without
--seed, the item is exactly at the aim. The second command is the same as for a real skin. Use the action
hand/gripper_cmd (control_msgs) to command the gripper. Publish a geometry_msgs/PoseStamped in the frame table on the
topic hand/target_pose to command the hand, or type orders into this program. docs/howto/simulated_gripper.md describes
both, and how to get control_msgs.
"""

import argparse
import gc
import sys
import threading

import rclpy
from rclpy.signals import SignalHandlerOptions

from examples.simulated_gripper.console import HELP, obey
from examples.simulated_gripper.hand_interface import HAS_TF, TARGET
from examples.simulated_gripper.items import ITEMS, item_of
from examples.simulated_gripper.session import HAS_ACTION, Bench
from examples.simulated_gripper.world import AIM, World, random_place
from tactile_node.errors import TactileError
from tactile_node.interruption import ignore_interruptions, interruption

REMEDY = 'make messages; source build/messages/setup.bash'


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog='simulated_gripper', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--item', default='square', help=f'item to grasp: {", ".join(ITEMS)} (default: %(default)s)')
    parser.add_argument('--seed', type=int, help="seed of the item's displacement (default: no displacement)")
    parser.add_argument('--link', default='', metavar='PATH', help="symbolic link to the skin's adapter")
    args = parser.parse_args(argv)
    try:
        return _serve(World(item_of(args.item), AIM if args.seed is None else random_place(args.seed)), args)
    except TactileError as error:
        print(f'simulated_gripper: error: {error}', file=sys.stderr)
        return 2


def _serve(world: World, args: argparse.Namespace) -> int:
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    with interruption() as stop_requested, Bench(world, args.link, args.seed or 0) as bench:
        print(f'Simulated gripper with {args.item}, skin at {bench.port}, joint states at /joint_states, '
              f'target poses of the hand from /{TARGET}, '
              + ('frames on /tf, ' if HAS_TF else f'no frames: tf2_msgs is not found ({REMEDY}), ')
              + ('action /hand/gripper_cmd' if HAS_ACTION
                 else f'no action: control_msgs is not found ({REMEDY})') + f'\n{HELP}', flush=True)
        gc.freeze()  # a full garbage collection would delay a sweep
        threading.Thread(target=_read, args=(world,), name='console', daemon=True).start()
        while not stop_requested.wait(0.2) and not bench.failures:
            pass
        print(bench.report())
    return 1 if bench.failures else 0


def _read(world: World) -> None:
    for line in sys.stdin:
        print(obey(world, line), flush=True)


if __name__ == '__main__':
    try:
        sys.exit(main())
    finally:
        ignore_interruptions()
