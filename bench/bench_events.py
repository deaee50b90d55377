"""Measure how far a contact moves before an event is reported, and count false reports; draw docs/events.png.

Run from the checkout: nice python bench/bench_events.py [slides turns quiet shaken lifts swung] [--count 3]

The contacts are computed by contact mechanics. Each contact slides or turns at 0.5 to 100 mm/s in any direction, or is
held in place. During a hold, the force is constant or varies by 20 % at 5 to 15 Hz. The frames contain 1 % noise,
drift, mains hum at 50 Hz and 3 % dead taxels. For a slide, the script measures when the movement is first reported,
whether as a shift or as a slide.

In a lift, a load along the pad rises on an elastic layer to which the contact sticks, and then the contact slides. A
contact that is swung is shaken along the pad too, by its own weight. The same measurements are followed by three rules.
The first rule calls each movement a slide. The second rule allows for the shift in any skin. The third rule knows the
skin: the parameter shift_per_load is 1.3 times the true value.
"""

import argparse
import os
import sys
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

for library in ('OPENBLAS', 'OMP', 'MKL'):
    os.environ[f'{library}_NUM_THREADS'] = '1'  # numpy reads these variables when it is imported
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

import numpy as np
from event_world import (
    BEFORE,
    KINDS,
    PITCH,
    RATE,
    Frame,
    Scene,
    Sighting,
    followed,
    lift,
    moved,
    random_skin,
    shaken,
    slide,
    turn,
)

from tactile_node.pose.events import EventKind, Moving
from tactile_node.pose.motion import LARGEST_LOAD, SHIFT_OF_EXTENT, SHIFT_PER_LOAD
from tactile_node.shape.methods import VisibilityGuard, make_recogniser
from training.ground_truth.seeds import Purpose, generator

SPEEDS = (0.5, 2.0, 10.0, 20.0, 50.0, 100.0)  #: Speeds of the contacts [mm/s].

#: Largest movement before a report, as promised in docs/events.md [pitches].
PROMISED = {'outline': 0.3, 'centre of pressure': 0.8, 'on/off': 1.5}
#: Length of a slide [pitches].
FAR = {'outline': 1.4, 'centre of pressure': 1.8, 'on/off': 2.4}
#: Largest movement beyond the largest shift before a slide is reported, as promised in docs/events.md [pitches].
PROMISED_SLIDE = PROMISED | {'outline': 0.4}
FAR_LIFTED = 3.2                         #: Length of a slide after a lift [pitches].
LIFTED_SPEEDS = (2.0, 10.0, 20.0, 50.0)  #: Speeds of the slides after a lift [mm/s].
#: Kinds of contacts that are lifted.
LIFTED = tuple(kind for kind in KINDS if kind != 'cone')
#: The true shift multiplied by this factor is the parameter shift_per_load of the third rule.
CALIBRATED = 1.3
#: A shift_per_load so small that each movement is a slide [m].
NO_ALLOWANCE = 1e-6
#: Load of a swung object at rest along the pad [normal force].
WEIGHTS = (0.1, 0.25)
RULES = ('each movement', 'any skin', 'known skin')
FALSE = EventKind.SLIDING, EventKind.TURNING  #: Events that a lift must not cause.
#: Kinds of contacts whose rotation can be seen.
TURNS = tuple(kind for kind in KINDS if kind not in ('circle', 'ball', 'cone'))

#: Increase this number by a million after each change that a report prompts, so that the next report uses new seeds.
SEED = 75_000_000


class Lifted(NamedTuple):
    """The reports of one contact that is lifted and then slides, one for each rule."""

    way: str
    is_false: list[list[bool]]  #: for each ramp of the load, True if it was reported as a slide or a turn
    slid: list[float]           #: distance that the contact had slid when the slide was reported [pitches]
    in_time: list[bool]         #: True if the slide was reported within the promised distance plus one frame


def reported_after(frames: list[Frame], kinds: Moving, radius: float = 0.0) -> tuple[float, Moving]:
    """Return the movement before one of ``kinds`` was first reported [pitches], or inf, and the reported flags."""
    for frame in frames:
        if frame.time >= BEFORE and frame.motion.moving & kinds:
            return moved(frame.place, radius), frame.motion.moving
    return np.inf, Moving.NOT_KNOWN


def measure(recogniser: VisibilityGuard, what: str, count: int, only: list[str], speeds: list[float]) -> None:
    """Print how far a contact moved before its movement was reported, for each way of seeing a contact."""
    is_slide = what == 'slides'
    kinds, flags = (KINDS, Moving.SHIFTING | Moving.SLIDING) if is_slide else (TURNS, Moving.TURNING)
    # a centre of pressure cannot show a turn
    for way in [way for way in only if is_slide or way != 'centre of pressure']:
        for speed in speeds:
            row, ways, frame_step = SPEEDS.index(speed), [], speed * 1e-3 / PITCH / RATE
            for number in range(count * len(kinds)):
                rng = generator(Purpose.EVALUATION, SEED + 1000 * row + number)
                scene = Scene(rng, kinds[number % len(kinds)], way)
                path, seconds = slide(rng, speed, FAR[way]) if is_slide else \
                    turn(rng, speed, 1.3 * FAR[way], scene.radius)
                ways.append(reported_after(scene.follow(recogniser, path, seconds), flags, scene.radius)[0])
            in_time = sum(after <= PROMISED[way] + frame_step + 1e-9 for after in ways)
            median, most = np.quantile(ways, (0.5, 0.9), method='nearest')
            print(f'{what} {way} {speed:g} mm/s: median {median:.2f}, 90 % {most:.2f} pitches, '
                  f'{1e3 * median * PITCH / speed:.3f} s; {in_time} of {len(ways)} within the promised movement '
                  f'plus one frame', flush=True)


