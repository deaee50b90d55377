"""How time and memory of each stage grow with the pad and with the contact, up to the largest pad that a layout allows.

Run by `make bench`, or: python bench/bench_growth.py [--sides 16 64 ...]. Each stage runs in a separate process, on
one core: median of some runs, and by how much its resident memory rises at most. `fit` is of the slowest shape.
"""

import argparse
import os
import resource
import sys
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

os.environ |= {name: '1' for name in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS')}
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.contact.visibility import visibility_of
from tactile_node.helmholtz.features import Group, compute_features
from tactile_node.pose.fit import fit_shape
from tactile_node.pose.moments import contact_moments
from tactile_node.shape.methods import make_recogniser
from tactile_node.shape.recognition import Shape

SIDES = 16, 64, 256, 600, 1024
SMALL, LARGE = 5.6, 0.42   #: radius of the contact: in pitches, and of the pad's side
ENOUGH = 1.0               #: s: no further run once so much time is spent
MOST_RUNS = 15
PITCH = 0.002


class Cost(NamedTuple):
    """Of one stage."""

    seconds: float
    megabytes: float


def frame_of(side: int, radius: float) -> np.ndarray:
    """A disc with a soft rim, noise of 0.6 %."""
    rows, cols = np.indices((side, side))
    away = np.hypot(rows - side / 2 + 0.2, cols - side / 2 + 0.3) - radius
    noise = np.random.default_rng(0).normal(0, 300, (side, side))
    frame: np.ndarray = (50e3 / (1 + np.exp(np.clip(2 * away, -50, 50))) + noise).astype(np.float32)
    return frame


def stages(frame: np.ndarray, pattern: ContactPattern) -> dict[str, Callable[[], object]]:
    """What is done with a frame, by name."""
    extractor, recogniser, seen = PatternExtractor(unit='Pa'), make_recogniser(), visibility_of(pattern)
    return {
        'contact': lambda: visibility_of(extractor.extract(frame)),
        'recognition': lambda: recogniser.recognise(pattern, visibility=seen),
        'fit, circle': lambda: fit_shape(pattern.values, pattern.mask, Shape.CIRCLE, PITCH),
        'fit, isosceles': lambda: fit_shape(pattern.values, pattern.mask, Shape.ISOSCELES_TRIANGLE, PITCH),
        'moments': lambda: contact_moments(pattern.values, pattern.mask, PITCH, 'Pa', seen, pattern.noise),
        'features': lambda: compute_features(pattern.mask, Group.CLASSIFIER),
        'eigenvalues': lambda: compute_features(pattern.mask, Group.EIGENVALUES)}


def measured(stage: Callable[[], object]) -> Cost:
    """Run ``stage`` in a child."""
    fork = get_context('fork')
    receiver, sender = fork.Pipe(duplex=False)
    child = fork.Process(target=_measure, args=(stage, sender))
    child.start()
    sender.close()  # a child that dies is an EOFError here
    cost: Cost = receiver.recv()
    child.join()
    return cost


def _measure(stage: Callable[[], object], sender: Connection) -> None:
    before, times = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, []
    while len(times) < MOST_RUNS and sum(times) < ENOUGH:
        begin = perf_counter()
        stage()
        times.append(perf_counter() - begin)
    rise = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    sender.send(Cost(float(np.median(times[1:] or times)), rise / 1024))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--sides', type=int, nargs='+', default=SIDES, help='of the pads [taxels]')
    args = parser.parse_args()
    print('# Growth: milliseconds / megabytes of one frame\n')
    head: list[str] = []
    for side in args.sides:
        for radius in (SMALL, LARGE * side):
            frame = frame_of(side, radius)
            pattern = PatternExtractor(unit='Pa').extract(frame)
            found = stages(frame, pattern)
            if not head:
                head = ['pad', 'taxels', *found]
                print('| ' + ' | '.join(head) + ' |\n|' + ' --- |' * len(head))
            print(f'| {side}x{side} | {int(pattern.mask.sum())} ', end='', flush=True)
            for stage in found.values():
                cost = measured(stage)
                print(f'| {1000 * cost.seconds:.3g} / {cost.megabytes:.0f} ', end='', flush=True)
            print('|')


if __name__ == '__main__':
    main()
