"""Measure our shape recognition, and compare it with a small CNN and with 300 trees on OpenCV contour features.

Run `make bench`, or: .venv-bench/bin/python bench/bench_recognition.py [--quick] [--only SECTION ...]

The script trains the CNN and the trees, called the anchors, on the samples of `make train`. The script then writes
tables/ and the pages.

With --page FOLDER, the script measures nothing and rewrites the pages from the tables in FOLDER. With --validation, the
script uses seeds and families of foreign and blemished figures that are never reported. Use --validation for choices
about the training. With --alone, the script skips the anchors and needs neither torch nor OpenCV, so that
.venv/bin/python can run it.
"""

import argparse
import os
import sys
from collections.abc import Collection, Iterator, Sequence
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from pathlib import Path
from time import perf_counter

os.environ |= {name: '1' for name in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS')}
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from bench.recognition.contest import Contest
from bench.recognition.page import Table
from bench.recognition.sections import (
    FULL,
    QUICK,
    SECTIONS,
    WITHOUT_ANCHORS,
    Amount,
    Run,
)
from bench.recognition.summary import FOLDER, PAGES
from tactile_node import Recogniser
from tactile_node.package_files import config_path
from training.ground_truth.seeds import Purpose


class Clock:
    """Prints progress messages, each preceded by the seconds since the start."""

    def __init__(self):
        self._begin = perf_counter()

    def __call__(self, text: str) -> None:
        print(f'[{perf_counter() - self._begin:5.0f} s] {text}', flush=True)


def main() -> int:
    args = _arguments()
    if args.page:
        write_pages(args.page)
        return 0
    clock = Clock()
    args.output.mkdir(parents=True, exist_ok=True)
    amount = QUICK if args.quick else FULL
    anchors = {True: [], False: []} if args.alone or set(args.only) <= WITHOUT_ANCHORS else trained_anchors(
        args, amount, clock)
    recogniser = Recogniser(file=config_path(args.weights))
    run = Run(Contest(recogniser, anchors), recogniser, amount, clock=clock,
              purpose=Purpose.VALIDATION if args.validation else Purpose.EVALUATION)
    found = {}
    for name, section in measured(args.only, run, args.jobs):
        clock(f'{name}: done')
        found[name] = section
        for table in section:
            print(table.plain(), flush=True)
        # write the report after each section, so that an interrupted run leaves one
        write_report([name for name in args.only if name in found], found, args)
    clock(f'written to {args.output}')
    return 0


def trained_anchors(args: argparse.Namespace, amount: Amount, clock: Clock) -> dict[bool, list]:
    """Train the CNN and the trees, and return both for each kind of frames."""
    import cv2  # cv2 and torch are installed only in .venv-bench
    import torch

    from bench.recognition.anchor_training import train_anchors
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    return train_anchors(args.samples, amount.share, amount.epochs, args.jobs, clock)


def write_report(names: Sequence[str], found: dict[str, list[Table]], args: argparse.Namespace) -> None:
    """Write the CSV files and the pages of the finished sections."""
    recorded = [table for name in names for table in found[name]]
    missing = [name for name in args.only if name not in found]
    for table in recorded:
        table.record(args.output / FOLDER)
    (args.output / FOLDER / 'about.txt').write_text(
        ('A quick run: anchors half trained' if args.quick else 'The full run')
        + (', ours alone' if args.alone else '') + (', on validation seeds' if args.validation else '')
        + (f'; not done: {", ".join(missing)}' if missing else '') + '.\n', encoding='utf-8')
    write_pages(args.output, {table.heading for table in recorded})


def write_pages(folder: Path, recorded: Collection[str] | None = None) -> None:
    for page in PAGES:
        page.write(folder, recorded)


def measured(names: Sequence[str], run: Run, jobs: int) -> Iterator[tuple[str, list[Table]]]:
    """Yield each section once it is finished.

    Up to ``jobs`` sections run at a time.
    """
    fork = get_context('fork')  # forked processes share the memory of the anchors
    waiting, running = list(names), {}
    while waiting or running:
        while waiting and len(running) < jobs:
            receiver, sender = fork.Pipe(duplex=False)
            process = fork.Process(target=_send, args=(sender, run, waiting[0]))
            process.start()
            sender.close()
            running[receiver] = waiting.pop(0), process
        for receiver in wait(list(running)):
            name, process = running.pop(receiver)
            yield name, receiver.recv()
            process.join()


def _send(sender: Connection, run: Run, name: str) -> None:
    sender.send(SECTIONS[name](run))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--quick', action='store_true', help='run for a few minutes, with half-trained anchors')
    parser.add_argument('--only', nargs='+', choices=list(SECTIONS), default=list(SECTIONS), metavar='SECTION',
                        help=f'sections to measure: {", ".join(SECTIONS)} (default: all)')
    parser.add_argument('--validation', action='store_true', help='use seeds and families that are never reported')
    parser.add_argument('--page', type=Path, metavar='FOLDER', help='only write the pages from FOLDER/tables')
    parser.add_argument('--output', type=Path, default=ROOT / 'bench_output')
    parser.add_argument('--samples', type=Path, default=ROOT / 'build/samples', help='folder of the training samples')
    parser.add_argument('--jobs', type=int, default=2, help='number of processes, default %(default)s')
    parser.add_argument('--weights', default='recogniser.npz')
    parser.add_argument('--alone', action='store_true', help='skip the anchors')
    return parser.parse_args()


if __name__ == '__main__':
    sys.exit(main())
