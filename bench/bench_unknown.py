"""Count how often a gripper holds objects whose mass, friction and strength it does not know.

    python bench/bench_unknown.py --starts 300
    python bench/bench_unknown.py --columns fixed:4,fixed:5,fixed:6 --seed 1000 --starts 40 --output FILE   # tuning

In each start, the gripper closes on an object, lifts it slowly for the first 15 mm, then faster up to 10 cm, and shakes
it. A spring then pulls the object down. The number of a column is its closing force [N]:

- fixed: the gripper's own action closes with this force, which the motor limits without error.
- touch: the rules of touch_gripper close until a pad reads this force.
- hold: the rules close as in touch, then keep the force and raise it when the object slides.
- best: as fixed, but with a force that is chosen with knowledge of the object. This column is an upper bound.

The rules, the recognition and the physics run in lockstep, so the results do not depend on the speed of the machine.
Each start depends only on its seed. A repeated call continues where the file ends. The benchmark needs MuJoCo.
"""

import argparse
import json
import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'examples'), str(ROOT / 'test'), str(ROOT / 'bench')]

import numpy as np
from lockstep_gripper import LockstepGripper
from scipy.stats import binomtest, norm
from unknown_objects import MOST_FORCE, SHAKE, WIDTH_ERROR, UnknownObject, unknown_object

from examples.simulated_gripper.drive import Command
from examples.simulated_gripper.model import MAX_GAP
from examples.simulated_gripper.world import SIDES, Outcome, World
from tactile_node.gripper.rules.closing import Outcome as Ending
from tactile_node.gripper.rules.touch_settings import TouchSettings

RULES = {'widest': 0.085, 'stiffness': 1000.0, 'latency': 0.1, 'fast_speed': 0.01, 'slow_speed': 0.003,
         'highest_force': MOST_FORCE}
HOLD = {'hold': True, 'slide_force_step': 1.0, 'hold_travel': 0.02}
SPEED = 0.01          #: closing speed of all columns until the first touch [m/s]
CLEARANCE = 0.01      #: opening from which the gripper closes, beyond the largest width of the object [m]
PATIENCE = 10.0       #: longest time for the gripper's own action [s]; the action does not end while the object rocks
REST = 0.5            #: pause after each part of a start [s]
SLOW_SPEED = 0.005    #: speed of the slow lift [m/s]
SLOW_TIME = 3.0       #: duration of the slow lift, which is 15 mm high [s]
FAST_SPEED = 0.05     #: speed of the rest of the lift [m/s]
FAST_TIME = 1.7       #: duration of the rest of the lift, which ends at a height of 0.1 m [s]
PULL_SPEED = 0.005    #: speed of the spring's end [m/s]
PULL_TIME = 6.0       #: longest duration of the pull [s]
STANDS = 2.0          #: a pull ends early if the object has not slid for this time [s]
STILL = 5e-5          #: largest movement that is no slide in a pull [m]
TRIES = 4             #: largest number of goals to close in a start
AGAIN = (Ending.NOT_SEEN, Ending.FORCE_NOT_KNOWN, Ending.LOST)  #: outcomes after which the gripper closes again
ENDS = ('held', 'dropped', 'broken', 'gave up')


def started(column: str, seed: int) -> dict:
    """Grip, lift, shake and pull the object of a seed, and return the record of this start."""
    kind, _, number = column.partition(':')
    drawn = unknown_object(seed)
    world, force = World(drawn.item, drawn.place), float(number or drawn.best_force)
    gripper = LockstepGripper(world, TouchSettings(**RULES, **(HOLD if kind == 'hold' else {})),
                              np.random.default_rng((50, seed)))
    record = {'column': column, 'seed': seed, 'shape': drawn.name, 'need': round(drawn.need, 2),
              'strength': round(drawn.item.strength, 2)}
    outcomes = _closed(gripper, drawn, kind, force)
    record |= {'outcomes': [each.name for each in outcomes], 'closing': _strongest(world)}
    if kind in ('touch', 'hold') and not gripper.endings[0].succeeds:
        return record | {'end': 'broken' if world.outcome is Outcome.BROKEN else 'gave up'}
    gripper.is_watched = kind == 'hold'
    gripper.follow(REST)
    record['at_lift'] = _strongest(world)
    before, slid, moved_at, parts = world.item_in(SIDES[0]).translation, 0.0, 0.0, {}

    def is_over() -> bool:
        nonlocal slid, moved_at
        if min(world.forces.values()) > 0:
            now = float(np.hypot(*(world.item_in(SIDES[0]).translation - before)[:2]))
            slid, moved_at = (now, world.now) if now > slid + STILL else (slid, moved_at)
        stands = part == 'pull' and world.now - max(moved_at, begun) > STANDS
        return stands or world.outcome in (Outcome.DROPPED, Outcome.BROKEN)
    for part, (seconds, speed) in {'slow lift': (SLOW_TIME, SLOW_SPEED), 'lift': (FAST_TIME, FAST_SPEED),
                                   'rest': (REST, 0.0), 'shake': (1.0, 0.0), 'pause': (REST, 0.0),
                                   'pull': (PULL_TIME, 0.0)}.items():
        if part == 'shake':
            world.shake(SHAKE)
        elif part == 'pull':
            world.pull(PULL_SPEED, drawn.pull)
        begun = world.now
        gripper.follow(seconds, speed, is_over)
        parts[part] = [round(1e3 * slid, 2), _strongest(world)]
        if is_over() or (part == 'rest' and world.outcome is not Outcome.HELD):
            break
    end = world.outcome.value if world.outcome in (Outcome.HELD, Outcome.BROKEN) else 'dropped'
    return record | {'end': end, 'slid_mm': round(1e3 * slid, 2), 'most': round(world.most_force, 2), 'parts': parts,
                     'holds': [each.text for each in gripper.endings if each.is_hold]}


