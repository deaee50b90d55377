"""Train the recogniser and write its weights: python -m training.train --output config/recogniser.npz.

The program draws the samples once and stores them in a folder (--samples). The state of the training is stored in the
same folder, and an interrupted training resumes from there. The length of a training is set in steps instead of
minutes. The same commit, seed and machine therefore produce the same file.
"""

import argparse
import json
import multiprocessing
import os
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

os.environ.setdefault('OMP_NUM_THREADS', '1')

import numpy as np
import torch

from tactile_node.errors import ConfigurationError
from tactile_node.package_files import package_version
from tactile_node.shape.recogniser import KINDS
from training.calibration import calibrated, validation, validation_solutions
from training.drawn_by import claim
from training.fit import MIX, Fit
from training.mechanics import solution_pool
from training.model import TorchModel
from training.pools import FORMS, Part, draw_part, forms_of, read_parts

#: Number of parts in each pool. A part has about 10,000 samples.
PARTS = {'bulk': 24, 'large': 10, 'faulty': 18, 'foreign': 14, 'blemish': 6, 'mechanics': 12, 'noise': 2,
         'hidden': 10, 'real': 28}

#: Figures and indenters that both networks need. They are drawn before the samples.
SHARED = *FORMS, 'indenters', 'indenters of validation'
STEPS = 24_000
KEPT = 1000  #: Number of steps between two saved states of a training.
SHIPPED = Path('config/recogniser.npz')


def exported(model: TorchModel, kind: str, seed: int, folder: Path) -> dict[str, np.ndarray]:
    """Return the weights and the calibration of one network.

    Parameters
    ----------
    model : TorchModel
        The trained network.
    kind : str
        'graded' or 'on_off'.
    seed : int
        Seed for the validation contacts.
    folder : Path
        Folder with the solved indenters.

    Returns
    -------
    dict of str to np.ndarray
        Arrays for the weights file. Each name begins with the kind.
    """
    found = calibrated(validation(model, kind == 'on_off', seed, folder))
    arrays = {f'{kind}_{name}': array for name, array in model.arrays().items()}
    return arrays | {f'{kind}_temperature': np.array(found.temperature), f'{kind}_biases': found.biases}


def trained(kind: str, args: argparse.Namespace) -> tuple[dict[str, np.ndarray], dict[str, int]]:
    """Train and calibrate one network.

    If the folder of the samples holds the state of an interrupted training, the training resumes from that state.

    Parameters
    ----------
    kind : str
        'graded' or 'on_off'.
    args : argparse.Namespace
        Arguments of the command line.

    Returns
    -------
    arrays : dict of str to np.ndarray
        Weights and calibration of the network.
    counts : dict of str to int
        Number of samples in each pool.
    """
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    began, of_kind = time.monotonic(), [part for part in parts(args.share) if part.kind == kind]
    pools = {pool: read_parts(args.samples, [part for part in of_kind if part.pool == pool]) for pool in PARTS}
    fit, path = Fit(pools, args.steps, args.seed), args.samples / f'{kind}_{args.steps}_{args.seed}_{args.share:g}.pt'
    if path.exists():
        fit.read(path)
    while fit.done < args.steps:
        loss = fit.step()
        if fit.done % KEPT == 0 or fit.done == args.steps:
            fit.write(path)
            _say(began, f'{kind}: step {fit.done} of {args.steps}, loss {loss:.3f}')
    arrays = exported(fit.average, kind, args.seed, args.samples.parent / 'mechanics')
    _say(began, f'{kind}: done')
    return arrays, {name: len(pool.labels) for name, pool in pools.items()}


def parts(share: float) -> list[Part]:
    """Return the parts needed for both networks. The parts that take longest to draw come first.

    Parameters
    ----------
    share : float
        Share of the parts of each pool. Every pool has at least one part.
    """
    return [Part(kind, pool, number) for pool, count in reversed(PARTS.items())
            for number in range(max(1, round(count * share))) for kind in KINDS]


def _shared(name: str, samples: Path) -> int:
    """Draw the figures or indenters called ``name`` if they are not stored yet, and return their number."""
    began, folder = time.monotonic(), samples.parent / 'mechanics'
    if name in FORMS:
        count = len(forms_of(samples, name).labels)
    else:
        count = len((solution_pool if name == 'indenters' else validation_solutions)(folder))
    _say(began, f'{name}: {count}')
    return count


def main() -> int:
    """Draw the samples, train both networks and write their weights."""
    args = _arguments()
    code = _code()
    if code.endswith('dirty') and args.output == SHIPPED:
        raise ConfigurationError('the working tree', expected='a commit, so that the file can be reproduced',
                                 got=code, remedy='Commit the changes, or give another --output.')
    claim(args.samples)
    began, wanted = time.monotonic(), parts(args.share)
    with ProcessPoolExecutor(args.jobs, multiprocessing.get_context('spawn')) as jobs:
        drawn = dict(zip(SHARED, jobs.map(_shared, SHARED, [args.samples] * len(SHARED))))
        drawing = [jobs.submit(draw_part, args.samples, part) for part in wanted]
        for number, each in enumerate(as_completed(drawing), 1):
            each.result()
            _say(began, f'{number} of {len(wanted)} parts drawn')
        found = list(jobs.map(trained, KINDS, [args] * len(KINDS)))
    about = {'code': code, 'torch': torch.__version__, 'seed': args.seed, 'steps': args.steps, 'mix': MIX,
             'figures and indenters': drawn, 'samples': {kind: counts for kind, (_, counts) in zip(KINDS, found)}}
    arrays = {name: array for of_kind, _ in found for name, array in of_kind.items()}
    np.savez_compressed(args.output, **arrays, about=np.array(json.dumps(about)))
    print(f'{args.output}: {args.output.stat().st_size / 1e6:.2f} MB, {json.dumps(about)}')
    return 0


def _code() -> str:
    """Return the version of the package and, in a repository, the commit.

    The commit ends with '-dirty' if the working tree has uncommitted changes.
    """
    described = subprocess.run(['git', 'describe', '--always', '--dirty', '--exclude', '*'], capture_output=True,
                               text=True, cwd=Path(__file__).parent)
    return ' '.join([package_version(), *described.stdout.split()])


def _say(began: float, what: str) -> None:
    print(f'{(time.monotonic() - began) / 60:6.1f} min  {what}', flush=True)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split(':')[0])
    parser.add_argument('--output', type=Path, default=SHIPPED)
    parser.add_argument('--samples', type=Path, default=Path('build/samples'), help='folder for drawn samples')
    parser.add_argument('--steps', type=int, default=STEPS, help=f'batches of {sum(MIX.values())}')
    parser.add_argument('--share', type=float, default=1.0, help='share of the samples to use, for a short trial')
    parser.add_argument('--jobs', type=int, default=1, help='processes; 2 trains both networks at once')
    parser.add_argument('--seed', type=int, default=1)
    return parser.parse_args()


if __name__ == '__main__':
    sys.exit(main())
