"""Measure how well the recogniser with default settings recognises contacts on real arrays.

    python bench/bench_real_arrays.py --tekscan DIR --weiss DIR --vitac DIR --blocks DIR [--labels FILE]
        [--weights FILE] [--network]

Each DIR is a local copy of a public repository: TaISLab/CNN-based-Methods-for-Tactile-Object-Recognition,
peter-kiechle/tactile-sensors, jsheng45/ViTac-Tactile-Sensing, or the branch Applications of
aidanmohammed-ali/Tactile-Skin. The script prints one line for each missing copy. Each row of the table covers one
visible class on one array. The intervals are computed by bootstrap over objects, so that all pads of a grasp stay
together. The blocks are one object. Their intervals are computed over the frames, and are therefore too narrow.

The script reads the frames of the blocks in three ways: each frame as a separate file, all frames as one stream, and
all frames as one stream in which a frame of zeros precedes each frame.
"""

import argparse
import sys
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from bench.recognition.figures import calibration_error
from bench.recognition.page import Table
from bench.recognition.readings import after_idle, alone, stream
from bench.recognition.real_frames import (
    BLOCK_PAD,
    BLOCKS,
    LABELS,
    TEKSCAN,
    UNDECIDABLE,
    VITAC,
    WEISS,
    Labelled,
    read_frames,
    read_labels,
    read_whole_blocks,
)
from tactile_node.contact.pattern import PatternExtractor
from tactile_node.package_files import config_path
from tactile_node.shape.methods import make_recogniser
from tactile_node.shape.recognition import Recognition, Shape
from tactile_node.shape.support import SURE

IDLE = np.zeros(BLOCK_PAD)  #: Frame of the blocks' array without a contact.
WITHOUT_SHAPE = ('foreign', 'none')  #: Labels for which any of the five shapes is a wrong answer.
PLACES = {'tekscan': TEKSCAN, 'weiss': WEISS, 'vitac': VITAC}
SEED, DRAWS = 20_261_123, 2000
BINS = 10  #: Number of confidence bins for the calibration error.


class Answer(NamedTuple):
    of: Labelled
    found: Recognition

    @property
    def wanted(self) -> str:
        return Shape.UNKNOWN.value if self.of.label in WITHOUT_SHAPE else self.of.label

    @property
    def is_named(self) -> bool:
        return self.found.shape not in (Shape.UNKNOWN, Shape.NONE)

    @property
    def is_right(self) -> bool:
        return self.found.shape.value == self.wanted or self.wanted == Shape.UNKNOWN.value and not self.is_named

    @property
    def is_sure(self) -> bool:
        return self.is_named and self.found.confidence >= SURE


def answers(labelled: list[Labelled], data: Path, weights: str, network: bool) -> list[Answer]:
    recogniser = _recogniser(weights, network)
    frames = read_frames(labelled[0].array, data, [one.frame for one in labelled])
    return [Answer(one, recogniser.recognise(PatternExtractor().extract(frame)))
            for one, frame in zip(labelled, frames)]


def block_answers(frames: list[np.ndarray], weights: str, network: bool) -> dict[str, list[Answer]]:
    """Return the answers for frames of a square block, for each of the three ways to read the frames."""
    patterns = {'a file each': alone(frames), 'an idle frame before each': after_idle(frames, lambda: IDLE),
                'one stream': stream(frames)}
    found = {}
    for way, of_way in patterns.items():
        recogniser = _recogniser(weights, network)
        found[way] = [Answer(Labelled('blocks', f'{number}/frame', Shape.SQUARE.value, Shape.SQUARE.value),
                             recogniser.recognise(pattern)) for number, pattern in enumerate(of_way)]
    return found


def interval(found: list[Answer]) -> tuple[float, float]:
    """Return the 95 % bootstrap interval of the share of right answers, resampled by object."""
    by_object = defaultdict(list)
    for answer in found:
        by_object[answer.of.object].append(answer.is_right)
    sums = np.array([(sum(right), len(right)) for right in by_object.values()])
    drawn = sums[np.random.default_rng(SEED).integers(len(sums), size=(DRAWS, len(sums)))].sum(1)
    low, high = np.quantile(drawn[:, 0] / drawn[:, 1], (0.025, 0.975))
    return float(low), float(high)


