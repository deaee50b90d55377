"""Count the movements that the nodes report while the simulated gripper lifts and shakes an item that does not slide.

    python bench/bench_lifts.py --force 5 --starts 3
    python bench/bench_lifts.py --force 5 --starts 3 --rigid    # the skin does not yield along the pad

The chain runs in lockstep with the physics, so the counts do not depend on the speed of the machine. The benchmark
needs MuJoCo (requirements/bench_physics.txt).
"""

import argparse
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

import numpy as np
from bench_grasps import start_of
from planner_world import PITCH, noisy

from examples.simulated_gripper.drive import Command
from examples.simulated_gripper.items import ITEMS
from examples.simulated_gripper.world import SIDES, Outcome, World
from tactile_node.pose.events import Moving
from tactile_node.pose.motion import MotionFollower
from tactile_node.pose.pipeline import ContactPipeline, Taxels, sight_of
from tactile_node.shape.methods import VisibilityGuard, make_recogniser

PERIOD = 0.02      #: Period of the frames [s].
CLOSING = 4.0      #: Time in which the gripper closes and the grip settles [s].
SPEED = 0.02       #: Closing speed [m/s].
BEFORE = 0.8       #: Time at rest before the lift [s].
AFTER = 0.3, 0.5   #: Times at rest after the lift and after the shake [s].
LIFT = 0.1         #: [m]
SHAKE = 1.0        #: Acceleration of the shake [g].
STAYED = 0.3e-3    #: Largest movement between pad and item that is no slide [m].


class Handling(NamedTuple):
    """The movements that either pad has reported."""

    in_lift: Moving
    in_shake: Moving
    longest: float  #: longest slide in one direction [s]
    slid: float     #: distance between the places of the item in a pad before the lift and at the end [m]


class RigidWorld(World):
    """A simulated bench whose skins do not yield along the pad."""

    def load(self, side: str) -> np.ndarray:
        return np.zeros(2)


class Follower:
    """Follows the contact on one pad."""

    def __init__(self, recogniser: VisibilityGuard):
        self._pipeline, self._motions = ContactPipeline(recogniser), MotionFollower()
        self._direction, self._since = math.nan, 0.0
        self.longest = 0.0  #: longest slide in one direction [s]

    def see(self, time: float, values: np.ndarray) -> Moving:
        found = self._pipeline.find(values, Taxels(PITCH, 'Pa'))
        motion = self._motions.update(sight_of(self._pipeline.recognise(found, time), time))
        direction = motion.direction if motion.moving & Moving.SLIDING else math.nan
        if math.cos(direction - self._direction) > 0:
            self.longest = max(self.longest, time - self._since)
        else:
            self._direction, self._since = direction, time
        return motion.moving


def handled(world: World, recogniser: VisibilityGuard, random: np.random.Generator) -> Handling:
    """Lift and shake the item that the gripper holds."""
    followers = {side: Follower(recogniser) for side in SIDES}

    def follow(seconds: float, is_moving: Callable[[], bool] = lambda: False) -> Moving:
        seen, end = Moving.NOT_KNOWN, world.now + seconds
        while is_moving() or world.now < end:
            end = world.now + seconds if is_moving() else end
            world.step(PERIOD)
            for side, follower in followers.items():
                seen |= follower.see(world.now, noisy(world.pressures(side), random))
        return seen
    follow(BEFORE)
    before = {side: world.item_in(side).translation for side in SIDES}
    world.move(lift=LIFT)
    in_lift = follow(AFTER[0], lambda: world.is_moving)
    world.shake(SHAKE)
    in_shake = follow(AFTER[1], lambda: world.is_moving)
    slid = max(np.hypot(*(world.item_in(side).translation - before[side])[:2]) for side in SIDES)
    return Handling(in_lift, in_shake, max(each.longest for each in followers.values()), float(slid))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--force', type=float, default=5.0, help='closing force [N] (default: %(default)s)')
    parser.add_argument('--starts', type=int, default=3, help='number of starts for each item (default: %(default)s)')
    parser.add_argument('--rigid', action='store_true', help='let the skin not yield along the pad')
    args = parser.parse_args()
    recogniser, stayed, held, starts = make_recogniser(), list[Handling](), 0, len(ITEMS) * args.starts
    for seed in range(args.starts):
        for name, item in ITEMS.items():
            world = (RigidWorld if args.rigid else World)(item, start_of(name, seed))
            world.command(Command(0.0, velocity=SPEED, effort=args.force))
            world.step(CLOSING)
            found = handled(world, recogniser, np.random.default_rng(seed))
            print(f'{name} {seed}: {world.outcome.value}, slid by {1e3 * found.slid:.1f} mm, lift: {found.in_lift!r}, '
                  f'shake: {found.in_shake!r}, longest slide {found.longest:.2f} s', flush=True)
            held += world.outcome is Outcome.HELD
            stayed += [found] * (found.slid < STAYED)
    print(f'{held} of {starts} held; of {len(stayed)} that did not slide, the longest reported slide took '
          f'{max(each.longest for each in stayed):.2f} s')
    for flag in (Moving.SHIFTING, Moving.SLIDING, Moving.TURNING):
        print(f'{flag.name}: {sum(flag in each.in_lift for each in stayed)} in the lift, '
              f'{sum(flag in each.in_shake for each in stayed)} in the shake')


if __name__ == '__main__':
    main()
