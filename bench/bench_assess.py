"""Measure how much `tactile assess` improves recognition on real arrays, given 8 touches of each object.

    python bench/bench_assess.py --tekscan DIR --weiss DIR --vitac DIR --blocks DIR

Each DIR is a local copy of a repository listed in bench/bench_real_arrays.py. The script uses only labelled frames.
Each draw assesses 8 frames of each object, each from a different grasp, and evaluates the adapted recogniser on the
frames of all other grasps. For ``--single``, each draw assesses 8 frames of a single shape. The evaluation then shows
what the adaptation does to the other shapes. The blocks are the only object on their array, and an idle frame precedes
each of their frames.
"""

import argparse
import sys
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from bench.recognition.readings import after_idle
from bench.recognition.real_frames import BLOCK_PAD, UNDECIDABLE, read_frames, read_labels, read_whole_blocks
from tactile_node.contact.pattern import PatternExtractor
from tactile_node.learning.assess import Answers, Improvement, LabelledTouch, assess
from tactile_node.package_files import config_path
from tactile_node.shape.methods import VisibilityGuard
from tactile_node.shape.recogniser import ShapeRecogniser
from tactile_node.shape.recognition import Recognition, Shape

ARRAYS = 'tekscan', 'weiss', 'vitac'
SINGLE = {'tekscan': ('rectangle', 'circle'), 'weiss': ('rectangle', 'circle'), 'vitac': ('rectangle',)}
IDLE = np.zeros(BLOCK_PAD)  #: Frame of the blocks' array without a contact.
TOUCHES = 8  #: Largest number of assessed frames per object.
DRAWS = 20
SEED = 46


class Recorded(NamedTuple):
    """A frame of a recording."""

    touch: LabelledTouch
    object: str  #: name of the object
    grasp: str   #: name of the grasp; frames of the same grasp are alike


def recorded(array: str, data: Path) -> list[Recorded]:
    """Return the labelled frames with a contact on an array."""
    labels = [one for one in read_labels() if one.array == array and one.label not in (UNDECIDABLE, Shape.NONE.value)]
    frames = read_frames(array, data, [one.frame for one in labels])
    return [Recorded(LabelledTouch(Shape.UNKNOWN if one.label == 'foreign' else Shape(one.label),
                                   PatternExtractor().extract(frame)), one.object, one.frame.split('#')[0])
            for frame, one in zip(frames, labels)]


def recorded_blocks(data: Path) -> list[Recorded]:
    patterns = after_idle(read_whole_blocks(data), lambda: IDLE)
    return [Recorded(LabelledTouch(Shape.SQUARE, pattern), 'block', str(number))
            for number, pattern in enumerate(patterns)]


def answers_by(recogniser: ShapeRecogniser, touches: list[LabelledTouch]) -> list[Recognition]:
    guard = VisibilityGuard(recogniser)
    return [guard.recognise(touch.pattern) for touch in touches]


def drawn(rng: np.random.Generator, objects: list[str], grasps: list[str]) -> list[int]:
    """Draw up to TOUCHES frames of each object, each from a different grasp, and return their indices.

    An empty name of an object leaves the frame out.
    """
    by_object: dict[str, dict[str, list[int]]] = defaultdict(lambda: defaultdict(list))
    for k, (name, grasp) in enumerate(zip(objects, grasps)):
        if name:
            by_object[name][grasp].append(k)
    found = []
    for name in sorted(by_object):
        of_object = [by_object[name][grasp] for grasp in sorted(by_object[name])]
        found += [int(rng.choice(of_object[k])) for k in rng.permutation(len(of_object))[:TOUCHES]]
    return found


def bench(title: str, frames: list[Recorded], only: str = '') -> str:
    """Return the results of all draws. If ``only`` names a shape, only touches of this shape are assessed."""
    touches = [one.touch for one in frames]
    grasps = [one.grasp for one in frames]
    objects = [one.object if not only else only if one.touch.label.value == only else '' for one in frames]
    recogniser = ShapeRecogniser.from_file(config_path('recogniser.npz'))
    plain = answers_by(recogniser, touches)
    labels = sorted({touch.label for touch in touches}, key=lambda label: label.value)
    results, kept, gained = [], 0, defaultdict(list)
    for draw in range(DRAWS):
        taken = drawn(np.random.default_rng([SEED, draw]), objects, grasps)
        found = assess(recogniser, [touches[k] for k in taken])
        kept += found.adaptation is not None
        used = {grasps[k] for k in taken}
        left = [k for k, grasp in enumerate(grasps) if grasp not in used]
        adapted = recogniser.adapted({found.kind: found.adaptation} if found.adaptation else {})
        before = Answers([touches[k].label for k in left], [plain[k] for k in left])
        after = Answers(before.labels, answers_by(adapted, [touches[k] for k in left]))
        for k, gain in zip(left, before.scores() - after.scores()):
            gained[k].append(gain)
        results.append([[(100 * counts.right / max(counts.total, 1), counts.sure, counts.sure_and_wrong)
                         for label in (None, *labels) for counts in [answers.counts(label)]]
                        for answers in (before, after)])
    each = np.array([np.mean(of) for of in gained.values()])
    improvement = Improvement(float(each.mean()), float(each.std(ddof=1) / np.sqrt(len(each))), len(each))
    lines = [f'{title}: {kept} of {DRAWS} kept, Brier score better by {improvement} over {len(each)} frames']
    for label, before, after in zip(('all', *(label.value for label in labels)), *np.mean(results, axis=0)):
        lines.append('  {:<20}right {:.1f} -> {:.1f} %, sure {:.1f} -> {:.1f}, sure and wrong {:.1f} -> {:.1f}'.format(
            label, *(number for pair in zip(before, after) for number in pair)))
    return '\n'.join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    for array in (*ARRAYS, 'blocks'):
        parser.add_argument(f'--{array}', type=Path, help='folder of the repository with these frames')
    parser.add_argument('--single', action='store_true', help='assess touches of a single shape')
    args = parser.parse_args()
    if args.blocks is not None:
        print(bench('8x16, one block', recorded_blocks(args.blocks)), flush=True)
    for array in ARRAYS:
        if getattr(args, array) is None:
            continue
        frames = recorded(array, getattr(args, array))
        for only in SINGLE[array] if args.single else ('',):
            print(bench(f'{array}, only {only}' if only else array, frames, only), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
