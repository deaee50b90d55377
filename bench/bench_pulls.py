"""Count how often the simulated gripper keeps an item that is pulled down harder than friction holds at first.

    python bench/bench_pulls.py --starts 5

Each start has two columns:

- touch: the rules of touch_gripper close until a pad reads FORCE, and keep the opening.
- hold: the rules close as in touch, then keep the force and raise it by 1 N for each slide, up to 9 N.

The hand lifts the item by 10 cm. The end of a spring then moves down at 3 mm/s until the item carries 1.3 times the
load that friction carries at FORCE. The rules, the recognition and the physics run in lockstep, so the results do not
depend on the speed of the machine. A repeated call continues where the file ends. The benchmark needs MuJoCo
(requirements/bench_physics.txt).
"""

import argparse
import json
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'examples'), str(ROOT / 'test'), str(Path(__file__).parent)]

import numpy as np
from bench_grasps import comparison, read, share, start_of
from bench_lifts import AFTER, LIFT
from lockstep_gripper import LockstepGripper

from examples.simulated_gripper.drive import Command
from examples.simulated_gripper.items import ITEMS
from examples.simulated_gripper.model import MAX_GAP
from examples.simulated_gripper.world import GRAVITY, SIDES, Outcome, World
from tactile_node.gripper.rules.touch_settings import TouchSettings

COLUMNS = {'touch': {}, 'hold': {'hold': True, 'slide_force_step': 1.0, 'hold_travel': 0.02, 'highest_force': 9.0}}
RULES = {'widest': 0.085, 'stiffness': 1000.0, 'latency': 0.1, 'fast_speed': 0.02, 'slow_speed': 0.003}
FORCE = 5.0         #: closing force [N]
TRIES = 4           #: largest number of goals to close
REOPENED = 3.0      #: time in which the gripper opens before another goal [s]
PULL_SPEED = 0.003  #: speed of the spring's end [m/s]
PULL_TIME = 12.0    #: duration of the pull, long enough for the item to leave the pads [s]
BEYOND = 1.3        #: load on the pulled item, as a multiple of the friction that both pads provide at FORCE
SHORT = 10.0        #: a held item that slid by less than this has kept its place [mm]


def pulled(column: str, name: str, seed: int) -> dict:
    """Grip, lift and pull an item, and return the record of this start."""
    item = ITEMS[name]
    world = World(item, start_of(name, seed))
    gripper = LockstepGripper(world, TouchSettings(**RULES, **COLUMNS[column]), np.random.default_rng((49, seed)))
    outcomes = [gripper.close(FORCE)]
    while not gripper.endings[0].succeeds and len(outcomes) < TRIES:
        world.command(Command(MAX_GAP))
        gripper.follow(REOPENED)
        outcomes.append(gripper.close(FORCE))
    record = {'column': column, 'item': name, 'seed': seed, 'outcomes': [each.name for each in outcomes]}
    if not gripper.endings[0].succeeds:
        return record | {'end': 'gave up'}
    gripper.follow(AFTER[0])
    world.move(lift=LIFT)
    gripper.follow(until=lambda: not world.is_moving)
    before, slid = world.item_in(SIDES[0]).translation, 0.0

    def is_lost() -> bool:
        nonlocal slid
        if min(world.forces.values()) > 0:
            slid = float(np.hypot(*(world.item_in(SIDES[0]).translation - before)[:2]))
        return world.outcome in (Outcome.DROPPED, Outcome.BROKEN)

    first_force = min(world.forces.values())
    world.pull(PULL_SPEED, BEYOND * 2 * item.friction * FORCE - item.mass * GRAVITY)
    gripper.follow(PULL_TIME, until=is_lost)
    end = world.outcome.value if world.outcome in (Outcome.HELD, Outcome.BROKEN) else 'dropped'
    return record | {'end': end, 'slid_mm': round(1e3 * slid, 2), 'first_force': round(first_force, 2),
                     'most_force': round(world.most_force, 2),
                     'holds': [each.outcome.name for each in gripper.endings if each.is_hold]}


def report(found: dict[tuple[str, str, int], dict], seeds: range) -> None:
    """Print the results of the starts that are finished in both columns."""
    starts = [(name, seed) for name in ITEMS for seed in seeds if all((each, name, seed) in found for each in COLUMNS)]
    for column in COLUMNS if starts else ():
        records = [found[column, name, seed] for name, seed in starts]
        held = [each['slid_mm'] for each in records if each['end'] == 'held']
        ends = [each['end'] for each in records]
        print(f'{column}: {share(len(held), len(starts))} held (95 %), {ends.count("dropped")} dropped, '
              f'{ends.count("broken")} broken, {ends.count("gave up")} gave up; '
              f'{sum(each < SHORT for each in held)} held and slid by less than {SHORT:g} mm')
    pairs = [tuple(found[column, name, seed]['end'] == 'held' for column in COLUMNS) for name, seed in starts]
    print(comparison(*COLUMNS, pairs))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--starts', type=int, default=5, help='number of starts for each item (default: %(default)s)')
    parser.add_argument('--output', type=Path, default=ROOT / 'build/grasps/pulls.jsonl', metavar='FILE')
    args = parser.parse_args()
    args.output.parent.mkdir(parents=True, exist_ok=True)
    found = read(args.output)
    with args.output.open('a', encoding='utf-8') as file:
        for seed in range(args.starts):
            for name in ITEMS:
                for column in COLUMNS:
                    if (column, name, seed) not in found:
                        record = found[column, name, seed] = pulled(column, name, seed)
                        print(json.dumps(record), file=file, flush=True)
                        print(f'{name} {seed} {column}: {record["end"]}', flush=True)
    report(found, range(args.starts))


if __name__ == '__main__':
    main()
