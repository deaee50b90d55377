"""How fast the features are, beside the plain by-definition computation, timed in the same run.

Run from the checkout: python bench/bench_features.py
"""

import sys
from pathlib import Path
from time import perf_counter

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[1]), str(Path(__file__).resolve().parents[1] / 'test')]

import by_definition

from tactile_node.config import config_path
from tactile_node.contact.pattern import PatternExtractor
from tactile_node.helmholtz.features import Group, compute_features
from tactile_node.helmholtz.operators import Stencil, border, matrix
from tactile_node.helmholtz.rotation import turned_patterns
from tactile_node.shape.volf import GROUPS, VolfClassifier
from tactile_node.synthetic.seeds import Purpose, generator
from tactile_node.synthetic.world import CLASSES, random_pattern

TAXELS = 100


def seconds(function, *arguments, repeat: int = 1) -> float:
    """Median time of one call [s]."""
    times = []
    for _ in range(repeat):
        begin = perf_counter()
        function(*arguments)
        times.append(perf_counter() - begin)
    return float(np.median(times))


def all_matrices(mask: np.ndarray) -> list[np.ndarray]:
    """The six dense matrices at 46 angles, so that the dense solver can be timed alone."""
    patterns = [taken for turned in turned_patterns(mask)
                for taken in (turned, *(border(turned, stencil) for stencil in Stencil))]
    return [matrix(taken, stencil).toarray() for taken in patterns if taken.any() for stencil in Stencil]


def dense_eigenvalues(matrices: list[np.ndarray]) -> list[float]:
    return [np.linalg.eigvalsh(matrix)[0] for matrix in matrices]


def main() -> None:
    rng = generator(Purpose.EVALUATION, 100)
    masks = {shape: random_pattern(rng, shape, TAXELS) for shape in CLASSES}
    classifier = VolfClassifier.from_file(config_path('volf_curves.yaml'))
    compute_features(masks['circle'])
    print(f'Patterns of about {TAXELS} taxels at 46 angles, times in ms (median of a pattern)')
    print(f'{"pattern":20}{"N":>5}{"by definition":>15}{"ours":>8}{"ratio":>8}'
          f'{"its dense eigenvalues alone":>30}{"ratio":>8}')
    for shape, mask in masks.items():
        plain, ours = seconds(by_definition.over_turns, mask), seconds(compute_features, mask, repeat=21)
        dense = seconds(dense_eigenvalues, all_matrices(mask), repeat=3)
        print(f'{shape:20}{mask.sum():5}{plain * 1e3:15.0f}{ours * 1e3:8.2f}{plain / ours:8.0f}'
              f'{dense * 1e3:30.0f}{dense / ours:8.1f}')
    print()
    for text, function in {
            "the classifier's own features": lambda mask: compute_features(mask, GROUPS),
            'everything but eigenvalues': lambda mask: compute_features(mask, Group.ALL & ~Group.EIGENVALUES),
            'frame -> pattern -> features -> shape': lambda mask: classifier.recognise(compute_features(
                PatternExtractor(0.5, 0.4).extract(mask).mask, GROUPS))}.items():
        each = [seconds(function, mask, repeat=101) * 1e3 for mask in masks.values()]
        print(f'{text:40}{np.median(each):8.2f} ms a frame (five shapes: {min(each):.2f} to {max(each):.2f})')


if __name__ == '__main__':
    main()
