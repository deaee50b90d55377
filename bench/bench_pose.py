"""Pose, size, their covariance, fusion: how good and how fast, beside simple alternatives, in one run.

Run from the checkout: python bench/bench_pose.py [--patterns 200] [--calibrate]
Writes docs/pose_results.md. ``--calibrate`` instead prints the factors of tactile_node/pose/model_error.py, found on
training seeds; everything else here is measured on evaluation seeds.
"""

import argparse
import os
import sys
import textwrap
from pathlib import Path
from time import process_time

for library in ('OPENBLAS', 'OMP', 'MKL'):
    os.environ[f'{library}_NUM_THREADS'] = '1'  # read when numpy is imported
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

import numpy as np
import pose_fusion
import pose_mechanics
from pose_world import CONDITIONS, by_moments, by_rectangle, draw, error, same_handedness
from scipy.stats import binom, chi2

from bench.recognition.figures import rate_of
from tactile_node.pose.fit import fit_shape
from tactile_node.pose.moments import contact_moments
from tactile_node.pose.outlines import OUTLINES
from tactile_node.shape.recognition import Shape
from tactile_node.simulator.world import CLASSES
from training.ground_truth.seeds import Purpose, generator

AREA = 50
AREAS = (12, 20, 35, 50, 100)
TARGETS = {'centre': 0.05, 'angle': 1.5, 'length': 2.0}  # medians at N = 50 on clean pressure frames
SEED = 5
COLUMNS = 120


class Report:
    """Lines that go to the terminal and into the page."""

    def __init__(self):
        self.lines: list[str] = []

    def say(self, line: str = '') -> None:
        print(line, flush=True)
        self.lines += [line] if line.startswith('|') else textwrap.wrap(line, COLUMNS) or ['']

    def table(self, head: list[str], rows: list[list[str]]) -> None:
        for row in (head, ['---'] * len(head), *rows):
            self.say('| ' + ' | '.join(row) + ' |')
        self.say()


class Fitted:
    """All fits of one shape under one condition."""

    def __init__(self, shape: str, condition: str, area: float, count: int, purpose: Purpose):
        rng = generator(purpose, SEED * 1000 + list(CONDITIONS).index(condition) * 100
                        + CLASSES.index(shape) * 10 + AREAS.index(area))
        self.shape = shape
        self.samples = [draw(rng, shape, area, CONDITIONS[condition]) for _ in range(count)]
        self.fits, self.times = [], []
        for sample in self.samples:
            begin = process_time()
            self.fits.append(fit_shape(sample.values, sample.mask, Shape(shape)))
            self.times.append((process_time() - begin) * 1e3)
        pairs = list(zip(self.fits, self.samples))
        self.errors = [error(fit.parameters, fit.symmetry, sample.contact) for fit, sample in pairs]
        self.strict = [error(fit.parameters, OUTLINES[fit.shape].symmetry, sample.contact)
                       for fit, sample in pairs]
        self.handedness = [same_handedness(fit, sample.contact) for fit, sample in pairs]

    def distances(self) -> np.ndarray:
        """Squared Mahalanobis distance of the truth, as a share of the 95 % region's: inside below 1."""
        vectors = [each.vector for each in self.errors]
        squared = [vector @ np.linalg.solve(fit.covariance, vector) for fit, vector in zip(self.fits, vectors)]
        return np.array(squared) / chi2.ppf(0.95, len(vectors[0]))


def median(values) -> str:
    """With a 95 % interval from order statistics, which assumes nothing of the distribution."""
    values = np.sort([value for value in values if value == value])
    if not len(values):
        return '-'
    low, high = binom.ppf((0.025, 0.975), len(values), 0.5).astype(int)
    return f'{np.median(values):.3g} [{values[low]:.3g}, {values[min(high, len(values) - 1)]:.3g}]'


def percentile(values, share: float) -> str:
    values = [value for value in values if value == value]
    return f'{np.percentile(values, share):.3g}' if values else '-'


def accuracy(report: Report, fitted: dict) -> None:
    report.say(f'## Errors at N = {AREA}, median [95 % interval]; 95th percentile')
    report.say('Centre in pitches, angle in degrees (by the symmetry that the fit declares), length: the worst '
               'dimension.')
    report.say()
    rows = [[condition, shape, *(cell for kind in TARGETS for cell in (
        median(getattr(each, kind) for each in of.errors),
        percentile((getattr(each, kind) for each in of.errors), 95)))]
        for (condition, shape), of in fitted.items()]
    report.table(['frames', 'shape', 'centre', '95 %', 'angle', '95 %', 'length %', '95 %'], rows)
    clean = [(kind, np.nanmedian([getattr(each, kind) for each in fitted['clean', shape].errors]))
             for shape in CLASSES for kind in TARGETS if (kind, shape) != ('angle', 'circle')]
    for kind, target in TARGETS.items():
        worst = max(value for name, value in clean if name == kind)
        report.say(f'- clean frames, {kind}: worst median of the five shapes {worst:.3g}, target < {target}: '
                   f'{"met" if worst < target else "NOT MET"}')
    report.say()


def alternatives(report: Report, fitted: dict) -> None:
    report.say('## Beside simple alternatives, the five shapes together: medians of centre / angle / length')
    report.say('Moments: closed forms up to the fourth moment (which assume the shape too). Rectangle: the least '
               'one about the taxels.')
    report.say()
    rows = []
    for condition in CONDITIONS:
        of = [fitted[condition, shape] for shape in CLASSES]
        ours = [each for one in of for each in one.errors]
        rows.append([condition, _medians(ours), *(_medians([
            error(method(sample), OUTLINES[Shape(one.shape)].symmetry, sample.contact)
            for one in of for sample in one.samples]) for method in (by_moments, by_rectangle))])
    report.table(['frames', 'ours', 'moments', 'least rectangle'], rows)