def _strongest(world: World) -> float:
    return round(max(world.forces.values()), 2)


def _closed(gripper: LockstepGripper, drawn: UnknownObject, kind: str, force: float) -> list[Ending]:
    """Close the gripper, and return the outcomes of the goals of touch_gripper."""
    world, outcomes = gripper.world, list[Ending]()
    opening = min(drawn.known_width + WIDTH_ERROR + CLEARANCE, MAX_GAP)
    gripper.is_watched = kind in ('touch', 'hold')
    while True:
        world.command(Command(opening))
        gripper.follow(PATIENCE, until=lambda: world.drive.is_at_goal)
        if not gripper.is_watched:
            world.command(Command(0.0, SPEED, force))
            gripper.follow(PATIENCE, until=lambda: world.drive.is_stalled)
            return outcomes
        outcomes.append(gripper.close(force))
        if outcomes[-1] not in AGAIN or len(outcomes) == TRIES:
            return outcomes


def read(file: Path) -> dict[tuple[str, int], dict]:
    """Return the finished starts by column and seed."""
    lines = map(json.loads, file.read_text(encoding='utf-8').splitlines()) if file.exists() else ()
    return {(line['column'], line['seed']): line for line in lines}


def report(found: dict[tuple[str, int], dict], columns: list[str], seeds: range) -> list[int]:
    """Print the results of the starts that are finished in all columns, and return the seeds of these starts."""
    done = [seed for seed in seeds if all((column, seed) in found for column in columns)]
    for column in columns if done else ():
        records = [found[column, seed] for seed in done]
        counts, lifted = Counter(each['end'] for each in records), [each for each in records if 'slid_mm' in each]
        held, parts = [each for each in lifted if each['end'] == 'held'], [[*each['parts']][-1] for each in lifted]
        low, high = (100 * limit for limit in binomtest(len(held), len(done)).proportion_ci(method='wilson'))
        drops = Counter(part for part, each in zip(parts, lifted) if each['end'] == 'dropped')
        print(f'{column}: {len(held)} of {len(done)} held ({low:.0f}-{high:.0f} %), '
              f'{", ".join(f"{counts[end]} {end}" for end in ENDS[1:])}; drops: {dict(drops)}')
        for name, values in {'force at the lift [N]': [each['at_lift'] for each in lifted],
                             'a held object slid [mm]': [each['slid_mm'] for each in held] or [np.nan]}.items():
            print(f'    {name}: {np.percentile(values, (5, 50, 95)).round(1)} (5, 50, 95 %)')
    return done


def compare(found: dict[tuple[str, int], dict], columns: list[str], done: list[int]) -> None:
    """Compare *hold* with *fixed* and *touch*, by exact McNemar tests with Holm's correction."""
    of_kind = {column.partition(':')[0]: column for column in columns}
    tests = []
    for rival in ('fixed', 'touch'):
        pairs = Counter(tuple(found[of_kind[kind], seed]['end'] == 'held' for kind in ('hold', rival)) for seed in done)
        only = pairs[True, False], pairs[False, True]
        tests.append((binomtest(only[0], sum(only)).pvalue if sum(only) else 1.0, rival, only))
    least = 0.0
    for number, (p, rival, only) in enumerate(sorted(tests)):
        least = min(1.0, max(least, (len(tests) - number) * p))
        level = 0.05 / len(tests)
        # if the same column alone holds n starts, p is 2 * 0.5**n
        needed = max(np.ceil(1 - np.log2(level)), float(norm.isf(level / 2) + norm.isf(0.2)) * sum(only)**0.5)
        shown = 100 * needed / len(done)
        print(f'only hold holds {only[0]}, only {rival} holds {only[1]}: p = {least:.2g} (exact McNemar, Holm); '
              f'differences below {shown:.0f} points would not show (power 80 %)')


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--columns', default='fixed:6,touch:6,hold:4,best', metavar='NAME:FORCE,...')
    parser.add_argument('--starts', type=int, default=300, help='number of starts (default: %(default)s)')
    parser.add_argument('--seed', type=int, default=0, help='first seed; tuning begins at 1000 (default: %(default)s)')
    parser.add_argument('--output', type=Path, default=ROOT / 'bench/unknown_starts.jsonl', metavar='FILE')
    args = parser.parse_args()
    columns, seeds, found = args.columns.split(','), range(args.seed, args.seed + args.starts), read(args.output)
    args.output.parent.mkdir(parents=True, exist_ok=True)
    with args.output.open('a', encoding='utf-8') as file:
        for seed in seeds:
            for column in columns:
                if (column, seed) not in found:
                    record = found[column, seed] = started(column, seed)
                    print(json.dumps(record), file=file, flush=True)
                    print(f'{seed} {column}: {record["end"]}', flush=True)
    done = report(found, columns, seeds)
    if done and {'fixed', 'touch', 'hold'} <= {column.partition(':')[0] for column in columns}:
        compare(found, columns, done)


if __name__ == '__main__':
    main()
