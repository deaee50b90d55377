"""Trains the recogniser and writes its weights: python -m training.train --output config/recogniser.npz.

Samples are drawn once into a folder (--samples) and read from there by later runs of the same code. Steps, not minutes,
bound the training, so that a run can be repeated: same seed, same machine, same file.
"""

import argparse
import copy
import json
import multiprocessing
import os
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault('OMP_NUM_THREADS', '1')

import numpy as np
import torch
from torch.nn import functional

from tactile_node.package_files import package_version
from tactile_node.shape.recogniser import KINDS
from training.calibration import calibrated, validation, validation_solutions
from training.drawn_by import claim
from training.mechanics import solution_pool
from training.model import Model
from training.pools import FORMS, Part, draw_parts, forms_of, read_parts
from training.samples import UNKNOWN, Samples

#: of each pool: parts of about 10,000 samples, and samples in a batch
PARTS = {'bulk': 28, 'large': 12, 'faulty': 22, 'foreign': 16, 'blemish': 7, 'mechanics': 14, 'noise': 3,
         'hidden': 12, 'real': 30}
MIX = {'bulk': 150, 'large': 60, 'faulty': 130, 'foreign': 112, 'blemish': 40, 'mechanics': 70, 'noise': 12,
       'hidden': 50, 'real': 200}
SHARED = *FORMS, 'indenters', 'indenters of validation'  #: what both networks are trained on, drawn first
STEPS = 16_000
FOREIGN_WEIGHT = 0.5
RATE, DECAY, AVERAGED = 2e-3, 1e-3, 0.998


def batches(pools: dict[str, Samples], rng: np.random.Generator):
    """Yield images, geometry and labels of one batch after the other."""
    while True:
        chosen = [(pools[name], rng.integers(len(pools[name].labels), size=size)) for name, size in MIX.items()]
        images, geometry = zip(*(pool.inputs(which) for pool, which in chosen))
        labels = np.concatenate([pool.labels[which] for pool, which in chosen])
        yield tuple(map(torch.as_tensor, (np.concatenate(images), np.concatenate(geometry), labels)))


def loss_of(found: torch.Tensor, labels: torch.Tensor) -> torch.Tensor:
    """Log-loss of the class of known shapes, and of being known or not."""
    known = labels != UNKNOWN
    foreign = functional.binary_cross_entropy_with_logits(found[:, UNKNOWN], (~known).float())
    return functional.cross_entropy(found[known, :UNKNOWN], labels[known]) + FOREIGN_WEIGHT * foreign


def fit(pools: dict[str, Samples], steps: int, seed: int, progress: Callable[[int, float], None],
        start: Model | None = None) -> Model:
    """AdamW with a rate falling like a cosine; returns the running average of the weights.

    ``start``: a trained network to continue from, at half of the rate.
    """
    geometry = np.concatenate([pool.geometry[:5000] for pool in pools.values()])
    torch.manual_seed(seed)
    model = start or Model(geometry.mean(0), geometry.std(0) + 1e-3)
    model, average = (each.to(memory_format=torch.channels_last) for each in (model, copy.deepcopy(model)))
    rate = RATE / 2 if start else RATE
    optimiser = torch.optim.AdamW(model.parameters(), rate, weight_decay=DECAY)
    for step, (images, geometry, labels) in zip(range(steps), batches(pools, np.random.default_rng(seed))):
        now = rate * min(1, (step + 1) / 300) * (0.5 + 0.5 * np.cos(np.pi * step / steps) + 0.005)
        optimiser.param_groups[0]['lr'] = now
        loss = loss_of(model(images.contiguous(memory_format=torch.channels_last), geometry), labels)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        with torch.no_grad():
            torch._foreach_lerp_(list(average.parameters()), list(model.parameters()),
                                 1 - min(AVERAGED, 1 - 1 / (step + 1)))
        if step % 1000 == 0:
            progress(step, loss.item())
    return average


def exported(model: Model, kind: str, seed: int, folder: Path) -> dict[str, np.ndarray]:
    """The arrays of one network with its calibration."""
    found = calibrated(validation(model, kind == 'on_off', seed, folder))
    arrays = {f'{kind}_{name}': array for name, array in model.arrays().items()}
    return arrays | {f'{kind}_temperature': np.array(found.temperature), f'{kind}_biases': found.biases}


