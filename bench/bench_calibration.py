"""Measure the errors of fitted sizes on skins of unknown response, with and without calibration on a known disc.

Run `make bench`, or: python bench/bench_calibration.py [--count 60] [--validation] [--edges]

The calibration uses the same search as `tactile calibrate`. Rigid punches press an elastic half-space. The skins differ
in the depth of their taxels and in the curve that converts pressure to a reading.

The option --edges prints how much the rounding of an object's edge changes its fitted size. For this reason, a
calibration must know the rounding of its disc.
"""

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault('OMP_NUM_THREADS', '1')
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

import numpy as np
from pose_mechanics import AREAS, Outlined, PoseSkin, Row, error_of, measure, outlined, pressed

from bench.recognition import mechanics
from tactile_node.learning.presses import PressFinder
from tactile_node.learning.response_fit import Disc, FoundResponse, calibrate
from tactile_node.learning.touches import Touch, TouchFrame
from tactile_node.pose.fit import fit_shape
from tactile_node.simulator.world import Contact
from training.ground_truth.indenters import flat_punch
from training.ground_truth.mechanics import Solution, solve
from training.ground_truth.seeds import Purpose, generator

SEED = 70_000_000
PITCH = 0.002  #: Pitch of the calibrated skin [m]. All other lengths are in pitches.
DEPTHS = (0.35, 0.8)  #: Depths of the taxels [pitches].

#: Curves that convert pressure to a reading, both as fractions of full scale.
CURVES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    'proportional': lambda p: p, 'power 0.6': lambda p: p ** 0.6, 'power 1.3': lambda p: p ** 1.3,
    'saturating': lambda p: 1.4 * p / (p + 0.4)}
KNOWN_AREA = 120.0  #: Area of the known disc [taxels].
SHARP = 0.02        #: Rounding of the known disc's edge, as a fraction of its radius.
PRESSES = 10        #: Number of places where the known disc presses the skin.
LEVELS = 4          #: Number of pressures applied at each place.
PUNCHES = 20        #: Number of punches whose sizes are fitted.
ROUNDINGS = (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.25)

Objects = list[tuple[Solution, Outlined]]


def known_disc(rounding: float) -> tuple[Solution, Outlined]:
    radius = 1 / np.sqrt(np.pi)
    solution = solve(flat_punch(Contact('circle', (radius,), 0.0, 0.0), 0.03, rounding), cells=mechanics.CELLS)
    return solution, outlined(solution)


def other_objects(rng: np.random.Generator) -> Objects:
    """Return punches of the five classes with random edges and tilts, drawn as in the other benchmarks."""
    found = []
    for number in range(PUNCHES):
        indenter, tilt = mechanics.random_punch(rng, number)
        solution = mechanics.solved(indenter, tilt, rng.uniform(0, 2 * np.pi))
        found.append((solution, outlined(solution)))
    return found


def calibrated(rng: np.random.Generator, skin: PoseSkin) -> FoundResponse:
    """Calibrate the skin with light and firm presses of the known disc. The depth of the response is in pitches."""
    solution, outline = known_disc(SHARP)
    presses = []
    while len(presses) < PRESSES:
        frames = [pressed(rng, solution, outline, KNOWN_AREA, skin) for _ in range(LEVELS)]
        usable = [TouchFrame.of(frame.values, frame.mask) for frame in frames
                  if frame.mask.sum() >= PressFinder.least_taxels]
        if usable:
            presses.append(Touch(tuple(usable)))
    radius = PITCH * float(np.sqrt(KNOWN_AREA / np.pi))
    found = calibrate(presses, Disc(radius, SHARP * radius), PITCH, '')
    layer = found.response.layer
    in_pitches = layer._replace(depth=layer.depth / PITCH)
    return found._replace(response=found.response._replace(layer=in_pitches))


def report(count: int, purpose: Purpose) -> None:
    """Print a row for each skin and contact size, with the results before and after the calibration."""
    print('| depth | readings | N | bias % | spread % | in the 95 % region | found: exponent, depth |')
    print('| --- | --- | --- | --- | --- | --- | --- |')
    others = other_objects(generator(purpose, SEED))
    for number, (depth, (name, curve)) in enumerate((d, c) for d in DEPTHS for c in CURVES.items()):
        rng, skin = generator(purpose, SEED + 1 + number), PoseSkin(depth, curve)
        found = calibrated(rng, skin)
        for area in AREAS:
            frames = [pressed(rng, *others[k % PUNCHES], area, skin) for k in range(count)]
            before, after = (measure(name, area, frames, response) for response in (None, found.response))
            print(f'| {depth:g} | {name} | {area:g} | {_both(before, after, "bias", "+.2f")} '
                  f'| {_both(before, after, "spread", ".2f")} | {before.inside.mean():.0%} -> '
                  f'{after.inside.mean():.0%} '
                  f'| {found.exponent:.2f}, {found.response.layer.depth:.2f} |', flush=True)


def _both(before: Row, after: Row, name: str, form: str) -> str:
    return ' -> '.join(format(getattr(row, name), form) for row in (before, after))


def edges(count: int, purpose: Purpose) -> None:
    """For each edge rounding, print the percentage by which the fitted circles are too large."""
    print('| edge radius / radius | radius too large by [%] at depths of 0.3, 0.6, 1.0 pitches |')
    print('| --- | --- |')
    for number, rounding in enumerate(ROUNDINGS):
        solution, outline = known_disc(rounding)
        rng, biases = generator(purpose, SEED + 100 + number), []
        for depth in (0.3, 0.6, 1.0):
            frames = [pressed(rng, solution, outline, KNOWN_AREA, PoseSkin(depth, lambda p: p)) for _ in range(count)]
            fits = [(fit_shape(frame.values, frame.mask, frame.shape), frame.truth) for frame in frames
                    if frame.mask.any()]
            biases.append(np.median([error_of(fit, truth).vector[-1] / truth[-1] for fit, truth in fits]))
        print(f'| {rounding:g} | ' + ', '.join(f'{100 * bias:+.2f}' for bias in biases) + ' |', flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--count', type=int, default=60, help='number of frames per skin and size')
    parser.add_argument('--validation', action='store_true', help='use seeds that are never reported')
    parser.add_argument('--edges', action='store_true', help='measure only the edge rounding, with validation seeds')
    args = parser.parse_args()
    if args.edges:
        edges(args.count, Purpose.VALIDATION)
    else:
        report(args.count, Purpose.VALIDATION if args.validation else Purpose.EVALUATION)


if __name__ == '__main__':
    main()
