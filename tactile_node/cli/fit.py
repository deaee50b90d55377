"""`tactile fit`: fits the curves of the paper's planes and writes them with where they come from."""

import argparse
import sys

import numpy as np
import yaml

from tactile_node.errors import InputError
from tactile_node.shape.fitting import (
    AREAS,
    READINGS,
    Samples,
    draw_samples,
    fit_planes,
    recognised,
)
from tactile_node.shape.plane import Plane
from tactile_node.synthetic.seeds import Purpose, generator

HEADER = '''\
# Curves of the paper's classifier (section 7), fitted on synthetic patterns in general position.
# Written by `{command}`; do not edit.
# Curve: polynomial in u = ln(1 + horizontal), lowest power first, giving v = ln(0.01 + vertical);
# see tactile_node/shape/plane.py. Rates are the share of patterns recognised, by largest probability or by
# the curves alone; both readings of the third plane are given, the one better in training is kept.
'''
BANDS = ((15, 20), (20, 25), (25, 35), (35, 50), (50, 75), (75, 100), (100, 150), (150, 300))  #: of N


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    parser = subparsers.add_parser('fit', description=__doc__,
                                   help="fit the classifier's curves on synthetic patterns")
    parser.set_defaults(run=run)
    parser.add_argument('--patterns', type=int, default=20_000, help='training patterns, default %(default)s')
    parser.add_argument('--validation', type=int, default=5_000, help='fresh patterns, default %(default)s')
    parser.add_argument('--seed', type=int, default=0, help='default %(default)s')
    parser.add_argument('-o', '--output', default='config/volf_curves.yaml', metavar='FILE',
                        help='default %(default)s')


def run(args: argparse.Namespace) -> int:
    if min(args.patterns, args.validation) < 500 or args.seed < 0:
        raise InputError('arguments of fit', expected='at least 500 patterns of each kind and a seed >= 0',
                         got=f'--patterns {args.patterns} --validation {args.validation} --seed {args.seed}',
                         remedy='Ask for more.')
    training = _draw(Purpose.TRAINING, args.seed, args.patterns)
    validation = _draw(Purpose.VALIDATION, args.seed, args.validation)
    readings = {name: fit_planes(training, third) for name, third in READINGS.items()}
    # Chosen on the training patterns, so that the validation figure stays unbiased.
    kept = max(readings, key=lambda name: _rate(readings[name], training))
    _write(args, kept, readings, training, validation)
    print(f'third plane read as in the {kept}: {_rate(readings[kept], validation):.1%} of {args.validation} '
          f'validation patterns recognised, written to {args.output}')
    return 0


def _draw(purpose: Purpose, seed: int, patterns: int) -> Samples:
    def show(done: int) -> None:
        if done % 500 == 0 or done == patterns:
            print(f'\r{purpose.name.lower()}: {done} of {patterns} patterns',
                  end='', file=sys.stderr, flush=True)

    samples = draw_samples(generator(purpose, seed), patterns, progress=show)
    print(file=sys.stderr)
    return samples


def _rate(planes: dict[str, Plane], samples: Samples) -> float:
    return _mean(recognised(planes, samples)['most_probable'])


def _write(args, kept: str, readings: dict, training: Samples, validation: Samples) -> None:
    command = f'tactile fit --patterns {args.patterns} --validation {args.validation} --seed {args.seed}'
    right = recognised(readings[kept], validation)['most_probable']
    count = validation.of(('value', 'N'))
    data = {
        'provenance': {
            'command': command, 'training_areas': list(AREAS),
            'third_plane_readings': {name: _accuracy(planes, training, validation)
                                     for name, planes in readings.items()},
            'third_plane_kept': kept,
            'validation_by_taxels': {f'{low}-{high - 1}': _mean(right[(count >= low) & (count < high)])
                                     for low, high in BANDS}},
        'planes': {name: _plain(plane) for name, plane in readings[kept].items()}}
    try:
        with open(args.output, 'w', encoding='utf-8') as stream:
            stream.write(HEADER.format(command=command))
            yaml.safe_dump(data, stream, sort_keys=False, default_flow_style=None, width=110)
    except OSError as error:
        raise InputError(f'output {args.output!r}', expected='a file that can be written', got=error.strerror,
                         remedy='Give another path with --output.') from None


def _mean(right: np.ndarray) -> float:
    return round(float(right.mean()), 4)


def _accuracy(planes: dict[str, Plane], training: Samples, validation: Samples) -> dict[str, float]:
    return {f'{stage}_{way}': _mean(recognised(planes, samples)[way])
            for stage, samples in (('training', training), ('validation', validation))
            for way in ('most_probable', 'by_curves')}


def _plain(plane: Plane) -> dict[str, list]:
    return {name: [value if isinstance(value, str) else float(np.round(value, 9)) for value in values]
            for name, values in vars(plane).items()}
