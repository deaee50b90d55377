"""How well shapes are recognised: ours beside a small CNN and OpenCV contours with 300 trees.

Run by `make bench`, or: .venv-bench/bin/python bench/bench_recognition.py [--quick] [--output FOLDER].
Both anchors are trained in this run, on training seeds of the generator that the evaluation draws from
with its own seeds. Writes recognition.csv, recognition.md and the pictures of our failures.
"""

import argparse
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter

os.environ |= {name: '1' for name in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS')}
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import cv2
import numpy as np
import torch

from bench.recognition.anchors import Cnn, ContourTrees
from bench.recognition.cases import (
    CLEAN,
    clean_cases,
    field_cases,
    make_case,
    outlier_cases,
    patches,
    recorded,
)
from bench.recognition.contest import (
    ORDER,
    OURS,
    Contest,
    Result,
    answers_of,
    calibration,
    fused,
    rejection_at_loss,
)
from bench.recognition.figures import Rate
from bench.recognition.page import KIND, Table, draw_failures, write_csv, write_page
from tactile_node.package_files import config_path
from tactile_node.shape.recogniser import ShapeRecogniser
from tactile_node.shape.recognition import Shape
from tactile_node.synthetic.seeds import Purpose, generator
from training.batch import draw_many
from training.samples import UNKNOWN, Samples, draw, joined_samples

ANCHOR_SEEDS = {True: 900_001, False: 900_002}
HELD = 40  #: taxels on: while the ring is held there are more, before and after fewer
AREAS, FIELD_AREAS, OUTLIER_AREAS = (9, 12, 15, 20, 25, 35, 50, 75, 100), (20, 50, 100), (50, 100)


class Clock:
    """Says what is going on, and since when."""

    def __init__(self):
        self._begin = perf_counter()

    def __call__(self, text: str) -> None:
        print(f'[{perf_counter() - self._begin:5.0f} s] {text}', flush=True)


def anchor_samples(on_off: bool, bulk: int, faulty: int) -> Samples:
    """Nominal and field conditions as for ours, without outliers: the anchors know five classes."""
    rng = generator(Purpose.TRAINING, ANCHOR_SEEDS[on_off])
    parts = [draw_many(rng, 256, on_off, ((7, 60), (30, 110))[k % 4 == 3]) for k in range(bulk // 256)]
    samples = joined_samples([*parts, draw(rng, faulty, on_off, faulty=1.0, outliers=0.0)])
    return Samples(*(array[samples.labels != UNKNOWN] for array in samples))  # two contacts in one are no class


def trained(on_off: bool, bulk: int, faulty: int, epochs: float) -> list:
    """The CNN and the trees for one kind of frame."""
    torch.set_num_threads(1)
    samples = anchor_samples(on_off, bulk, faulty)
    return [Cnn(samples, epochs), ContourTrees(samples, not on_off)]


def train_anchors(clock: Clock, jobs: int, *, bulk: int, faulty: int, epochs: int) -> dict:
    """Both kinds of frames at once, if ``jobs`` is 2."""
    clock(f'training the anchors on {bulk} + {faulty} samples of each kind of frame, the CNN for {epochs:g} epochs')
    kinds = (True, False)
    amount = bulk, faulty, epochs
    if jobs < 2:
        return {on_off: trained(on_off, *amount) for on_off in kinds}
    with ProcessPoolExecutor(2, get_context('spawn')) as pool:
        return dict(zip(kinds, pool.map(trained, kinds, *([value] * 2 for value in amount))))


def rates(heading: str, text: str, results: list[Result]) -> Table:
    names = list(results[0].answers)
    table = Table(heading, text, ['condition', 'frames', 'area', 'patterns', *(f'{name}, %' for name in names),
                                  'ours unknown, %', 'ours against the better'])
    for result in results:
        best = max((result.rate(name) for name in names if name != OURS), key=lambda rate: rate.value)
        ours, (low, high) = result.rate(OURS), best.interval
        verdict = 'above' if ours.value > high else 'within' if ours.value >= low else 'BELOW'
        table.add(result.case.condition, KIND[result.case.on_off], f'{result.case.area:g}', ours.count,
                  *(result.rate(name) for name in names), f'{100 * unknown(result).value:.2f}', verdict)
    return table


def unknown(result: Result) -> Rate:
    """Known shapes that ours calls unknown."""
    called = result.answers[OURS].argmax(1) == ORDER.index(Shape.UNKNOWN)
    return Rate(int(called.sum()), len(called))


def speed(contest: Contest, repeat: int) -> Table:
    table = Table('Time of a single frame', f'median of {repeat} frames, one core, each by itself [us]; ours from the '
                  'contact pattern on, the anchors from a prepared patch on (its making is not counted)',
                  ['frames', 'area', OURS, 'CNN', 'contours + trees', 'ours / CNN', 'ours / (contours + trees)'])
    for on_off in (True, False):
        for area in (20, 50, 100):
            taken = contest.times(make_case(3000 + on_off, CLEAN, on_off, area, count=50), repeat)
            ours, cnn, trees = taken.values()
            table.add(KIND[on_off], area, *(f'{t * 1e6:.0f}' for t in (ours, cnn, trees)), f'{ours / cnn:.2f}',
                      f'{ours / trees:.3f}')
    return table


def probabilities(clean: list[Result]) -> Table:
    names = list(clean[0].answers)
    table = Table('Expected calibration error', 'clean frames of all sizes, 15 bins [%]', ['frames', *names])
    for on_off in (True, False):
        chosen = [result for result in clean if result.case.on_off == on_off]
        table.add(KIND[on_off], *(f'{100 * calibration(chosen, name):.2f}' for name in names))
    return table


def rejection(known: list[Result], outliers: list[Result]) -> Table:
    """As shipped, and at 2 % loss: the limit from validation patterns ``known``."""
    names = list(outliers[0].answers)
    table = Table('Shapes outside the five', 'called unknown [%]: ours as shipped, and each at a limit that loses '
                  '2 % of known shapes of that size (of validation patterns); anchors by their highest probability',
                  ['shape', 'frames', 'area', 'ours, as shipped', *(f'{name}, 2 % loss' for name in names)])
    for on_off in (True, False):
        for area in OUTLIER_AREAS:
            same = [r for r in outliers if (r.case.on_off, r.case.area) == (on_off, area)]
            limit = [r for r in known if (r.case.on_off, r.case.area) == (on_off, area)]
            for label, results in [*((r.case.condition, [r]) for r in same), ('all five', same)]:
                right = np.concatenate([r.right(OURS) for r in results])
                table.add(label, KIND[on_off], area, Rate(int(right.sum()), len(right)),
                          *(rejection_at_loss(limit, results, name) for name in names))
    return table


def recordings(contest: Contest) -> Table:
    """Real touches; they were never used for training or tuning."""
    table = Table('Real recordings', 'share of answers over the frames in which the object is held (at least '
                  f'{HELD} taxels on; of the square, moved and noisy, at least 30) [%]: frame by frame, and ours as '
                  'the classifier node reports it, successive frames fused',
                  ['recording', 'frames', 'contestant', *(shape.value for shape in ORDER)])
    for log, least in (('nus_ring_session.log.gz', HELD), ('nus_square_excerpt.log.gz', 30)):
        stamps, patterns = recorded(log)
        held = np.flatnonzero([(pattern.values > 0.5).sum() >= least for pattern in patterns])
        ours = answers_of(contest.ours, patterns)
        answers = {OURS: ours[held], f'{OURS}, fused': fused(stamps, ours)[held]}
        samples = patches([patterns[k] for k in held], np.zeros(len(held), int))
        answers |= {anchor.name: anchor.probabilities(samples) for anchor in contest.anchors[True]}
        for name, answer in answers.items():
            share = np.bincount(answer.argmax(1), minlength=len(ORDER)) / len(held)
            table.add(log.split('.')[0], len(held), name, *(f'{100 * s:.0f}' for s in share))
    return table


def main() -> int:
    args = _arguments()
    clock = Clock()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    args.output.mkdir(parents=True, exist_ok=True)
    bulk, faulty, epochs, clean_count, field_count = (
        (20_000, 1000, 2, 300, 60) if args.quick else (100_000, 8_000, 4, 3000, 400))
    anchors = train_anchors(clock, args.jobs, bulk=bulk, faulty=faulty, epochs=epochs)
    contest = Contest(ShapeRecogniser.from_file(config_path(args.weights)), anchors)
    clock('time of a single frame')
    tables = [speed(contest, 100 if args.quick else 400)]
    print(tables[0].plain())
    clean = _run(contest, clean_cases(AREAS, clean_count), clock, 'clean frames')
    clock('outliers')
    known = [contest.run(make_case(71 + area + on_off, CLEAN, on_off, area, count=clean_count,
                                   purpose=Purpose.VALIDATION))
             for area in OUTLIER_AREAS for on_off in (True, False)]
    outliers = [contest.run(case) for case in outlier_cases(OUTLIER_AREAS, field_count)]
    field = _run(contest, field_cases(FIELD_AREAS, field_count), clock, 'field conditions')
    tables = [rates('Clean frames', 'recognised [%], 95 % Wilson intervals; the verdict compares ours with the '
                    'interval of the better anchor', clean), *tables, probabilities(clean),
              rejection(known, outliers), recordings(contest),
              rates('Field conditions', 'one condition changed, the rest nominal; UNKNOWN, which the anchors cannot '
                    'say, counts as not recognised', field)]
    for table in tables:
        print(table.plain())
    _write(args, tables, clean=clean, field=field, outliers=outliers)
    clock(f'written to {args.output}')
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--quick', action='store_true', help='a few minutes, wide intervals, anchors half trained')
    parser.add_argument('--output', type=Path, default=ROOT / 'bench_output')
    parser.add_argument('--jobs', type=int, default=2, help='processes that train the anchors, default %(default)s')
    parser.add_argument('--weights', default='recogniser.npz')
    return parser.parse_args()


def _run(contest: Contest, cases, clock: Clock, what: str) -> list[Result]:
    results = []
    for case in cases:
        results.append(contest.run(case))
        clock(f'{what}: {case.condition}, {KIND[case.on_off]}, {case.area:g} taxels: '
              f'ours {results[-1].rate(OURS)} %')
    return results


def _write(args, tables: list[Table], clean: list[Result], field: list[Result], outliers: list[Result]) -> None:
    pictures = []
    for name, caption, results in (('clean', 'Clean frames that ours gets wrong', clean),
                                   ('field', 'Frames under field conditions that ours gets wrong', field),
                                   ('outliers', 'Other shapes that ours takes for a known one', outliers)):
        file = f'recognition_failures_{name}.png'
        total = draw_failures(args.output / file, results)
        pictures.append((file, f'{caption} ({total} in all)'))
    write_csv(args.output / 'recognition.csv', [*clean, *field, *outliers])
    mode = 'a quick run: anchors half trained' if args.quick else 'the full run'
    write_page(args.output / 'recognition_results.md', f'Recognition, measured ({mode})', tables, pictures)


if __name__ == '__main__':
    sys.exit(main())
