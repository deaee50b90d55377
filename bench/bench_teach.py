"""Teach shapes from 30 touches, and measure the recognition of taught shapes, the five shapes and foreign objects.

    python bench/bench_teach.py [--quick]

The script is part of `make bench` and takes about ten minutes. The script teaches each shape separately: once from 30
touches of about 50 taxels on a simulated 16x16 skin, and once from 30 touches computed by contact mechanics. The script
then recognises new touches, contacts of the five shapes and the foreign figures of the recognition report, with and
without the taught shape. The contacts for this test were not used for teaching. Each new touch is a single frame. All
contacts are drawn with evaluation seeds. The constants of the teaching method were chosen with validation seeds.
"""

import argparse
import io
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import process_time

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np

from bench.recognition import foreign, mechanics
from bench.recognition.stamp import pressed
from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.learning.background import load_background
from tactile_node.learning.taught_file import examples_of, write_taught
from tactile_node.learning.teach import Rate, Taught, teach
from tactile_node.learning.touches import TouchFinder
from tactile_node.package_files import config_path
from tactile_node.shape.methods import VisibilityGuard, make_recogniser
from tactile_node.shape.recogniser import OUTPUTS, ShapeRecogniser, read_arrays
from tactile_node.shape.recognition import LEARNED, METHOD_FILES, Shape
from tactile_node.simulator.figures import (
    NAMED,
    Figure,
    Silhouette,
    Skin,
    named_silhouette,
    pressure_frame,
    random_figure,
)
from tactile_node.simulator.world import CLASSES, random_contact
from training.ground_truth.indenters import Indenter
from training.ground_truth.layer import measured, sample, stress_field
from training.ground_truth.seeds import Purpose, generator

