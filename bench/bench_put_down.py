"""Measure which touches a put-down detects, how hard the table is pressed, and how often nothing is called a touch.

Run from the checkout: nice python bench/bench_put_down.py [touches taken edge rivals quiet shaken turning]
    --output FILE

Each result is appended to the file. A repeated call continues where the file ends, and prints the table of all results.

- touches: the hand lowers an object onto a table, and continues until the detected touch stops the arm.
- taken: the hand stops once the table carries the whole weight, so it never pushes the object onto the table.
- edge: the object meets the edge of a table beside the hand, and turns in the hand. The outline of the contact is
  fitted.
- rivals: the hand lowers an object onto a table whose height is known to 30 mm, and stops in each of the COLUMNS.
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
from scipy.stats import binomtest
from wrist_sensor import HIGHEST, NOISES, duration, errors, false_touches, met_at, reading_times, tuned

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
WITNESSED = 0.5      #: Longest time between the two signals of the column *both* [s], as in examples/put_down.py.
AIR_MINUTES = 60.0   #: Time in the air in which the false touches of the wrist are counted [min].
#: Ways to stop the arm. After each other ending of a goal than a touch, *touch*, *example* and *both* stop the arm.
COLUMNS = {
    'blind': 'stops and opens at the expected height of the table',
    **{f'wrist {noise:g} N': 'stops and opens when a wrist sensor with this noise detects the table'
       for noise in NOISES},
    'touch': 'stops and opens when the goal ends as SOMETHING_TOUCHES',
    'example': 'stops as touch, and opens if the first wrist sensor detects the table within WITNESSED of the touch',
    'both': 'stops at the first of the two signals, and opens if the other one follows within WITNESSED',
    'first': 'stops and opens at the first of the two signals',
}
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
                     'signs': rules.touch.signs.text, 'deviations': rules.touch.deviations, 'most': descent.most,
                     'pressed': descent.pressed(stopped), 'turned': descent.path(stopped).get('turn', 0.0)}


def compared(recogniser: VisibilityGuard, number: int, weight: float, speed: float, kind: str) -> dict:
    """Return how each column ended in the same descent onto a table at a random height."""
    rng, lowest = generator(Purpose.EVALUATION, SEED + 50_000 + number), duration(speed)
    height = rng.uniform(-HIGHEST, HIGHEST)
    descent = Descent(weight, speed, met_at(height, speed), pushes=True)
    error, times = {noise: errors(rng, 1, speed, noise)[0] for noise in NOISES}, reading_times(speed)

    def wrist(noise: float = NOISES[0], stopped: float = np.inf) -> np.ndarray:
        """Return the times at which the wrist begins to feel the table if the arm stands still from ``stopped`` on."""
        rule = tuned(speed, STOPPING, WEIGHTS, noise)
        feels = rule.exceeded(error[noise] + descent.pressed(np.minimum(times, stopped)))
        return times[1:][feels[1:] & ~feels[:-1]]

    def pads(until: float, stopped: float = np.inf) -> tuple[float, str]:
        """Return the time at which the planner receives the result, and the outcome."""
        hand = Hand(generator(Purpose.EVALUATION, SEED + 60_000 + number), kind, recogniser)
        found = next(ends(hand.see(lambda time: descent.path(min(time, stopped)), until)), None)
        return (found[0] + LATENCY, found[1].name) if found else (np.inf, 'nothing')

    def agrees(result: float, outcome: str, stopped: float) -> bool:
        """Return True if the goal ended with a touch and the wrist began to feel the table at about the same time."""
        near = np.abs(wrist(stopped=stopped) - result) <= WITNESSED
        return outcome == PutDownOutcome.SOMETHING_TOUCHES.name and bool(near.any())

    felt = {noise: min(wrist(noise), default=np.inf) for noise in NOISES}
    earliest, (result, outcome) = felt[NOISES[0]], pads(lowest)
    is_touch = outcome == PutDownOutcome.SOMETHING_TOUCHES.name
    first = min(earliest, result) + STOPPING
    second = (result, outcome) if result <= earliest else pads(earliest + WITNESSED, first)
    stops = {'blind': (met_at(0.0, speed), True),
             **{f'wrist {noise:g} N': (felt[noise] + STOPPING, True) for noise in NOISES},
             'touch': (result + STOPPING, is_touch),
             'example': (result + STOPPING, agrees(result, outcome, result + STOPPING)),
             'both': (first, agrees(*second, first)),
             'first': (min(earliest, result if is_touch else np.inf) + STOPPING, True)}
    return {'weight': weight, 'speed': speed, 'kind': kind, 'height': height, 'outcome': outcome, 'columns': {
        column: {'opened': bool(opens and time < lowest), 'above': max(0.0, descent.met - min(time, lowest)) * speed,
                 'pressed': descent.pressed(min(time, lowest))} for column, (time, opens) in stops.items()}}


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
    speeds = {'touches': SPEEDS, 'taken': SPEEDS[1:2], 'rivals': SPEEDS[:2]}[what]
    pushes = {'touches': (True,), 'taken': (False,), 'rivals': ()}[what]
    return [(number, *case, *pushes) for number, case in enumerate(product(WEIGHTS, speeds, KINDS))]


def report(what: str, results: list[dict]) -> None:
    """Print the table of one kind of measurement."""
    if what in CARRIED:
        pairs = [(each, each) for each in results] if what == 'shaken' else list(product(results, results))
        found = [outcome.name for left, right in pairs for _, outcome, _ in ends(paired(left['left'], right['right']))]
        print(f'{what}: {len(pairs) * SECONDS / 60:g} min from {len(results)} objects, {Counter(found)}')
        return
    if what == 'rivals':
        for speed in dict.fromkeys(each['speed'] for each in results):
            report_rivals(speed, [each for each in results if each['speed'] == speed])
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


def report_rivals(speed: float, starts: list[dict]) -> None:
    """Print how the columns ended at one speed, and the false touches of the wrist."""
    print(f'{1e3 * speed:g} mm/s, {len(starts)} starts, {dict(Counter(each["outcome"] for each in starts))}')
    for noise in NOISES:
        rule, rng = tuned(speed, STOPPING, WEIGHTS, noise), generator(Purpose.EVALUATION, SEED + 70_000)
        false = false_touches(rule, rng, AIR_MINUTES, speed, noise)
        print(f'wrist {noise:g} N: mean over {rule.window:g} s above {rule.threshold:.1f} N, '
              f'{false} false touches in {AIR_MINUTES:g} min')
    for column, meaning in COLUMNS.items():
        records = [each['columns'][column] for each in starts]
        drops = [1e3 * each['above'] for each in records if each['opened'] and each['above'] > 0]
        placed = sum(each['opened'] and each['above'] == 0 for each in records)
        low, high = (100 * limit for limit in binomtest(placed, len(records)).proportion_ci(method='wilson'))
        pressed = [each['pressed'] for each in records if each['above'] == 0]
        print(f'{column} ({meaning}): opened on the table {placed} ({low:.0f}-{high:.0f} %), '
              f'in the air {len(drops)}, not at all {len(records) - placed - len(drops)}; '
              f'drop {np.median(drops or [np.nan]):.1f} mm (most {max(drops, default=np.nan):.1f}); '
              f'{len(pressed)} pressed the table by {np.median(pressed):.1f} N (most {max(pressed):.1f})')


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('what', nargs='*', default=['touches', 'taken', 'edge', 'rivals', *CARRIED])
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
            measure = carried if what in CARRIED else compared if what == 'rivals' else touch
            result = measure(recogniser, *job)
            done.append(result)
            with args.output.open('a') as file:
                file.write(json.dumps({'what': what, 'result': result}) + '\n')
        report(what, done)


if __name__ == '__main__':
    main()
