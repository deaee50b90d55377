"""Measure the error of the smallest rectangle around a contact, and the coverage of its 95 % intervals.

Run from the checkout: python bench/bench_box.py [--contacts 100] [--training]

The script prints one of the tables in docs/pose_results.md, measured with evaluation seeds. The option --training
selects the training seeds, with which the standard deviations were chosen.
"""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

import numpy as np

from bench.recognition import mechanics
from tactile_node import contact_box, find_contact
from tactile_node.contact.pattern import ContactPattern
from tactile_node.simulator.figures import Skin, named_silhouette, pressure_frame, random_figure, silhouette_of
from tactile_node.simulator.world import random_contact
from training.ground_truth.layer import measured, sample, stress_field
from training.ground_truth.seeds import Purpose, generator

AREAS = (12, 25, 50, 100)
SEED = 67_000_000
ANGLES = np.radians(np.arange(0, 90, 0.5))
SKIN = Skin(blur=0.5, noise=0.01, dead=0.02)
PUNCHES = {'circle': 0, 'square': 1, 'rectangle': 2, 'right triangle': 3, 'isosceles triangle': 4}
DOMES = {'ball': mechanics.random_ball, 'cylinder': mechanics.random_cylinder, 'cone': mechanics.random_cone}
GROUPS = {'circle, square, rectangle: punches': ('circle', 'square', 'rectangle'),
          'triangles: punches': ('right triangle', 'isosceles triangle'), 'balls, cylinders, cones': tuple(DOMES),
          'L': ('L',), 'ellipse': ('ellipse',),
          'rectangle, L, ellipse: on/off': ('rectangle, on/off', 'L, on/off', 'ellipse, on/off')}


class CoveredContact(NamedTuple):
    """A detected contact, and an (n, 2) array of points that the object really covers [pitches]."""

    pattern: ContactPattern
    places: np.ndarray


def oval(ratio: float):
    y, x = np.mgrid[-1:1:192j, -1:1:192j]
    return silhouette_of('ellipse', x * x + (ratio * y)**2 <= 0.9)


def drawn(rng: np.random.Generator, name: str, area: float) -> CoveredContact:
    """Return a touch by a figure with uniform pressure."""
    side = mechanics.side_of(area) + 4
    kind, on_off = name.lower().removesuffix(', on/off'), name.endswith('on/off')
    if kind == 'rectangle':
        touching = random_contact(rng, kind, area, side, side)
    else:
        touching = random_figure(rng, oval(rng.uniform(1.4, 2.5)) if kind == 'ellipse' else named_silhouette(kind),
                                 area, side, side)
    fine = np.arange(0, side, 0.05)
    x, y = np.meshgrid(fine, fine)
    inside = touching.depth(x, y) >= 0
    frame = touching.pattern(side, side) if on_off else pressure_frame(touching, rng, side, side, skin=SKIN)
    return CoveredContact(find_contact(frame), np.column_stack((x[inside], y[inside])))


def pressed(rng: np.random.Generator, name: str, area: float) -> CoveredContact:
    """Return a touch by an indenter on an elastic half-space, with the points of the computed contact as the truth."""
    indenter, tilt = (mechanics.random_punch(rng, PUNCHES[name]) if name in PUNCHES else DOMES[name](rng, 0))
    towards = rng.uniform(0, 2 * np.pi) if name in PUNCHES else 0.0
    solution = mechanics.solved(indenter, tilt, towards)
    side, angle = mechanics.side_of(area) + 4, rng.uniform(0, 2 * np.pi)
    x, y = (side - 1) / 2 + rng.uniform(-0.5, 0.5, 2)
    stress = sample(stress_field(solution, area, rng.uniform(*mechanics.DEPTH)), x, y, angle, side, side)
    values = measured(stress, rng.uniform(*mechanics.PRESSURE), rng, noise=mechanics.NOISE, dead=mechanics.DEAD)
    rows, cols = np.nonzero(solution.contact)
    places = np.column_stack((solution.origin[0] + cols * solution.cell, solution.origin[1] + rows * solution.cell))
    return CoveredContact(find_contact(values, unit=None), mechanics.turned(places * np.sqrt(area), angle) + (x, y))


def errors(touch: CoveredContact) -> np.ndarray:
    """Return the errors of both sides, x, y and angle, followed by their standard deviations and by the true sides."""
    box = contact_box(touch.pattern)
    cos, sin = np.cos(ANGLES), np.sin(ANGLES)
    along = touch.places @ np.stack((cos, sin)), touch.places @ np.stack((-sin, cos))
    low, high = np.array([each.min(0) for each in along]), np.array([each.max(0) for each in along])
    best = int((high - low).prod(0).argmin())
    quarters = round((box.angle - ANGLES[best]) / (np.pi / 2))
    sides = (high - low)[::-1 if quarters % 2 else 1, best]
    u, v = (high + low)[:, best] / 2
    centre = u * cos[best] - v * sin[best], u * sin[best] + v * cos[best]
    away = box.angle - ANGLES[best] - quarters * np.pi / 2
    return np.array((*np.subtract(box.lengths, sides), *np.subtract(box.centre, centre), away, *box.lengths_sd,
                     box.centre_sd, box.centre_sd, box.angle_sd, *sides))


def rows(count: int, purpose: Purpose) -> Iterator[list[str]]:
    for number, (group, names) in enumerate(GROUPS.items()):
        for area in AREAS:
            rng = generator(purpose, SEED + 10 * number + AREAS.index(area))
            touches = [(pressed if name in PUNCHES or name in DOMES else drawn)(rng, name, area)
                       for name in names for _ in range(count)]
            found = np.array([errors(touch) for touch in touches if touch.pattern.mask.any()])
            away, deviation, sides = found[:, :5], found[:, 5:10], found[:, 10:]
            inside = (np.abs(away) < 1.96 * deviation).mean(0)
            bias, spread = np.median(away[:, :2], 0), np.sqrt(np.square(away[:, :2]).mean(0))
            yield [group, str(area), *(f'{bias[k]:+.2f} ({np.median(away[:, k] / sides[:, k]):+.0%}), {spread[k]:.2f}'
                                       for k in (0, 1)),
                   f'{np.degrees(np.median(np.abs(away[:, 4]))):.1f}, {np.degrees(np.median(deviation[:, 4])):.0f}',
                   ' '.join(f'{share:.0%}' for share in (*inside[:2], inside[2:4].mean(), inside[4]))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--contacts', type=int, default=100,
                        help='number of contacts of each object and size, default %(default)s')
    parser.add_argument('--training', action='store_true', help='use the training seeds')
    args = parser.parse_args()
    print('| object | N | long: bias, rms | short | angle: error, deviation | in 95 %: long, short, centre, angle |')
    print('| --- | --- | --- | --- | --- | --- |')
    for row in rows(args.contacts, Purpose.TRAINING if args.training else Purpose.EVALUATION):
        print('| ' + ' | '.join(row) + ' |', flush=True)


if __name__ == '__main__':
    main()
