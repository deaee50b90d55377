"""Fit the curves of the paper's planes, and write them with their provenance. Run ``python -m training.fit_curves``.

For `method: volf`, the option `--curves` of `tactile classify` and the parameter ``model`` of the classifier node name
this file.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import yaml
from tqdm import tqdm

from tactile_node.output_file import output_file
from tactile_node.shape.volf import ANSWERS, TAXEL_BANDS, VolfClassifier
from training.curve_fitting import AREAS, COLUMNS, READINGS, Samples, draw_samples, fit_classifier, recognised
from training.ground_truth.seeds import Purpose, generator

LEAST_PATTERNS = 500
HEADER = '''\
# Curves of the paper's classifier (section 7), fitted on synthetic patterns in general position.
# Written by `{command}`; do not edit.
# A curve is a chain of straight lines on the axes u = ln(1 + horizontal) (knots), v = ln(0.01 + vertical)
# (levels), see tactile_node/shape/volf.py. Shares: how often each class (circle last, in the order of
# the answers) was the truth where the curves gave an answer, a row a band of N, on training patterns.
# Rates are the share of patterns recognised by the curves alone and by the largest share; both readings of
# the third plane are given, the one better in training is kept.
'''


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split(':')[0])
    parser.add_argument('--patterns', type=int, default=20_000, help='training patterns, default %(default)s')
    parser.add_argument('--validation', type=int, default=5_000, help='fresh patterns, default %(default)s')
    parser.add_argument('--seed', type=int, default=0, help='default %(default)s')
    parser.add_argument('--output', type=Path, default=Path('config/volf_curves.yaml'), help='default %(default)s')
    args = parser.parse_args()
    if min(args.patterns, args.validation) < LEAST_PATTERNS:
        parser.error(f'at least {LEAST_PATTERNS} patterns of each kind')
    training = _draw(Purpose.TRAINING, args.seed, args.patterns)
    validation = _draw(Purpose.VALIDATION, args.seed, args.validation)
    readings = {name: fit_classifier(training, third) for name, third in READINGS.items()}
    # the choice uses only the training patterns, so that the validation figure stays unbiased
    kept = max(readings, key=lambda name: recognised(readings[name], training)['by_curves'].mean())
    _write(args, kept, readings, training=training, validation=validation)
    rate = recognised(readings[kept], validation)['most_probable'].mean()
    print(f'third plane read as in the {kept}: {rate:.1%} of {args.validation} '
          f'validation patterns recognised, written to {args.output}')
    return 0


def _draw(purpose: Purpose, seed: int, patterns: int) -> Samples:
    with tqdm(desc=purpose.name.lower(), total=patterns, unit=' patterns') as bar:
        return draw_samples(generator(purpose, seed), patterns, progress=lambda done: bar.update(done - bar.n))


def _write(args, kept: str, readings: dict, training: Samples, validation: Samples) -> None:
    command = (f'python -m training.fit_curves --patterns {args.patterns} --validation {args.validation} '
               f'--seed {args.seed}')
    data = {
        'provenance': {
            'command': command, 'training_areas': list(AREAS),
            'third_plane_readings': {name: _accuracy(classifier, training, validation)
                                     for name, classifier in readings.items()},
            'third_plane_kept': kept,
            'validation_by_taxels': _by_band(readings[kept], validation)},
        'planes': {name: {key: list(value) if isinstance(value[0], str) else np.round(value, 6).tolist()
                          for key, value in vars(plane).items()}
                   for name, plane in readings[kept].planes.items()},
        'shares': {shape.value: np.round(readings[kept].shares[:, index], 4).tolist()
                   for index, shape in enumerate(ANSWERS)}}
    with output_file(args.output) as stream:
        text = yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=110)
        stream.write((HEADER.format(command=command) + text).encode())


def _by_band(classifier: VolfClassifier, samples: Samples) -> dict[str, float]:
    """Return the share of patterns that the curves recognise in each band of N."""
    right, count = recognised(classifier, samples)['by_curves'], samples.of(COLUMNS[0])
    bands = zip(TAXEL_BANDS, (*TAXEL_BANDS[1:], np.inf))
    return {f'from {low}': _mean(right[(count >= low) & (count < high)]) for low, high in bands}


def _mean(right: np.ndarray) -> float:
    return round(float(right.mean()), 4) if len(right) else float('nan')


def _accuracy(classifier: VolfClassifier, training: Samples, validation: Samples) -> dict[str, float]:
    stages = {'training': training, 'validation': validation}
    return {f'{stage}_{way}': _mean(right) for stage, samples in stages.items()
            for way, right in recognised(classifier, samples).items()}


if __name__ == '__main__':
    sys.exit(main())
