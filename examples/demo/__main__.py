"""Press all five shapes onto a simulated skin of two pads, and show the result of each stage: `make demo`.

    python -m examples.demo [--output DIR] [--areas N ...] [--seed N]
"""

import argparse
import shutil
import sys
from pathlib import Path

from examples.demo import report
from examples.demo.picture import draw_pad
from examples.demo.session import DemoSession
from examples.demo.touches import PADS
from tactile_node.cli.options import add_output_option
from tactile_node.errors import ConfigurationError, TactileError
from tactile_node.interruption import ignore_interruptions
from tactile_node.output_file import check_new

PICTURE = 'touches_{pad}.png'
NOT_EMPTY = 'The pads were not reported as empty before the first touch'
MADE = ('bag', 'can.log', 'touches.csv', *(PICTURE.format(pad=pad) for pad in PADS))


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog='demo', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    add_output_option(parser, type=Path, default=Path('demo_output'), help='folder for bag, log, pictures and table')
    parser.add_argument('--areas', type=float, nargs='+', default=(25.0, 40.0, 60.0), metavar='N',
                        help='areas with which each shape touches [taxels] (default: 25 40 60)')
    parser.add_argument('--seed', type=int, default=2026, help='seed of the touches (default: 2026)')
    try:
        return run(parser.parse_args(argv))
    except TactileError as error:
        print(f'demo: error: {error}', file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130


def run(args: argparse.Namespace) -> int:
    for name in MADE:
        check_new(args.output / name, force=args.force)
    folder = _emptied(args.output)
    with DemoSession(folder, args.seed, args.areas) as session:
        session.play()
    verdicts = session.verdicts()
    if verdicts:
        report.write_csv(verdicts, folder / 'touches.csv')
        for pad in PADS:
            if of_pad := [verdict for verdict in verdicts if verdict.pad == pad]:
                draw_pad(of_pad, session.pitch, folder / PICTURE.format(pad=pad))
        print(report.table(verdicts))
    return _conclude(folder, session, verdicts)


def _emptied(folder: Path) -> Path:
    """Delete the results of an earlier run from ``folder``, keep all other files, and return ``folder``."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(folder / 'bag', ignore_errors=True)
        for name in MADE:
            if (folder / name).is_file():
                (folder / name).unlink()
    except OSError as error:
        raise ConfigurationError(f'--output {folder}', expected='a writable folder', got=str(error),
                                 remedy='Name another folder.') from error
    return folder


def _conclude(folder: Path, session: DemoSession, verdicts: list) -> int:
    """Print where the results are, and return 0 if every touch has a verdict and every result exists."""
    print(f'\n{report.score(verdicts)}\n{report.speed(session.performance)}\n'
          f'{session.watcher.incomplete} taxel frames incomplete.')
    if not session.began_empty:
        print(f'{NOT_EMPTY}.')
    missing = [name for name in MADE if not (folder / name).exists()]
    if session.recorded == 0:
        missing.append('messages in the bag')
    if len(verdicts) < session.touches:
        missing.append(f'{session.touches - len(verdicts)} of {session.touches} touches on the shape topic')
    if missing:
        print(f'Missing: {", ".join(missing)}. Try it again when two cores are idle.')
        return 1
    print(f'In {folder}/: ' + ', '.join(MADE) + f' ({session.recorded} messages in the bag).')
    return 0


if __name__ == '__main__':
    try:
        sys.exit(main())
    finally:
        ignore_interruptions()  # a second Ctrl-C must not make a clean exit look like a crash
