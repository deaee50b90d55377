"""How well shapes are recognised: ours beside a small CNN and OpenCV contours with 300 trees.

Run by `make bench`, or: .venv-bench/bin/python bench/bench_recognition.py [--quick] [--only SECTION ...]. Both anchors
are trained in this run, on training seeds of the generator. Writes recognition.csv, blind_spots.csv, the page and its
pictures. With --validation the patterns come from seeds that are never reported: for a look while something is changed.
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
import torch

from bench.recognition.anchors import Cnn, ContourTrees
from bench.recognition.contest import Contest
from bench.recognition.page import write_csv, write_page
from bench.recognition.sections import FULL, QUICK, SECTIONS, WITHOUT_ANCHORS, Amount, Run
from tactile_node import Recogniser
from tactile_node.package_files import config_path
from tactile_node.synthetic.seeds import Purpose, generator
from training.batch import draw_many
from training.samples import UNKNOWN, Samples, draw, joined_samples

ANCHOR_SEEDS = {True: 900_001, False: 900_002}


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


def train_anchors(clock: Clock, jobs: int, amount: Amount) -> dict:
    """Both kinds of frames at once, if ``jobs`` is 2."""
    clock(f'training the anchors on {amount.bulk} + {amount.faulty} samples of each kind of frame, the CNN for '
          f'{amount.epochs:g} epochs')
    kinds, of_each = (True, False), (amount.bulk, amount.faulty, amount.epochs)
    if jobs < 2:
        return {on_off: trained(on_off, *of_each) for on_off in kinds}
    with ProcessPoolExecutor(2, get_context('spawn')) as pool:
        return dict(zip(kinds, pool.map(trained, kinds, *([value] * 2 for value in of_each))))


def main() -> int:
    args = _arguments()
    clock = Clock()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    args.output.mkdir(parents=True, exist_ok=True)
    amount = QUICK if args.quick else FULL
    anchors = {True: [], False: []} if set(args.only) <= WITHOUT_ANCHORS else train_anchors(clock, args.jobs, amount)
    recogniser = Recogniser(file=config_path(args.weights))
    run = Run(Contest(recogniser, anchors), recogniser, amount, output=args.output, clock=clock,
              purpose=Purpose.VALIDATION if args.validation else Purpose.EVALUATION)
    sections = []
    for name in args.only:
        clock(name)
        sections.append(SECTIONS[name](run))
        for table in sections[-1].tables:
            print(table.plain(), flush=True)
    mode = ('a quick run: anchors half trained' if args.quick else 'the full run') + (
        ', on validation seeds' if args.validation else '')
    write_csv(args.output / 'recognition.csv', [result for section in sections for result in section.results])
    write_page(args.output / 'recognition_results.md', f'Recognition, measured ({mode})',
               [table for section in sections for table in section.tables],
               [picture for section in sections for picture in section.pictures])
    clock(f'written to {args.output}')
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--quick', action='store_true', help='a few minutes, wide intervals, anchors half trained')
    parser.add_argument('--only', nargs='+', choices=list(SECTIONS), default=list(SECTIONS), metavar='SECTION',
                        help=f'of {", ".join(SECTIONS)}; default all')
    parser.add_argument('--validation', action='store_true', help='validation seeds: for a look, not for the report')
    parser.add_argument('--output', type=Path, default=ROOT / 'bench_output')
    parser.add_argument('--jobs', type=int, default=2, help='processes that train the anchors, default %(default)s')
    parser.add_argument('--weights', default='recogniser.npz')
    return parser.parse_args()


if __name__ == '__main__':
    sys.exit(main())
