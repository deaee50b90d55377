"""Measure how much `tactile assess` improves recognition on real arrays, given 8 touches of each object.

    python bench/bench_assess.py --tekscan DIR --weiss DIR

Each DIR is a local copy of a repository listed in bench/bench_real_arrays.py. The script uses only labelled frames.
Each draw assesses 8 frames of each object, each from a different grasp, and evaluates the adapted recogniser on the
frames of all other grasps.
"""

import argparse
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from bench.recognition.real_frames import UNDECIDABLE, read_frames, read_labels
from tactile_node.contact.pattern import PatternExtractor
from tactile_node.learning.assess import Answers, Improvement, LabelledTouch, assess
from tactile_node.package_files import config_path
from tactile_node.shape.methods import VisibilityGuard
from tactile_node.shape.recogniser import ShapeRecogniser
from tactile_node.shape.recognition import Recognition, Shape

ARRAYS = 'tekscan', 'weiss'
TOUCHES = 8  #: Largest number of assessed frames per object.
DRAWS = 20
SEED = 46


def touch_of(frame: np.ndarray, label: str) -> LabelledTouch:
    shape = Shape.UNKNOWN if label == 'foreign' else Shape(label)
    return LabelledTouch(shape, PatternExtractor().extract(frame))


def answers_by(recogniser: ShapeRecogniser, touches: list[LabelledTouch]) -> list[Recognition]:
    guard = VisibilityGuard(recogniser)
    return [guard.recognise(touch.pattern) for touch in touches]


def drawn(rng: np.random.Generator, objects: list[str], grasps: list[str]) -> list[int]:
    """Draw up to TOUCHES frames of each object, each from a different grasp, and return their indices."""
    by_object: dict[str, dict[str, list[int]]] = defaultdict(lambda: defaultdict(list))
    for k, (name, grasp) in enumerate(zip(objects, grasps)):
        by_object[name][grasp].append(k)
    found = []
    for name in sorted(by_object):
        of_object = [by_object[name][grasp] for grasp in sorted(by_object[name])]
        found += [int(rng.choice(of_object[k])) for k in rng.permutation(len(of_object))[:TOUCHES]]
    return found


def bench(array: str, data: Path) -> str:
    labels = [one for one in read_labels() if one.array == array and one.label != UNDECIDABLE]
    frames = read_frames(array, data, [one.frame for one in labels])
    touches = [touch_of(frame, one.label) for frame, one in zip(frames, labels)]
    grasps = [one.frame.split('#')[0] for one in labels]
    recogniser = ShapeRecogniser.from_file(config_path('recogniser.npz'))
    plain = answers_by(recogniser, touches)
    results, kept, gained = [], 0, defaultdict(list)
    for draw in range(DRAWS):
        taken = drawn(np.random.default_rng([SEED, draw]), [one.object for one in labels], grasps)
        found = assess(recogniser, [touches[k] for k in taken])
        kept += found.adaptation is not None
        used = {grasps[k] for k in taken}
        left = [k for k, grasp in enumerate(grasps) if grasp not in used]
        adapted = recogniser.adapted({found.kind: found.adaptation} if found.adaptation else {})
        before = Answers([touches[k].label for k in left], [plain[k] for k in left])
        after = Answers(before.labels, answers_by(adapted, [touches[k] for k in left]))
        for k, gain in zip(left, before.scores() - after.scores()):
            gained[k].append(gain)
        results.append([(100 * counts.right / counts.total, answers.scores().mean(), counts.sure, counts.sure_and_wrong)
                        for answers in (before, after) for counts in [answers.counts()]])
    each = np.array([np.mean(of) for of in gained.values()])
    improvement = Improvement(float(each.mean()), float(each.std(ddof=1) / np.sqrt(len(each))), len(each))
    rows = ['right {:.1f} %, Brier score {:.3f}, sure {:.1f}, sure and wrong {:.1f}'.format(*row)
            for row in np.mean(results, axis=0)]
    return (f'{array}: {kept} of {DRAWS} kept, Brier score better by {improvement} over {len(each)} frames\n'
            f'  without: {rows[0]}\n  with:    {rows[1]}')


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    for array in ARRAYS:
        parser.add_argument(f'--{array}', type=Path, help='folder of the repository with these frames')
    args = parser.parse_args()
    for array in ARRAYS:
        if getattr(args, array) is not None:
            print(bench(array, getattr(args, array)), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
