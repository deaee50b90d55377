"""Measure the accuracy and cost of pose, size, and covariance.

Run from the checkout: python bench/bench_pose.py [--patterns 200] [--calibrate]

The script writes docs/pose_results.md and the tables for this page, measured with evaluation seeds. With --page, the
script measures nothing and rewrites the page from the recorded tables. With --calibrate, the script only prints
corrections to the factors in tactile_node/pose/model_error.py, measured with training seeds.
"""

import argparse
import os
import sys
from pathlib import Path
from time import process_time

for library in ('OPENBLAS', 'OMP', 'MKL'):
    os.environ[f'{library}_NUM_THREADS'] = '1'  # numpy reads these variables when it is imported
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

import numpy as np
import pose_mechanics
from pose_world import CONDITIONS, draw, error, same_handedness
from scipy.stats import binom, chi2

from bench import pose_summary
from bench.recognition.figures import rate_of
from bench.recognition.page import Table, file_name
from tactile_node.pose.fit import fit_shape
from tactile_node.pose.moments import contact_moments
from tactile_node.pose.outlines import OUTLINES
from tactile_node.shape.recognition import Shape
from tactile_node.simulator.world import CLASSES
from training.ground_truth.seeds import Purpose, generator

AREA = 50
AREAS = (12, 20, 35, 50, 100)
#: Required medians for contacts of 50 taxels on clean pressure frames.
TARGETS = {'centre': 0.05, 'angle': 1.5, 'length': 2.0}
SEED = 5