SEED, TOUCHES, AREA, PAD = 77_000, 30, 50.0, 16
LOADS = (0, 0, 0.3, 0.8, 1, 1, 1, 1, 0.7, 0.2, 0)  #: Relative load in each frame of a touch.
FULL = (1,)
COUNTS = {'touches': 400, 'of each size': 500, 'mechanics': 120, 'foreign': 50}
SIZES = (25.0, 40.0, 50.0, 63.0, 100.0)
#: Families of foreign figures that have the same shape as a taught shape.
SAME = {'cross': ('cross',), 'l': ('L',), 'slot': ('ellipse',)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--quick', action='store_true', help='use a tenth of the contacts')
    parser.add_argument('--shapes', nargs='*', default=list(NAMED), choices=list(NAMED))
    args = parser.parse_args()
    counts = {name: max(count // (10 if args.quick else 1), 10) for name, count in COUNTS.items()}
    base, background = make_recogniser(), load_background('graded')
    five, figures = list(five_contacts(counts)), list(foreign_contacts(counts['foreign']))
    known = [base.recognise(pattern).shape.value for _, pattern in five]
    before = [base.recognise(pattern).shape for _, pattern in figures]
    print('| shape | touches from | held out while teaching | fresh touches, generator | fresh touches, mechanics | '
          'five: lost, all | five: lost, about 50 taxels | foreign called a shape: before | after | good enough |\n'
          + '| --- ' * 10 + '|')
    for number, name in enumerate(args.shapes):
        for world in (generated, computed):
            rng = generator(Purpose.EVALUATION, SEED + 10 * number + (world is computed))
            silhouette = named_silhouette(name)
            taught, own = taught_by(world, rng, silhouette, background)
            fresh = [Rate(sum(own.recognise(each).shape.value == name for each in patterns), len(patterns))
                     for patterns in (firm(generated(rng, silhouette, counts['touches'], FULL)),
                                      firm(computed(rng, silhouette, counts['mechanics'], FULL)))]
            after = [own.recognise(pattern).shape.value for _, pattern in five]
            lost = [(was == truth, now == truth, at) for ((truth, at), _), was, now in zip(five, known, after)]
            kept = [k for k, (family, _) in enumerate(figures) if family not in SAME.get(name, ())]
            now = [own.recognise(figures[k][1]).shape for k in kept]
            print(f'| {name} | {world.__name__} | {taught.held_out.taught[0]} | {fresh[0]} | {fresh[1]} | '
                  f'{loss(lost)} | {loss([each for each in lost if each[2]])} | '
                  f'{Rate(sum(before[k] is not Shape.UNKNOWN for k in kept), len(kept))} | '
                  f'{Rate(sum(shape is not Shape.UNKNOWN for shape in now), len(kept))} | '
                  f'{"yes" if taught.held_out.is_good else "no: refused"} |', flush=True)
    speed(base, own, [pattern for _, pattern in five[:1000]])


def taught_by(world, rng: np.random.Generator, silhouette: Silhouette, background) -> tuple[Taught, VisibilityGuard]:
    touches = TouchFinder(None).find(world(rng, silhouette, TOUCHES)).touches
    examples = examples_of(touches, rng)
    model = config_path(METHOD_FILES[LEARNED])
    taught = teach(ShapeRecogniser.from_file(model), background, [examples])
    written = io.BytesIO()
    write_taught(written, read_arrays(model), [silhouette.name], {'graded': taught.head})
    with tempfile.NamedTemporaryFile(suffix='.npz') as file:
        file.write(written.getbuffer())
        file.flush()
        return taught, make_recogniser(LEARNED, file.name)


def generated(rng: np.random.Generator, silhouette: Silhouette, count: int,
              loads: Sequence[float] = LOADS) -> Iterator[np.ndarray]:
    """Yield frames of touches from the generator, which draws blurred coverage with tilt and noise."""
    for _ in range(count):
        figure = random_figure(rng, silhouette, AREA * rng.uniform(0.95, 1.05), PAD, PAD)
        pressure, tilt, blur = rng.uniform(0.2, 0.8), rng.uniform(-0.03, 0.03, 2), rng.uniform(0.3, 0.7)
        for load in loads:
            yield pressure_frame(figure, rng, PAD, PAD, pressure=pressure * load, tilt=(tilt[0], tilt[1]),
                                 skin=Skin(full_scale=1.0, noise=0.01, blur=blur))


def computed(rng: np.random.Generator, silhouette: Silhouette, count: int,
             loads: Sequence[float] = LOADS) -> Iterator[np.ndarray]:
    """Yield frames of touches by one punch with a rounded edge at random tilts, computed by contact mechanics."""
    punch = punch_of(silhouette, compression=0.03, rounding=0.02)
    depth = rng.uniform(0.3, 0.7)
    solutions = [mechanics.solved(punch, rng.uniform(0, 0.3), rng.uniform(0, 2 * np.pi)) for _ in range(min(count, 30))]
    fields = [stress_field(solution, AREA, depth) for solution in solutions]
    for k in range(count):
        x, y = rng.uniform(-0.5, 0.5, 2) + (PAD - 1) / 2
        stress = sample(fields[k % len(fields)], x, y, rng.uniform(0, 2 * np.pi), PAD, PAD)
        pressure = rng.uniform(0.1, 0.8)
        for load in loads:
            yield measured(stress, pressure * load, rng, noise=0.01)


def punch_of(silhouette: Silhouette, compression: float, rounding: float) -> Indenter:
    """Return a prism with this silhouette and an area of 1, whose edge is rounded with the radius ``rounding``."""
    upright = Figure(silhouette, 1.0, x=0.0, y=0.0)
    rows, cols = (silhouette.distance > 0).nonzero()
    x, y = (cols - silhouette.middle[0]) * upright.cell, (rows - silhouette.middle[1]) * upright.cell

    def gap(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        depth = upright.depth(x, y)
        inset = np.clip(rounding - depth, 0, rounding)
        return np.where(depth < 0, np.inf, rounding - np.sqrt(rounding ** 2 - inset ** 2))
    low, high = (float(x.min()), float(y.min())), (float(x.max()), float(y.max()))
    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
    return Indenter('flat_punch', silhouette.name, compression, gap, low=low, high=high, outline=corners)


def firm(frames: Iterator[np.ndarray]) -> list[ContactPattern]:
    return [PatternExtractor().extract(values) for values in frames]


def five_contacts(counts: dict[str, int]) -> Iterator[tuple[tuple[str, bool], ContactPattern]]:
    """Yield ((shape, True if about 50 taxels), pattern) for contacts from the generator and from contact mechanics."""
    rng = generator(Purpose.EVALUATION, SEED + 9000)
    for area in SIZES:
        for k in range(counts['of each size'] * (2 if area == AREA else 1)):
            contact = random_contact(rng, CLASSES[k % len(CLASSES)], area, rows=24, cols=24)
            tilt = rng.uniform(-0.03, 0.03, 2)
            frame = pressure_frame(contact, rng, 24, 24, pressure=rng.uniform(0.2, 0.8), tilt=(tilt[0], tilt[1]),
                                   skin=Skin(full_scale=1.0, noise=0.01, blur=rng.uniform(0.3, 0.7), dead=0.01))
            yield (contact.shape, 40 <= area <= 63), PatternExtractor().extract(frame)
    for row, draw in enumerate(mechanics.ROWS.values()):
        case = mechanics.pressed(draw, AREA, counts['mechanics'], SEED + row)
        for frame, label in zip(case.frames, case.labels):
            yield (OUTPUTS[label].value, True), PatternExtractor().extract(frame)


def foreign_contacts(count: int) -> Iterator[tuple[str, ContactPattern]]:
    """Yield (family, pattern) for ``count`` figures of each foreign family, with 35 to 70 taxels."""
    for number, (family, drawing) in enumerate(foreign.FAMILIES.items()):
        rng = generator(Purpose.EVALUATION, SEED + 9100 + number)
        for stamp in foreign.bank(rng, family, drawing, count):
            frame = pressed(stamp, rng, float(np.exp(rng.uniform(*np.log((35, 70))))), False)
            yield family, PatternExtractor().extract(frame)


def loss(cases: list[tuple[bool, bool, bool]]) -> str:
    """Return the drop in the recognition rate of the five shapes, in percentage points, and the rate before."""
    was, now = (np.mean([each[k] for each in cases]) for k in (0, 1))
    return f'{100 * (was - now):.2f} of {100 * was:.1f} %'


def speed(base: VisibilityGuard, own: VisibilityGuard, patterns: list[ContactPattern]) -> None:
    costs = []
    for _ in range(3):
        for method in (base, own):
            begun = process_time()
            for pattern in patterns:
                method.recognise(pattern)
            costs.append((process_time() - begun) / len(patterns) * 1e6)
    plain, taught = min(costs[::2]), min(costs[1::2])
    print(f'\nOne recognition: {plain:.0f} us, with a taught shape {taught:.0f} us, {taught / plain:.2f} times.')


if __name__ == '__main__':
    main()
