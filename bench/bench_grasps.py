"""Count successful grasps in a physics simulation for several ways of closing the gripper, each with the same starts.

Each item is displaced by up to 8 mm and turned by up to 15 degrees. A gripper closes on the item in one of the ways
defined in bench/grasp_columns.py, lifts it by 10 cm and shakes it with an acceleration of 1 g. At 1 g, the slippery
block needs a force of 4.9 N, and the fragile block breaks at 6 N. At 2 g, no single force would hold the slippery block
without breaking the fragile block. The gripper uses the same force for all items. The force for all items was chosen
with seeds from 1000 on, and the reported seeds begin at 0. The benchmark needs MuJoCo:

    make grasps                     # 100 starts for each column; each finished start is a line in
                                    # build/grasps/starts.jsonl, and a second run continues
    python bench/bench_grasps.py --report

The simulation and the nodes run in real time and use two cores. On a busy machine, the nodes receive frames too late
and stop the gripper.
"""

import argparse
import gc
import json
import os
import sys
import tempfile
import time
from contextlib import ExitStack
from itertools import combinations
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'examples'), str(ROOT / 'test'), str(Path(__file__).parent)]
os.environ.setdefault('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))

import numpy as np
from built_messages import built_messages
from scipy.stats import binomtest

from examples.simulated_gripper.items import ITEMS
from examples.simulated_gripper.world import Place, random_place
from tactile_node.learning.teach import Rate

FOLDER, COLUMNS = ROOT / 'build/grasps', ('blind', 'touch', 'shape', 'hold')
ENDS = ('held', 'dropped', 'broken', 'refused')  #: A start is refused if the planner gives up before the squeeze.


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--starts', type=int, default=10, help='number of starts per item (default: %(default)s)')
    parser.add_argument('--seed', type=int, default=0, help='first seed (default: %(default)s)')
    parser.add_argument('--items', default=','.join(ITEMS), metavar='NAME,...')
    parser.add_argument('--columns', default=','.join(COLUMNS), metavar='NAME,...')
    parser.add_argument('--output', type=Path, metavar='FILE')
    parser.add_argument('--report', action='store_true', help='report the finished starts')
    args = parser.parse_args()
    args.items, args.columns = args.items.split(','), args.columns.split(',')
    args.output = args.output or FOLDER / 'starts.jsonl'
    args.output.parent.mkdir(parents=True, exist_ok=True)
    if not args.report:
        with ExitStack() as stack:
            stack.enter_context(built_messages('control_msgs', ROOT / 'build/interfaces'))
            from grasp_session import started_rclpy
            stack.enter_context(started_rclpy())
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            run(args, folder / 'skin')
    report(read(args.output), args)


def start_of(name: str, seed: int) -> Place:
    """Return the random start place for an item and a seed."""
    return random_place(seed + 10_000 * [*ITEMS].index(name))


def read(file: Path) -> dict[tuple[str, str, int], dict]:
    lines = map(json.loads, file.read_text(encoding='utf-8').splitlines()) if file.exists() else ()
    return {(line['column'], line['item'], line['seed']): line for line in lines}


def run(args: argparse.Namespace, link: Path) -> None:
    from grasp_columns import grasped
    from grasp_session import HOLD, PARAMETERS, Session, WatchedWorld
    done = read(args.output)
    seeds = range(args.seed, args.seed + args.starts)
    todo = {(name, holds): [(seed, column) for seed in seeds for column in args.columns
                            if (column == 'hold') is holds and (column, name, seed) not in done]
            for name in args.items for holds in (False, True)}  # the column hold needs a session with other parameters
    left, began, finished = sum(map(len, todo.values())), time.monotonic(), 0
    for (name, holds), starts in todo.items():
        if not starts:
            continue
        world = WatchedWorld(ITEMS[name])
        with (Session(world, link, HOLD if holds else PARAMETERS) as session,
              args.output.open('a', encoding='utf-8') as file):
            gc.freeze()  # a full garbage collection would delay a sweep
            for seed, column in starts:
                record = grasped(session, column, ITEMS[name], start_of(name, seed))
                print(json.dumps({'column': column, 'item': name, 'seed': seed, **record}), file=file, flush=True)
                finished += 1
                minutes = (time.monotonic() - began) / finished * (left - finished) / 60
                print(f'{finished}/{left} {name} {seed} {column}: {record["end"]} {record.get("reason", "")} '
                      f'{record["seconds"]:.1f} s; {minutes:.0f} min left', flush=True)


def report(found: dict, args: argparse.Namespace) -> None:
    """Print the results of all starts that are finished in every column."""
    seeds = range(args.seed, args.seed + args.starts)
    starts = [(name, seed) for name in args.items for seed in seeds
              if all((column, name, seed) in found for column in args.columns)]
    if not starts:
        print('No start is finished in all columns.')
        return
    print(f'{len(starts)} starts; held (95 %); dropped, broken, refused\n{"":20}'
          + ''.join(f'{column:>34}' for column in args.columns))
    for name in (*args.items, 'all'):
        of_item = [start for start in starts if name in (start[0], 'all')]
        ends = [[sum(found[(column, *start)]['end'] == end for start in of_item) for end in ENDS]
                for column in args.columns]
        if of_item:
            print(f'{name:20}' + ''.join(f'{share(counts[0], len(of_item)):>18}'
                                         f'{", ".join(map(str, counts[1:])):>16}' for counts in ends))
    for first, second in combinations(args.columns, 2):
        pairs = [tuple(found[(column, *start)]['end'] == 'held' for column in (first, second)) for start in starts]
        print(comparison(first, second, pairs))
    for column in args.columns:
        _print_numbers(column, [found[(column, *start)] for start in starts])


def comparison(first: str, second: str, pairs: list[tuple[bool, ...]]) -> str:
    """Compare two columns; ``pairs`` contains for each start whether the item was held in the columns."""
    only = pairs.count((True, False)), pairs.count((False, True))
    p = binomtest(only[0], sum(only)).pvalue if sum(only) else 1.0
    return f'only {first} holds {only[0]}, only {second} holds {only[1]}: p = {p:.2g} (McNemar, exact)'


def share(count: int, total: int) -> str:
    low, high = Rate(count, total).interval
    return f'{count}/{total} ({100 * low:.0f}-{100 * high:.0f})'


def _print_numbers(column: str, records: list[dict]) -> None:
    values = {'largest force of a pad [N]': [max(each['peaks']) for each in records],
              'seconds': [each['seconds'] for each in records],
              'hand off the item along x after closing [mm]': [1e3 * abs(each['off'][0]) for each in records],
              'goals to close': [len(each.get('touches', ())) + len(each.get('ending', ())) for each in records],
              'moves': [len(each['moves']) for each in records if 'moves' in each]}
    beliefs = [each['belief'] for each in records if 'belief' in each]
    values |= {f'error of {key}': [each[key] for each in beliefs if key in each]
               for key in ('place_mm', 'size_mm', 'yaw_degrees')}
    print(f'{column}:')
    for name, numbers in values.items():
        if numbers:
            p50, p95 = np.percentile(numbers, (50, 95))
            print(f'    {name}: median {p50:.2f}, 95 % {p95:.2f}, most {max(numbers):.2f} ({len(numbers)})')
    for key, words in (('moved in the lift', [word for each in records for word in each.get('lift', ())]),
                       ('moved afterwards', [word for each in records for word in each.get('shaken', ())]),
                       ('class', [f'{each["item"]} {each["belief"]["class"]}' for each in records if 'belief' in each]),
                       ('gave up', [f'{each["item"]} {each["reason"]}' for each in records if 'reason' in each]),
                       ('left out by a busy machine', [each['item'] for each in records if each['left_out'] > 0])):
        counts = {word: words.count(word) for word in sorted(set(words)) if 'NOT_GIVEN_UP' not in word}
        if counts:
            print(f'    {key}: ' + ', '.join(f'{word} {count}' for word, count in counts.items()))


if __name__ == '__main__':
    main()
