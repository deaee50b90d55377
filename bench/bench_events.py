"""Measure how far a contact moves before an event is reported, and count false reports; draw docs/events.png.

Run from the checkout: nice python bench/bench_events.py [slides turns quiet shaken] [--count 3] [--seconds 30]

The contacts are computed by contact mechanics. Each contact slides or turns at 0.5 to 100 mm/s in any direction, or is
held in place. During a hold, the force is constant or varies by 20 % at 5 to 15 Hz. The frames contain 1 % noise,
drift, mains hum at 50 Hz and 3 % dead taxels.

The script compares the events with a naive rule, which reports a movement when the centre of pressure of the raw values
has moved by more than a threshold. The threshold of the naive rule gives one false report in ten minutes of holding
with constant force, measured with training seeds.
"""

import argparse
import json
import os
import sys
from pathlib import Path

for library in ('OPENBLAS', 'OMP', 'MKL'):
    os.environ[f'{library}_NUM_THREADS'] = '1'  # numpy reads these variables when it is imported
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

import numpy as np
from event_world import BEFORE, KINDS, PITCH, RATE, Frame, Scene, moved, shaken, slide, turn

from tactile_node.pose.events import EventKind, SeenBy
from tactile_node.shape.methods import VisibilityGuard, make_recogniser
from training.ground_truth.seeds import Purpose, generator

SPEEDS = (0.5, 2.0, 10.0, 20.0, 50.0, 100.0)  #: Speeds of the contacts [mm/s].

#: Largest movement before a report, as promised in docs/events.md [pitches].
PROMISED = {'outline': 0.3, 'centre of pressure': 0.8, 'on/off': 1.5}
#: Length of a slide [pitches].
FAR = {'outline': 1.4, 'centre of pressure': 1.8, 'on/off': 2.4}
PROMISED_BY = dict(zip((SeenBy.OUTLINE, SeenBy.CENTRE_OF_PRESSURE, SeenBy.ON_OFF), PROMISED.values()))
#: Kinds of contacts whose rotation can be seen.
TURNS = tuple(kind for kind in KINDS if kind not in ('circle', 'ball', 'cone'))
MINUTES_OF_ONE = 10.0  #: The naive rule may make one false report in this holding time [min].

#: Increase this number by a million after each change that a report prompts, so that the next report uses new seeds.
SEED = 73_000_000
#: Movements before a report [pitches], by way of seeing the contact and by speed.
Found = dict[str, dict[str, list[float]]]
FOUND = ROOT / 'build/bench_events.json'


def reported_after(frames: list[Frame], kind: EventKind, radius: float = 0.0) -> tuple[float, SeenBy]:
    """Return the movement before the first event of ``kind`` [pitches], or inf, and how the event was seen."""
    for frame in frames:
        for event in frame.motion.events if frame.time >= BEFORE else ():
            if event.kind is kind:
                return moved(frame.place, radius), event.seen_by
    return np.inf, SeenBy.NOT_KNOWN


def naive_distances(frames: list[Frame]) -> np.ndarray:
    """Return how far the raw centre of pressure of each frame lies from the mean of the first frames [pitches]."""
    centres = np.array([frame.naive for frame in frames])
    return np.hypot(*(centres - centres[:15].mean(0)).T)


def naive_after(frames: list[Frame], threshold: float) -> float:
    """Return the movement before the naive rule reports it [pitches], or inf if the rule reports nothing."""
    for frame, distance in zip(frames, naive_distances(frames)):
        if frame.time >= BEFORE and distance > threshold:
            return moved(frame.place)
    return np.inf


def naive_threshold(recogniser: VisibilityGuard, seconds: float) -> float:
    """Return the threshold that gives one false report per MINUTES_OF_ONE in quiet holds with training seeds."""
    farthest = []
    for number, kind in enumerate(KINDS):
        rng = generator(Purpose.TRAINING, SEED + number)
        frames = Scene(rng, kind).follow(recogniser, lambda _: {}, seconds)
        farthest.append(naive_distances(frames).max())
    # number of holds in which the naive rule may make a false report
    most = int(len(KINDS) * seconds / 60 / MINUTES_OF_ONE)
    return float(np.sort(farthest)[::-1][most])


