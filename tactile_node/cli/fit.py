"""`tactile fit`: fits the curves of the paper's planes and writes them with where they come from."""

import argparse

import numpy as np
import yaml

from tactile_node.cli.options import add_output_option
from tactile_node.cli.progress import counted
from tactile_node.errors import InputError
from tactile_node.output_file import check_writable, output_file
from tactile_node.package_files import is_shipped
from tactile_node.shape.volf import ANSWERS, BANDS, VolfClassifier
from tactile_node.synthetic.seeds import Purpose, generator
from tactile_node.teaching.curve_fitting import (
    AREAS,
    COLUMNS,
    READINGS,
    Samples,
    draw_samples,
    fit_classifier,
    recognised,
)

HEADER = '''\
# Curves of the paper's classifier (section 7), fitted on synthetic patterns in general position.
# Written by `{command}`; do not edit.
# A curve is a chain of straight lines on the axes u = ln(1 + horizontal) (knots), v = ln(0.01 + vertical)
# (levels), see tactile_node/shape/plane.py. Shares: how often each class (circle last, in the order of
# the answers) was the truth where the curves gave an answer, a row a band of N, on training patterns.
# Rates are the share of patterns recognised by the curves alone and by the largest share; both readings of
# the third plane are given, the one better in training is kept.
'''


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    parser = subparsers.add_parser('fit', description=__doc__)
    parser.set_defaults(run=run)
    parser.add_argument('--patterns', type=int, default=20_000, help='training patterns, default %(default)s')
    parser.add_argument('--validation', type=int, default=5_000, help='fresh patterns, default %(default)s')
    parser.add_argument('--seed', type=int, default=0, help='default %(default)s')
    add_output_option(parser, default='volf_curves.yaml', metavar='FILE',
                        help='default %(default)s; never a file that the package ships. Use it by --curves of '
                             'classify, or parameter model of the classifier node (method: volf)')


def run(args: argparse.Namespace) -> int:
    if min(args.patterns, args.validation) < 500 or args.seed < 0:
        raise InputError('arguments of fit', expected='at least 500 patterns of each kind and a seed >= 0',
                         got=f'--patterns {args.patterns} --validation {args.validation} --seed {args.seed}',
                         remedy='Ask for more.')
    if is_shipped(args.output):  # the published curves must stay what they are
        raise InputError(f'output {args.output!r}', expected='a file of your own', got='a file of the package',
                         remedy='Give another path with --output.')
    check_writable(args.output, force=args.force)
    training = _draw(Purpose.TRAINING, args.seed, args.patterns)
    validation = _draw(Purpose.VALIDATION, args.seed, args.validation)
    readings = {name: fit_classifier(training, third) for name, third in READINGS.items()}
    # Chosen on the training patterns, so that the validation figure stays unbiased.
    kept = max(readings, key=lambda name: recognised(readings[name], training)['by_curves'].mean())
    _write(args, kept, readings, training=training, validation=validation)
    rate = recognised(readings[kept], validation)['most_probable'].mean()
    print(f'third plane read as in the {kept}: {rate:.1%} of {args.validation} '
          f'validation patterns recognised, written to {args.output}')
    return 0


def _draw(purpose: Purpose, seed: int, patterns: int) -> Samples:
    with counted(purpose.name.lower(), ' patterns', patterns) as bar:
        return draw_samples(generator(purpose, seed), patterns, progress=lambda done: bar.update(done - bar.n))


def _write(args, kept: str, readings: dict, training: Samples, validation: Samples) -> None:
    command = f'tactile fit --patterns {args.patterns} --validation {args.validation} --seed {args.seed}'
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
    """Share recognised by the curves in each band of N."""
    right, count = recognised(classifier, samples)['by_curves'], samples.of(COLUMNS[0])
    bands = zip(BANDS, (*BANDS[1:], np.inf))
    return {f'from {low}': _mean(right[(count >= low) & (count < high)]) for low, high in bands}


def _mean(right: np.ndarray) -> float:
    return round(float(right.mean()), 4) if len(right) else float('nan')


def _accuracy(classifier: VolfClassifier, training: Samples, validation: Samples) -> dict[str, float]:
    stages = {'training': training, 'validation': validation}
    return {f'{stage}_{way}': _mean(right) for stage, samples in stages.items()
            for way, right in recognised(classifier, samples).items()}