class PoseReport:
    """Prints tables and their notes, and records them in ``folder``."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.said: list[str] = []

    def say(self, line: str) -> None:
        """Print a note, and keep it for the next table."""
        print(line, flush=True)
        self.said.append(line)

    def table(self, heading: str, head: list[str], rows: list[list[str]]) -> None:
        table = Table(heading, '', head)
        table.rows = rows
        print(table.plain(), flush=True)
        table.record(self.folder)
        note = self.folder / f'{file_name(heading)}.txt'
        note.unlink(missing_ok=True)
        if self.said:
            note.write_text('\n'.join(self.said) + '\n', encoding='utf-8')
        self.said = []


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
        """Return the squared Mahalanobis distance of the truth, in units of the edge of the 95 % region."""
        vectors = [each.vector for each in self.errors]
        squared = [vector @ np.linalg.solve(fit.covariance, vector) for fit, vector in zip(self.fits, vectors)]
        return np.array(squared) / chi2.ppf(0.95, len(vectors[0]))


def median(values) -> str:
    """Return the median and its 95 % interval from order statistics, which is valid for any distribution."""
    values = np.sort([value for value in values if value == value])
    if not len(values):
        return '-'
    low, high = binom.ppf((0.025, 0.975), len(values), 0.5).astype(int)
    return f'{np.median(values):.3g} [{values[low]:.3g}, {values[min(high, len(values) - 1)]:.3g}]'


def percentile(values, share: float) -> str:
    values = [value for value in values if value == value]
    return f'{np.percentile(values, share):.3g}' if values else '-'


def accuracy(report: PoseReport, fitted: dict) -> None:
    rows = [[condition, shape, *(cell for kind in TARGETS for cell in (
        median(getattr(each, kind) for each in of.errors),
        percentile((getattr(each, kind) for each in of.errors), 95)))]
        for (condition, shape), of in fitted.items()]
    clean = [(kind, np.nanmedian([getattr(each, kind) for each in fitted['clean', shape].errors]))
             for shape in CLASSES for kind in TARGETS if (kind, shape) != ('angle', 'circle')]
    for kind, target in TARGETS.items():
        worst = max(value for name, value in clean if name == kind)
        report.say(f'- clean frames, {kind}: worst median of the five shapes {worst:.3g}, target < {target}: '
                   f'{"met" if worst < target else "NOT MET"}')
    report.table('Errors', ['frames', 'shape', *(head for kind in ('centre', 'angle', 'length %') for head in (
        kind, f'{kind.removesuffix(" %")}, 95th percentile'))], rows)


def _medians(errors) -> str:
    return ' / '.join(f'{np.nanmedian([getattr(each, kind) for each in errors]):.3g}' for kind in TARGETS)


def by_area(report: PoseReport, count: int) -> None:
    rows = []
    for condition in ('clean', 'all four', 'on/off'):
        for area in AREAS:
            of = [Fitted(shape, condition, area, count, purpose=Purpose.EVALUATION) for shape in CLASSES]
            inside = np.concatenate([one.distances() < 1 for one in of])
            rows.append([condition, str(area), _medians([each for one in of for each in one.errors]),
                         str(rate_of(inside))])
    report.table('Against the area', ['frames', 'N', 'centre / angle / length', '95 % region holds the truth'], rows)


def regions(report: PoseReport, fitted: dict) -> None:
    inside = {key: of.distances() < 1 for key, of in fitted.items()}
    rows = [[condition, *(f'{inside[condition, shape].mean():.1%}' for shape in CLASSES),
             str(rate_of(np.concatenate([inside[condition, shape] for shape in CLASSES])))] for condition in CONDITIONS]
    for name, chosen in (('pressure', [c for c in CONDITIONS if c != 'on/off']), ('on/off', ['on/off'])):
        together = np.concatenate([inside[condition, shape] for condition in chosen for shape in CLASSES])
        share = together.mean()
        report.say(f'- {name} frames together: {rate_of(together)}: '
                   f'{"met" if 0.93 <= share <= 0.97 else "NOT MET"}')
    report.table('Regions', ['frames', *CLASSES, 'all'], rows)


def corners(report: PoseReport, fitted: dict) -> None:
    rows = []
    for condition in CONDITIONS:
        of = fitted[condition, 'isosceles_triangle']
        wrong = np.array([each.angle > 60 for each in of.strict])
        said = np.array([fit.symmetry == 3 for fit in of.fits])
        handedness = fitted[condition, 'right_triangle'].handedness
        rows.append([condition, *(str(rate_of(each)) for each in (said, wrong, wrong & ~said, np.array(handedness)))])
    report.table('Corners', ['frames', 'symmetry 3', 'wrong apex', 'wrong, unsaid', 'same handedness'], rows)


def times(report: PoseReport, fitted: dict) -> None:
    """Report the 10th percentile, median and 95th percentile of the time per fit [ms]."""
    rows = [[condition, *(f'{np.percentile(of.times, 10):.2f}; {np.median(of.times):.2f}; '
                          f'{np.percentile(of.times, 95):.2f}' for of in (fitted[condition, s] for s in CLASSES))]
            for condition in CONDITIONS]
    ten, repeats = np.ones(10), 20_000
    begin = process_time()
    for _ in range(repeats):
        np.add(ten, ten)
    add = (process_time() - begin) / repeats * 1e6
    report.say(f'- for comparison, the sum of two arrays of ten numbers took {add:.2f} us; on a busy machine, all '
               'times are longer')
    samples = fitted['dead 3 %', 'rectangle'].samples
    begin = process_time()
    for sample in samples:
        contact_moments(sample.values, sample.mask, 0.002, 'Pa')
    report.say(f'- contact_moments: {(process_time() - begin) / len(samples) * 1e3:.3f} ms per frame (mean)')
    report.table('Time of one fit', ['frames', *CLASSES], rows)


def calibrate(count: int) -> None:
    """Print the factor by which to multiply the covariance of each kind of fit, measured with training seeds."""
    for shape in CLASSES:
        for name, chosen in (('pressure', [c for c in CONDITIONS if c != 'on/off']), ('on/off', ['on/off'])):
            shares = np.concatenate([Fitted(shape, condition, area, count * (6 if name == 'on/off' else 1),
                                            purpose=Purpose.TRAINING).distances()
                                     for condition in chosen for area in (20, 35, 50, 100)])
            print(f'{shape:20}{name:10}{len(shares):6} fits: current factor of the covariance, times '
                  f'{np.percentile(shares, 95):.3f}', flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--patterns', type=int, default=200, help='contacts per shape and condition, default 200')
    parser.add_argument('--calibrate', action='store_true')
    parser.add_argument('--page', action='store_true', help='only write the page from the recorded tables')
    parser.add_argument('--output', type=Path, default=ROOT / 'docs')
    args = parser.parse_args()
    if args.page:
        return pose_summary.PAGE.write(args.output)
    if args.calibrate:
        return calibrate(args.patterns)
    report = PoseReport(args.output / pose_summary.FOLDER)
    fitted = {(condition, shape): Fitted(shape, condition, AREA, args.patterns, purpose=Purpose.EVALUATION)
              for condition in CONDITIONS for shape in CLASSES}
    for part in (accuracy, regions, corners, times):
        part(report, fitted)
    by_area(report, max(args.patterns // 3, 20))
    pose_mechanics.report(report.table, max(args.patterns // 2, 20))
    (report.folder / 'about.txt').write_text(
        f'Written by `python bench/bench_pose.py --patterns {args.patterns}`: {args.patterns} new contacts '
        'in each cell, evaluation seeds.\n', encoding='utf-8')
    return pose_summary.PAGE.write(args.output)


if __name__ == '__main__':
    main()