def measure(recogniser: VisibilityGuard, what: str, count: int, naive: float, only: list[str],
            speeds: list[float]) -> Found:
    """Print and return the movements before an event [pitches], for each way of seeing a contact and the naive rule."""
    found: Found = {}
    kinds, kind = (KINDS, EventKind.SLIDING) if what == 'slides' else (TURNS, EventKind.TURNING)
    # a centre of pressure cannot show a turn
    for way in [way for way in only if what == 'slides' or way != 'centre of pressure']:
        found[way] = {}
        for speed in speeds:
            row, ways, rule, in_time = SPEEDS.index(speed), [], [], []
            for number in range(count * len(kinds)):
                rng = generator(Purpose.EVALUATION, SEED + 1000 * row + number)
                scene = Scene(rng, kinds[number % len(kinds)], way)
                path, seconds = slide(rng, speed, FAR[way]) if what == 'slides' else \
                    turn(rng, speed, 1.3 * FAR[way], scene.radius)
                frames = scene.follow(recogniser, path, seconds)
                after, seen_by = reported_after(frames, kind, scene.radius)
                ways.append(after)
                rule.append(naive_after(frames, naive))
                in_time.append(after <= PROMISED_BY.get(seen_by, 0.0) + speed * 1e-3 / PITCH / RATE + 1e-9)
            median, most = np.quantile(ways, (0.5, 0.9), method='nearest')
            of_rule = np.quantile(rule, 0.5, method='nearest')
            print(f'{what} {way} {speed:g} mm/s: median {median:.2f}, 90 % {most:.2f} pitches, '
                  f'{1e3 * median * PITCH / speed:.3f} s; {sum(in_time)} of {len(ways)} within the promised movement '
                  f'plus one frame; naive {of_rule:.2f}', flush=True)
            found[way][str(speed)] = ways
            if way == 'outline':
                found.setdefault('naive rule', {})[str(speed)] = rule
    return found


def count_false(recogniser: VisibilityGuard, what: str, seconds: float, seed: int, only: list[str]) -> None:
    """Hold contacts of every kind, and print the number of false reports."""
    for way in only:
        kinds: list[str] = []
        for number, kind in enumerate(KINDS):
            rng = generator(Purpose.EVALUATION, SEED + 100_000 + 100 * seed + number)
            scene, path = Scene(rng, kind, way), shaken(rng) if what == 'shaken' else lambda _: {}
            frames = scene.follow(recogniser, path, seconds)
            kinds += [f'{kind} {event.kind.name}' for frame in frames for event in frame.motion.events]
        minutes = len(KINDS) * seconds / 60
        print(f'{what} {way}: {len(kinds)} false reports in {minutes:.1f} min, {60 * len(kinds) / minutes:.1f} per h '
              f'{kinds}', flush=True)


def draw(found: Found, file: Path) -> None:
    from matplotlib.figure import Figure
    figure = Figure(figsize=(6, 3.5), layout='constrained')
    axes = figure.subplots()
    for way in [way for way in (*PROMISED, 'naive rule') if way in found]:
        ways = np.sort(np.concatenate(list(found[way].values())))
        style = '-' if way in PROMISED else 'k:'
        axes.step(ways, (np.arange(len(ways)) + 1) / len(ways), style, where='post', label=way)
    axes.set(xlim=(0, 2.4), ylim=(0, 1.02), xlabel='movement [pitches]', ylabel='slides reported')
    axes.grid(alpha=0.3)
    axes.legend(loc='lower right')
    figure.savefig(file, dpi=110)
    print(file)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('what', nargs='*', default=['slides', 'turns', 'quiet', 'shaken'])
    parser.add_argument('--count', type=int, default=1, help='number of contacts per kind, way and speed')
    parser.add_argument('--seconds', type=float, default=30.0, help='duration of a hold [s]')
    parser.add_argument('--ways', nargs='*', default=list(PROMISED), choices=list(PROMISED),
                        help='ways of seeing a contact to measure in this run')
    parser.add_argument('--speeds', nargs='*', type=float, default=list(SPEEDS),
                        help='speeds to measure in this run [mm/s]')
    parser.add_argument('--seed', type=int, default=0, help='seed of the holds, where a new seed draws new holds')
    parser.add_argument('--output', type=Path, default=ROOT / 'docs/events.png')
    args = parser.parse_args()
    recogniser = make_recogniser()
    for what in args.what:
        if what in ('quiet', 'shaken'):
            count_false(recogniser, what, args.seconds, args.seed, args.ways)
            continue
        needs_rule = what == 'slides' and 'outline' in args.ways
        threshold = naive_threshold(recogniser, args.seconds) if needs_rule else np.inf
        found = measure(recogniser, what, args.count, threshold, args.ways, args.speeds)
        # a run may measure only one way of seeing the contact, so keep the results of earlier runs
        if what == 'slides':
            print(f'naive rule: {threshold:.2f} pitches')
            FOUND.parent.mkdir(exist_ok=True)
            before = json.loads(FOUND.read_text()) if FOUND.exists() else {}
            found = before | {way: before.get(way, {}) | of_speeds for way, of_speeds in found.items()}
            FOUND.write_text(json.dumps(found))
            draw(found, args.output)


if __name__ == '__main__':
    main()