def _medians(errors) -> str:
    return ' / '.join(f'{np.nanmedian([getattr(each, kind) for each in errors]):.3g}' for kind in TARGETS)


def by_area(report: Report, count: int) -> None:
    report.say('## Against the area: medians of centre / angle / length, and the 95 % regions')
    report.say()
    rows = []
    for condition in ('clean', 'all four', 'on/off'):
        for area in AREAS:
            of = [Fitted(shape, condition, area, count, purpose=Purpose.EVALUATION) for shape in CLASSES]
            inside = np.concatenate([one.distances() < 1 for one in of])
            rows.append([condition, str(area), _medians([each for one in of for each in one.errors]),
                         str(rate_of(inside))])
    report.table(['frames', 'N', 'centre / angle / length', '95 % region holds the truth'], rows)


def regions(report: Report, fitted: dict) -> None:
    report.say(f'## 95 % regions at N = {AREA}: share of fresh contacts inside, Wilson interval')
    report.say('All parameters of a fit at once. Wanted: 93-97 %.')
    report.say()
    inside = {key: of.distances() < 1 for key, of in fitted.items()}
    rows = [[condition, *(f'{inside[condition, shape].mean():.1%}' for shape in CLASSES),
             str(rate_of(np.concatenate([inside[condition, shape] for shape in CLASSES])))] for condition in CONDITIONS]
    report.table(['frames', *CLASSES, 'all'], rows)
    for name, chosen in (('pressure', [c for c in CONDITIONS if c != 'on/off']), ('on/off', ['on/off'])):
        together = np.concatenate([inside[condition, shape] for condition in chosen for shape in CLASSES])
        share = together.mean()
        report.say(f'- {name} frames together: {rate_of(together)}: '
                   f'{"met" if 0.93 <= share <= 0.97 else "NOT MET"}')
    report.say()


def corners(report: Report, fitted: dict) -> None:
    report.say('## Which corner is the apex, which handedness')
    report.say('A nearly equilateral triangle may show three apexes. The fit then says symmetry 3; the errors above '
               'count by that. Wrong, unsaid: the apex is another corner and the fit says symmetry 1.')
    report.say()
    rows = []
    for condition in CONDITIONS:
        of = fitted[condition, 'isosceles_triangle']
        wrong = np.array([each.angle > 60 for each in of.strict])
        said = np.array([fit.symmetry == 3 for fit in of.fits])
        handedness = fitted[condition, 'right_triangle'].handedness
        rows.append([condition, *(str(rate_of(each)) for each in (said, wrong, wrong & ~said, np.array(handedness)))])
    report.table(['frames', 'symmetry 3', 'wrong apex', 'wrong, unsaid', 'same handedness'], rows)


def times(report: Report, fitted: dict) -> None:
    report.say('## Processor time of one fit, one core, in ms: 10th percentile; median; 95th percentile')
    report.say()
    rows = [[condition, *(f'{np.percentile(of.times, 10):.2f}; {np.median(of.times):.2f}; '
                          f'{np.percentile(of.times, 95):.2f}' for of in (fitted[condition, s] for s in CLASSES))]
            for condition in CONDITIONS]
    report.table(['frames', *CLASSES], rows)
    ten, repeats = np.ones(10), 20_000
    begin = process_time()
    for _ in range(repeats):
        np.add(ten, ten)
    add = (process_time() - begin) / repeats * 1e6
    report.say(f'- for comparison, adding two arrays of ten numbers took {add:.2f} us here: a busy machine '
               'stretches all of these')
    samples = fitted['dead 3 %', 'rectangle'].samples
    begin = process_time()
    for sample in samples:
        contact_moments(sample.values, sample.mask, 0.002, 'Pa')
    report.say(f'- contact_moments: {(process_time() - begin) / len(samples) * 1e3:.3f} ms a frame (mean)')
    report.say()


def calibrate(count: int) -> None:
    """Print the factor that each kind of fit needs, over all conditions and areas, from training seeds."""
    for shape in CLASSES:
        for name, chosen in (('pressure', [c for c in CONDITIONS if c != 'on/off']), ('on/off', ['on/off'])):
            shares = np.concatenate([Fitted(shape, condition, area, count * (6 if name == 'on/off' else 1),
                                            purpose=Purpose.TRAINING).distances()
                                     for condition in chosen for area in (20, 35, 50, 100)])
            print(f'{shape:20}{name:10}{len(shares):6} fits: factor of the covariance now in force, times '
                  f'{np.percentile(shares, 95):.3f}', flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--patterns', type=int, default=200, help='of each shape and condition; default 200')
    parser.add_argument('--calibrate', action='store_true')
    parser.add_argument('--output', type=Path, default=ROOT / 'docs')
    args = parser.parse_args()
    if args.calibrate:
        return calibrate(args.patterns)
    report = Report()
    report.say('# Pose, size and fusion, as measured')
    report.say(f'Written by `python bench/bench_pose.py --patterns {args.patterns}`; {args.patterns} fresh contacts a '
               'row, evaluation seeds.')
    report.say()
    fitted = {(condition, shape): Fitted(shape, condition, AREA, args.patterns, purpose=Purpose.EVALUATION)
              for condition in CONDITIONS for shape in CLASSES}
    for part in (accuracy, alternatives, regions, corners, times):
        part(report, fitted)
    by_area(report, max(args.patterns // 3, 20))
    pose_mechanics.report(report.say, report.table, max(args.patterns // 2, 20))
    pose_fusion.measure(report)
    (args.output / 'pose_results.md').write_text('\n'.join(report.lines) + '\n', encoding='utf-8')
    return None


if __name__ == '__main__':
    main()
