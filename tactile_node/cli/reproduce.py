"""`tactile reproduce`: the paper's figures re-drawn, its claims re-measured, as a page and as CSV."""

import argparse
import os
from contextlib import closing
from pathlib import Path

from tactile_node.cli.options import add_output_option
from tactile_node.cli.progress import Stages
from tactile_node.errors import InputError
from tactile_node.output_file import check_new
from tactile_node.package_files import config_path
from tactile_node.shape.volf import VolfClassifier

LEAST_TRAINING = 600


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    parser = subparsers.add_parser('reproduce', description=__doc__)
    parser.set_defaults(run=run)
    add_output_option(parser, required=True, metavar='DIR', help='made where it does not exist')
    parser.add_argument('--patterns', type=int, default=2000, metavar='N',
                        help='fresh patterns at each size, default %(default)s')
    parser.add_argument('--training', type=int, default=12_000, metavar='N',
                        help='patterns for the curves fitted again and for the learner, default %(default)s')
    parser.add_argument('--seed', type=int, default=0, help='default %(default)s')
    parser.add_argument('--jobs', type=int, default=os.cpu_count() or 1, help='processes, default %(default)s')
    parser.add_argument('--curves', default='volf_curves.yaml', metavar='FILE',
                        help="the published method's curves, default config/%(default)s")


def run(args: argparse.Namespace) -> int:
    if args.patterns < 15 or args.training < LEAST_TRAINING or args.seed < 0 or args.jobs < 1:
        raise InputError('arguments of reproduce', expected='--patterns >= 15, --seed >= 0, --jobs >= 1 and '
                         f'--training >= {LEAST_TRAINING}', got=f'--patterns {args.patterns} --seed {args.seed} '
                         f'--jobs {args.jobs} --training {args.training}', remedy='Ask for more.')
    classifier = VolfClassifier.from_file(config_path(args.curves))
    folder = _folder(args.output)
    # Here, so that without matplotlib the reason is given before the work is done, and help needs none of it.
    from tactile_node.reproduction.experiments import measure
    from tactile_node.reproduction.page import PAGE_FILE, TABLES, write_page
    for name in (PAGE_FILE, *TABLES):
        check_new(folder / name, force=args.force)

    command = f'tactile reproduce --patterns {args.patterns} --training {args.training} --seed {args.seed}'
    with closing(Stages()) as stages:
        results = measure(classifier, patterns=args.patterns, training=args.training, seed=args.seed, jobs=args.jobs,
                          progress=stages.show)
        stages.show('drawing the figures')
        written = write_page(folder, results, command)
    print(*written, sep='\n')
    return 0


def _folder(path: str) -> Path:
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f'output {path!r}', expected='a folder that can be made', got=error.strerror or str(error),
                         remedy='Give another path with --output.') from None
    return Path(path)