def lifted(recogniser: VisibilityGuard, way: str, number: int) -> Lifted:
    """Return the reports of one contact that is lifted and then slides."""
    rng = generator(Purpose.EVALUATION, SEED + 200_000 + 1000 * list(PROMISED).index(way) + number)
    scene = Scene(rng, LIFTED[number % len(LIFTED)], way, skin=random_skin(rng))
    speed = LIFTED_SPEEDS[number % len(LIFTED_SPEEDS)]
    path, seconds, begins = lift(rng, scene, speed, FAR_LIFTED)
    return reports_of(way, scene.see(recogniser, path, seconds), begins, scene.shift_per_load(LARGEST_LOAD), speed)


def reports_of(way: str, seen: list[Sighting], begins: tuple[float, ...], true_shift: float, speed: float) -> Lifted:
    """Return the reports of all rules for the same measurements.

    Parameters
    ----------
    way : str
        Way of seeing the contact.
    seen : list of Sighting
        The measurements.
    begins : tuple of float
        Times at which the ramps of the load and the slide begin [s].
    true_shift : float
        True shift per load [m].
    speed : float
        Speed of the slide [mm/s].
    """
    is_false, slid, in_time = [], [], []
    mask = next(each.sight.pattern.mask for each in seen if each.time >= begins[-1])
    extent = max(np.count_nonzero(mask.any(axis)) for axis in (0, 1))  # [pitches]
    for parameter in (NO_ALLOWANCE, SHIFT_PER_LOAD, CALIBRATED * true_shift):
        frames = followed(seen, parameter)
        times = [frame.time for frame in frames for event in frame.motion.events if event.kind in FALSE]
        is_false.append([any(begin <= time < end for time in times) for begin, end in pairwise(begins)])
        slides = [moved(frame.place) for frame in frames
                  if frame.time > begins[-1] and frame.motion.moving & Moving.SLIDING]
        slid.append(min(slides, default=np.inf))
        largest_shift = min(SHIFT_OF_EXTENT * extent, LARGEST_LOAD * parameter / PITCH)
        in_time.append(slid[-1] <= largest_shift + PROMISED_SLIDE[way] + speed * 1e-3 / PITCH / RATE + 1e-9)
    return Lifted(way, is_false, slid, in_time)


def report_lifts(found: list[Lifted], file: Path) -> None:
    """Print the false reports and the distances of the slides, and draw them."""
    for way in dict.fromkeys(each.way for each in found):
        of_way = [each for each in found if each.way == way]
        for number, rule in enumerate(RULES):
            slid = [each.slid[number] for each in of_way]
            median, most = np.quantile(slid, (0.5, 0.9), method='nearest')
            false = np.concatenate([each.is_false[number] for each in of_way])
            in_time = sum(each.in_time[number] for each in of_way)
            print(f'lifts {way}, {rule}: {false.sum()} of {len(false)} ramps reported as a slide or a turn; '
                  f'slides reported after {median:.2f} (median), {most:.2f} (90 %) pitches, {in_time} of {len(slid)} '
                  f'within the promised distance plus one frame', flush=True)
    from matplotlib.figure import Figure
    figure = Figure(figsize=(8, 3.5), layout='constrained')
    left, right = figure.subplots(1, 2)
    names = list(dict.fromkeys(each.way for each in found))
    for number, rule in enumerate(RULES):
        shares = [np.mean([each.is_false[number] for each in found if each.way == way]) for way in names]
        left.bar(np.arange(len(names)) + 0.27 * (number - 1), shares, 0.25, label=rule)
        slid = np.sort([each.slid[number] for each in found])
        right.step(slid, (np.arange(len(slid)) + 1) / len(slid), where='post', label=rule)
    left.set(xticks=range(len(names)), xticklabels=names, ylim=(0, 1.02), ylabel='loads reported as a slide or a turn')
    right.set(xlim=(0, FAR_LIFTED), ylim=(0, 1.02), xlabel='distance of the slide [pitches]', ylabel='slides reported')
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend()
    figure.savefig(file, dpi=110)
    print(file)


def count_false(recogniser: VisibilityGuard, what: str, seconds: float, seed: int, only: list[str]) -> None:
    """Hold contacts of every kind, and print the number of false reports."""
    for way in only:
        kinds: list[str] = []
        for number, kind in enumerate(KINDS):
            rng = generator(Purpose.EVALUATION, SEED + 100_000 + 100 * seed + number)
            is_swung = what == 'swung'
            scene = Scene(rng, kind, way, skin=random_skin(rng) if is_swung else None)
            path = {'quiet': lambda _: {}, 'shaken': shaken(rng), 'swung': shaken(rng, rng.uniform(*WEIGHTS))}[what]
            frames = scene.follow(recogniser, path, seconds)
            kinds += [f'{kind} {event.kind.name}' for frame in frames for event in frame.motion.events
                      if event.kind in FALSE]
        minutes = len(KINDS) * seconds / 60
        print(f'{what} {way}: {len(kinds)} false reports in {minutes:.1f} min, {60 * len(kinds) / minutes:.1f} per h '
              f'{kinds}', flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('what', nargs='*', default=['slides', 'turns', 'quiet', 'shaken', 'lifts', 'swung'])
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
        if what in ('quiet', 'shaken', 'swung'):
            count_false(recogniser, what, args.seconds, args.seed, args.ways)
        elif what == 'lifts':
            report_lifts([lifted(recogniser, way, number) for way in args.ways
                          for number in range(args.count * len(LIFTED))], args.output)
        else:
            measure(recogniser, what, args.count, args.ways, args.speeds)


if __name__ == '__main__':
    main()
