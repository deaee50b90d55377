"""Reproduce the figures and the claims of the paper, as a page and as CSV files: `make reproduce`.

    python bench/reproduce.py --output DIR [--patterns N] [--training N] [--seed N] [--jobs N] [--curves FILE]
"""

import argparse
import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from bench.reproduction.experiments import measure
from bench.reproduction.page import PAGE_FILE, TABLES, write_page
from tactile_node.cli.options import add_output_option
from tactile_node.errors import InputError, TactileError
from tactile_node.output_file import check_new
from tactile_node.package_files import config_path
from tactile_node.shape.volf import VolfClassifier

LEAST_TRAINING = 600


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_output_option(parser, type=Path, required=True, metavar='DIR', help='folder, created if it does not exist')
    parser.add_argument('--patterns', type=int, default=2000, metavar='N',
                        help='number of new patterns at each size, default %(default)s')
    parser.add_argument('--training', type=int, default=12_000, metavar='N',
                        help='number of patterns to fit the curves and the learner, default %(default)s')
    parser.add_argument('--seed', type=int, default=0, help='seed of the patterns, default %(default)s')
    parser.add_argument('--jobs', type=int, default=os.cpu_count() or 1,
                        help='number of processes, default %(default)s')
    parser.add_argument('--curves', default='volf_curves.yaml', metavar='FILE',
                        help='curves of the published method, default config/%(default)s')
    try:
        return run(parser.parse_args(argv))
    except TactileError as error:
        print(f'reproduce: error: {error}', file=sys.stderr)
        return 2


def run(args: argparse.Namespace) -> int:
    if args.patterns < 15 or args.training < LEAST_TRAINING or args.seed < 0 or args.jobs < 1:
        raise InputError('arguments of reproduce', expected='--patterns >= 15, --seed >= 0, --jobs >= 1 and '
                         f'--training >= {LEAST_TRAINING}', got=f'--patterns {args.patterns} --seed {args.seed} '
                         f'--jobs {args.jobs} --training {args.training}', remedy='Give larger numbers.')
    classifier = VolfClassifier.from_file(config_path(args.curves))
    args.output.mkdir(parents=True, exist_ok=True)
    for name in (PAGE_FILE, *TABLES):
        check_new(args.output / name, force=args.force)

    command = f'python bench/reproduce.py --patterns {args.patterns} --training {args.training} --seed {args.seed}'
    results = measure(classifier, patterns=args.patterns, training=args.training, seed=args.seed, jobs=args.jobs)
    print(*write_page(args.output, results, command), sep='\n')
    return 0


if __name__ == '__main__':
    sys.exit(main())
