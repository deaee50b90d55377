"""Measure which touches a put-down detects, how hard the table is pressed, and how often nothing is called a touch.

Run from the checkout: nice python bench/bench_put_down.py [touches taken edge quiet shaken turning] --output FILE

Each result is appended to the file. A repeated call continues where the file ends, and prints the table of all results.

- touches: the hand lowers an object onto a table, and continues until the detected touch stops the arm.
- taken: the hand stops once the table carries the whole weight, so it never pushes the object onto the table.
- edge: the object meets the edge of a table beside the hand, and turns in the hand. The outline of the contact is
  fitted.
- quiet: the hand carries objects. No outline is fitted. Each left pad is then paired with each right pad, because the
  noise of both is independent, so that few simulated contacts make many minutes.
- turning: the same with a fitted outline, so that angles are known.
- shaken: the hand is shaken along the pads by 1 g at 5 to 15 Hz after the baseline, and the force varies by 20 %. Both
  pads are shaken alike, so they are not paired with others.
"""

import argparse
import json
import os
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import product
from pathlib import Path as File

for library in ('OPENBLAS', 'OMP', 'MKL'):
    os.environ[f'{library}_NUM_THREADS'] = '1'  # numpy reads these variables when it is imported
ROOT = File(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

import numpy as np
from event_world import KINDS, RATE, Path, shaken
from put_down_world import STIFFNESS, Descent, Hand

from tactile_node.grasp.tracker import GraspContact
from tactile_node.gripper.rules.put_down import HeldContact, HeldReading, PutDown, PutDownOutcome
from tactile_node.shape.methods import VisibilityGuard, make_recogniser
from training.ground_truth.seeds import Purpose, generator

WEIGHTS = (0.05, 0.1, 0.2, 0.3, 0.45)  #: Weights on each pad [normal force]; 0.05 is 50 g at 5 N.
SPEEDS = (0.002, 0.005, 0.01)          #: Speeds of the hand [m/s].
LEVERS = (0.01, 0.02, 0.04)            #: Distances of the table's edge from the grip [m].
MET = 2.0            #: Time at which the object meets the table [s].
AFTER = 1.5          #: Time for which a touch is simulated after the table carries the largest force [s].
LATENCY = 0.05       #: Age of a reading when the rules see it [s].
STOPPING = 0.1       #: Time from the result until the arm stands still [s].
MAX_AGE = 1.0        #: Age of a reading that the rules accept [s]; each reading is looked at when it is acquired.
SECONDS = 30.0       #: Duration of a carried object without a touch [s].
CARRIED = {'quiet': 12, 'turning': 4, 'shaken': 16}  #: Number of carried objects.
#: Increase this number by a million after each change that a result prompts, so that the next results use new seeds.
SEED = 91_000_000


def ends(readings: Iterable[HeldReading]) -> Iterator[tuple[float, PutDownOutcome, PutDown]]:
    """Yield the end of each goal. After an end, the next goal begins at once."""
    rules = None
    for reading in readings:
        rules = rules or PutDown(reading.acquired, np.inf, MAX_AGE)
        outcome = rules.look(reading.acquired, reading, is_resting=True)
        if outcome is not None:
            yield reading.acquired, outcome, rules
            rules = None


def touch(recogniser: VisibilityGuard, number: int, weight: float, speed: float, kind: str, pushes: bool,
          lever: float = 0.0) -> dict:
    """Return how the first goal of a descent ended."""
    rng = generator(Purpose.EVALUATION, SEED + 10_000 * pushes + 20_000 * (lever > 0) + number)
    descent = Descent(weight, speed, MET, pushes, lever)
    hand = Hand(rng, kind, recogniser, has_fit=lever > 0)
    seconds = MET + descent.most / (STIFFNESS * speed) + AFTER
    found = next(ends(hand.see(descent.path, seconds)), None)
    result = {'weight': weight, 'speed': speed, 'kind': kind, 'lever': lever}
    if found is None:
        return result | {'outcome': 'nothing'}
    end, outcome, rules = found
    stopped = end + LATENCY + STOPPING
    return result | {'outcome': outcome.name if end >= MET else f'{outcome.name} before', 'after': end - MET,
                     'signs': rules.signs.text, 'deviations': rules.deviations, 'most': descent.most,
                     'pressed': descent.pressed(stopped), 'turned': descent.path(stopped).get('turn', 0.0)}


def carried(recogniser: VisibilityGuard, what: str, number: int) -> dict:
    """Return the contacts on both pads while an object is carried for SECONDS."""
    rng = generator(Purpose.EVALUATION, SEED + 100_000 * (1 + list(CARRIED).index(what)) + number)
    weight, kind = float(rng.choice(WEIGHTS)), KINDS[number % len(KINDS)]
    hand = Hand(rng, kind, recogniser, has_fit=what == 'turning')
    swing = shaken(rng, weight)
    path: Path = (lambda now: swing(now) if now > MET else {'load': weight}) if what == 'shaken' else \
        (lambda now: {'load': weight})
    pads = [reading.pads for reading in hand.see(path, SECONDS)]
    return {'kind': kind, 'weight': weight, 'left': [left for left, _ in pads], 'right': [right for _, right in pads]}


def paired(left: list, right: list) -> Iterator[HeldReading]:
    """Yield the readings of two pads whose contacts were simulated."""
    for number, pads in enumerate(zip(left, right)):
        contacts = tuple(HeldContact(*contact) for contact in pads)
        yield HeldReading(number / RATE, GraspContact.TWO_SIDED, contacts, (number + 1, number + 1))


def jobs(what: str) -> list[tuple]:
    """Return the arguments of each measurement."""
    if what in CARRIED:
        return [(what, number) for number in range(CARRIED[what])]
    if what == 'edge':
        cases = product(WEIGHTS[2:3], SPEEDS[:1], KINDS, (True,), LEVERS)
        return [(number, *case) for number, case in enumerate(cases)]
    speeds, pushes = {'touches': (SPEEDS, True), 'taken': (SPEEDS[1:2], False)}[what]
    return [(number, *case, pushes) for number, case in enumerate(product(WEIGHTS, speeds, KINDS))]


def report(what: str, results: list[dict]) -> None:
    """Print the table of one kind of measurement."""
    if what in CARRIED:
        pairs = [(each, each) for each in results] if what == 'shaken' else list(product(results, results))
        found = [outcome.name for left, right in pairs for _, outcome, _ in ends(paired(left['left'], right['right']))]
        print(f'{what}: {len(pairs) * SECONDS / 60:g} min from {len(results)} objects, {Counter(found)}')
        return
    names = ('weight', 'speed', 'lever')
    for case in dict.fromkeys(tuple(each[name] for name in names) for each in results):
        of_case = [each for each in results if tuple(each[name] for name in names) == case]
        touched = [each for each in of_case if each['outcome'] == 'SOMETHING_TOUCHES']
        others = sorted(each['outcome'] for each in of_case if each not in touched)
        text = ''
        if touched:
            pressed, after, turned = ([each[name] for each in touched] for name in ('pressed', 'after', 'turned'))
            text = (f'after {np.median(after):.2f} s (most {max(after):.2f}), the table was pressed by '
                    f'{np.median(pressed):.1f} N (most {max(pressed):.1f} of {touched[0]["most"]:.1f}), the object had '
                    f'turned by {np.median(turned):.2f} rad (most {max(turned):.2f}), '
                    f'{dict(Counter(each["signs"] for each in touched))}')
        weight, speed, lever = case
        print(f'{what}: weight {weight:g}, {1e3 * speed:g} mm/s, lever {1e3 * lever:g} mm: '
              f'{len(touched)} of {len(of_case)} {text} {others}')


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('what', nargs='*', default=['touches', 'taken', 'edge', *CARRIED])
    parser.add_argument('--output', type=File, required=True, help='file of results, one JSON object in each line')
    parser.add_argument('--seconds', type=float, default=np.inf, help='time after which no measurement begins [s]')
    args = parser.parse_args()
    recogniser, end = make_recogniser(), time.monotonic() + args.seconds
    lines = args.output.read_text().splitlines() if args.output.exists() else []
    found = [json.loads(line) for line in lines]
    for what in args.what:
        done = [each['result'] for each in found if each['what'] == what]
        for job in jobs(what)[len(done):]:
            if time.monotonic() > end:
                break
            measure = carried if what in CARRIED else touch
            result = measure(recogniser, *job)
            done.append(result)
            with args.output.open('a') as file:
                file.write(json.dumps({'what': what, 'result': result}) + '\n')
        report(what, done)


if __name__ == '__main__':
    main()