def rows_of(array: str, found: list[Answer]) -> list[tuple]:
    rows = []
    for label in sorted({answer.of.label for answer in found}):
        own = [answer for answer in found if answer.of.label == label]
        sure = [answer for answer in own if answer.is_sure]
        low, high = interval(own)
        rows.append((array, label, len(own), _percent(sum(a.is_right for a in own), len(own)),
                     f'{100 * low:.0f}-{100 * high:.0f}', _percent(sum(not a.is_named for a in own), len(own)),
                     len(sure), sum(not a.is_right for a in sure)))
    return rows


def worst_objects(found: list[Answer]) -> str:
    """Return the share of right answers for each object and visible class, sorted from worst to best."""
    by_object = defaultdict(list)
    for answer in found:
        by_object[f'{answer.of.object} ({answer.of.label})'].append(answer.is_right)
    ranked = sorted(by_object.items(), key=lambda item: np.mean(item[1]))
    return ', '.join(f'{name} {_percent(sum(right), len(right))} of {len(right)}' for name, right in ranked)


def calibration(found: list[Answer]) -> tuple[float, float]:
    """Return the expected calibration error of the answers, and the mean log score of the true labels [nat]."""
    confidence = np.array([answer.found.confidence for answer in found])
    right = np.array([answer.is_right for answer in found], float)
    given = [max(float(answer.found.probabilities[Shape(answer.wanted)]), 1e-6) for answer in found]
    return calibration_error(confidence, right, BINS), float(np.log(given).mean())


def _recogniser(weights: str, network: bool):
    recogniser = make_recogniser(file=weights)
    # without the rules, only the network answers
    return recogniser._method if network else recogniser


def _percent(part: int, whole: int) -> str:
    return f'{100 * part / max(whole, 1):.0f} %'


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    for array, place in PLACES.items():
        parser.add_argument(f'--{array}', type=Path, help=f'folder with {place}')
    parser.add_argument('--blocks', type=Path, help=f'folder with {BLOCKS}')
    parser.add_argument('--labels', type=Path, default=LABELS)
    parser.add_argument('--weights', default='', help='model to use instead of config/recogniser.npz')
    parser.add_argument('--network', action='store_true', help='skip the rules that run before the network')
    args = parser.parse_args()
    every, weights = read_labels(args.labels), config_path(args.weights) if args.weights else ''
    table = Table('Real arrays', f'largest visible contact, frame by frame; sure: confidence {SURE} or more',
                  ['array', 'visible', 'frames', 'right', '95 %', 'no name', 'sure', 'sure and wrong'])
    lines = []
    for array, place in PLACES.items():
        data = getattr(args, array)
        if data is None or not (data / place).exists():
            print(f'{array}: not measured; --{array} needs a folder with {place}')
            continue
        of_array = [one for one in every if one.array == array]
        labelled = [one for one in of_array if one.label != UNDECIDABLE]
        agree = sum(one.first == one.second for one in of_array)
        found = answers(labelled, data, weights, args.network)
        for row in rows_of(array, found):
            table.add(*row)
        error, score = calibration(found)
        lines += [f'{array}: both raters agree on {agree} of {len(of_array)} frames; calibration error '
                  f'{100 * error:.1f} %, log score {score:.2f}', f'{array} by object: {worst_objects(found)}']
    if args.blocks is None or not (args.blocks / BLOCKS).exists():
        print(f'blocks: not measured; --blocks needs a folder with {BLOCKS}')
    else:
        for way, found in block_answers(read_whole_blocks(args.blocks), weights, args.network).items():
            for row in rows_of(f'blocks, {way}', found):
                table.add(*row)
    if table.rows:
        print('\n'.join([table.plain(), '', *lines]))
    return 0


if __name__ == '__main__':
    sys.exit(main())
