"""How fast the features are, beside the plain by-definition computation, timed in the same run.

Run from the checkout: python bench/bench_features.py
Processor time on one core (the linear algebra libraries are held to one thread, which for matrices this small
is their fastest), so that other work on the machine counts as little as it can. Ratios are of the best of
several runs on either side; a frame's cost is given as median and best.
"""

import os
import sys
from pathlib import Path
from time import process_time

os.environ['OPENBLAS_NUM_THREADS'] = '1'  # read when numpy is imported
sys.path[:0] = [str(Path(__file__).resolve().parents[1]), str(Path(__file__).resolve().parents[1] / 'test')]

import by_definition
import numpy as np
from patterns import rotated_patterns

from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.helmholtz.features import Group, compute_features
from tactile_node.helmholtz.operators import Stencil, border, matrix
from tactile_node.package_files import config_path
from tactile_node.shape.volf import GROUPS, VolfClassifier
from tactile_node.simulator.world import CLASSES, Purpose, generator, random_pattern

TAXELS = 100


def milliseconds(function, *arguments, repeat: int) -> tuple[float, float]:
    """Best and median processor time of one call."""
    times = []
    for _ in range(repeat):
        begin = process_time()
        function(*arguments)
        times.append(process_time() - begin)
    return min(times) * 1e3, float(np.median(times)) * 1e3


def all_matrices(mask: np.ndarray) -> list[np.ndarray]:
    """The six dense matrices at 46 angles, so that the dense solver can be timed alone."""
    patterns = [taken for rotated in rotated_patterns(mask)
                for taken in (rotated, *(border(rotated, stencil) for stencil in Stencil))]
    return [matrix(taken, stencil).toarray() for taken in patterns if taken.any() for stencil in Stencil]


def dense_eigenvalues(matrices: list[np.ndarray]) -> list[float]:
    return [np.linalg.eigvalsh(matrix)[0] for matrix in matrices]


def whole_set(masks: dict[str, np.ndarray]) -> None:
    """All features, beside by_definition's nested loops, dense matrices and dense eigenvalues."""
    print(f'{"pattern":20}{"N":>5}{"by definition":>15}{"ours":>8}{"ratio":>8}'
          f'{"its dense eigenvalues alone":>30}{"ratio":>8}')
    ratios = []
    for shape, mask in masks.items():
        plain, _ = milliseconds(by_definition.over_rotations, mask, repeat=2)
        ours, _ = milliseconds(compute_features, mask, repeat=21)
        dense, _ = milliseconds(dense_eigenvalues, all_matrices(mask), repeat=3)
        ratios.append(plain / ours)
        print(f'{shape:20}{mask.sum():5}{plain:15.0f}{ours:8.2f}{plain / ours:8.0f}'
              f'{dense:30.0f}{dense / ours:8.1f}')
    print(f'Least ratio {min(ratios):.0f}; required: 100\n')


def by_part(masks: dict[str, np.ndarray]) -> None:
    """What a frame costs, by how much is computed."""
    classifier = VolfClassifier.from_file(config_path('volf_curves.yaml'))
    for text, function in {
            "the classifier's own features": lambda mask: compute_features(mask, GROUPS),
            'everything but eigenvalues': lambda mask: compute_features(mask, Group.ALL & ~Group.EIGENVALUES),
            'frame -> pattern -> features -> shape': lambda mask: classifier.recognise(compute_features(
                PatternExtractor(PressThresholds(0.5, 0.4)).extract(mask).mask, GROUPS))}.items():
        best, median = np.transpose([milliseconds(function, mask, repeat=301) for mask in masks.values()])
        print(f'{text:40}{np.median(median):8.2f} ms a frame (five shapes: {min(median):.2f} to {max(median):.2f}); '
              f'at best {np.median(best):.2f}')
    print("Required: the classifier's own features within 1 ms")


def main() -> None:
    rng = generator(Purpose.EVALUATION, 100)
    masks = {shape: random_pattern(rng, shape, TAXELS) for shape in CLASSES}
    compute_features(masks['circle'])
    print(f'Patterns of about {TAXELS} taxels at 46 angles; processor time in ms of one thread, best runs')
    whole_set(masks)
    by_part(masks)


if __name__ == '__main__':
    main()