def trained(kind: str, args: argparse.Namespace) -> tuple[dict[str, np.ndarray], dict]:
    """Draw, train and calibrate one network; its arrays and what is to be said about it."""
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    began, pools = time.monotonic(), {}
    for pool, count in PARTS.items():
        wanted = [Part(kind, pool, number) for number in range(max(1, round(count * args.share)))]
        for part in draw_parts(args.samples, wanted):
            _say(began, f'{part.kind}: {part.pool} {part.number + 1} of {len(wanted)}')
        pools[pool] = read_parts(args.samples, wanted)
    model = _fitted(pools, kind, args, lambda step, loss: _say(began, f'{kind}: step {step}, loss {loss:.3f}'))
    arrays = exported(model, kind, args.seed, args.samples.parent / 'mechanics')
    _say(began, f'{kind}: done')
    return arrays, {name: len(pool.labels) for name, pool in pools.items()}


def _fitted(pools: dict[str, Samples], kind: str, args: argparse.Namespace, progress) -> Model:
    """Train, or read what a run before has trained on the samples of this folder: calibration can be repeated."""
    path = args.samples / f'{kind}_{args.steps}_{args.seed}_{args.share:g}.pt'
    if not path.exists():
        start = Model.from_arrays(dict(np.load(args.start)), kind) if args.start else None
        torch.save(fit(pools, args.steps, args.seed, progress, start), path)
    return torch.load(path, weights_only=False)


def _shared(name: str, samples: Path) -> int:
    """Draw what both networks are trained on, where it is not there yet; how much there is."""
    began, folder = time.monotonic(), samples.parent / 'mechanics'
    if name in FORMS:
        count = len(forms_of(samples, name).labels)
    else:
        count = len((solution_pool if name == 'indenters' else validation_solutions)(folder))
    _say(began, f'{name}: {count}')
    return count


def main() -> int:
    args = _arguments()
    claim(args.samples)
    with ProcessPoolExecutor(args.jobs, multiprocessing.get_context('spawn')) as jobs:
        drawn = dict(zip(SHARED, jobs.map(_shared, SHARED, [args.samples] * len(SHARED))))
        found = list(jobs.map(trained, args.kinds, [args] * len(args.kinds)))
    arrays = dict(np.load(args.start)) if args.start else {}
    about = {'code': _code(), 'seed': args.seed, 'steps': args.steps, 'figures and indenters': drawn,
             'samples': {kind: counts for kind, (_, counts) in zip(args.kinds, found)}, 'mix': MIX}
    if args.start:
        about['continues'] = json.loads(str(arrays.pop('about')))
    arrays |= {name: array for of_kind, _ in found for name, array in of_kind.items()}
    np.savez_compressed(args.output, **arrays, about=np.array(json.dumps(about)))
    print(f'{args.output}: {args.output.stat().st_size / 1e6:.2f} MB, {json.dumps(about)}')
    return 0


def _code() -> str:
    """Version of the package, and commit where there is one, marked where the working tree differs."""
    described = subprocess.run(['git', 'describe', '--always', '--dirty', '--exclude', '*'], capture_output=True,
                               text=True, cwd=Path(__file__).parent)
    return ' '.join([package_version(), *described.stdout.split()])


def _say(began: float, what: str) -> None:
    print(f'{(time.monotonic() - began) / 60:6.1f} min  {what}', flush=True)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split(':')[0])
    parser.add_argument('--output', type=Path, default=Path('config/recogniser.npz'))
    parser.add_argument('--samples', type=Path, default=Path('build/samples'), help='folder for drawn samples')
    parser.add_argument('--steps', type=int, default=STEPS, help=f'batches of {sum(MIX.values())}')
    parser.add_argument('--share', type=float, default=1.0, help='of the samples, for a short trial')
    parser.add_argument('--jobs', type=int, default=1, help='2: train both networks at the same time')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--start', type=Path, help='weights to continue from, in place of random ones')
    parser.add_argument('--kinds', nargs='+', choices=KINDS, default=KINDS, help='others stay as in --start')
    return parser.parse_args()


if __name__ == '__main__':
    sys.exit(main())
