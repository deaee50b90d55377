"""Trains the recogniser and writes its weights: python -m training.train --output config/recogniser.npz.

Samples are drawn once into a folder (--samples) and read from there by later runs. Steps, not minutes,
bound the training, so that a run can be repeated; both networks see the same number of samples.
"""

import argparse
import json
import os
import sys
from pathlib import Path

os.environ.setdefault('OMP_NUM_THREADS', '1')

import numpy as np
import torch
from torch.nn import functional

from tactile_node.shape.recogniser import KINDS
from training.calibration import calibrated, validation
from training.model import Model
from training.pools import Part, draw_parts, read_parts
from training.samples import UNKNOWN, Samples

MIX = {'bulk': 210, 'large': 50, 'faulty': 190, 'outliers': 62}  #: of each pool in a batch
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


def fit(pools: dict[str, Samples], steps: int, seed: int, start: dict | None = None, rate: float = RATE) -> Model:
    """AdamW with a rate falling like a cosine; returns the running average of the weights."""
    geometry = np.concatenate([pool.geometry[:5000] for pool in pools.values()])
    torch.manual_seed(seed)
    model = Model(geometry.mean(0), geometry.std(0) + 1e-3)
    if start:
        model.load_state_dict(start)
    average = Model(geometry.mean(0), geometry.std(0))
    average.load_state_dict(model.state_dict())
    optimiser = torch.optim.AdamW(model.parameters(), rate, weight_decay=DECAY)
    for step, (images, geometry, labels) in zip(range(steps), batches(pools, np.random.default_rng(seed))):
        now = rate * min(1, (step + 1) / 300) * (0.5 + 0.5 * np.cos(np.pi * step / steps) + 0.005)
        optimiser.param_groups[0]['lr'] = now
        loss = loss_of(model(images, geometry), labels)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        with torch.no_grad():
            for mean, new in zip(average.parameters(), model.parameters()):
                mean.lerp_(new, 1 - min(AVERAGED, 1 - 1 / (step + 1)))
        if step % 200 == 0:
            print(f'  step {step} of {steps}, loss {loss.item():.3f}', flush=True)
    return average


def exported(model: Model, kind: str, seed: int) -> dict[str, np.ndarray]:
    """The arrays of one network with its calibration."""
    found = calibrated(validation(model, kind == 'on_off', seed))
    arrays = {f'{kind}_{name}': array for name, array in model.arrays().items()}
    return arrays | {f'{kind}_temperature': np.array(found.temperature), f'{kind}_biases': found.biases}


def main() -> int:
    args = _arguments()
    torch.set_num_threads(1)
    arrays, parts = {}, {'bulk': args.bulk, 'large': args.large, 'faulty': args.faulty, 'outliers': args.outliers}
    for kind in KINDS:
        pools = {}
        for pool, count in parts.items():
            wanted = [Part(kind, pool, number) for number in range(count)]
            for part in draw_parts(args.samples, wanted):
                print(f'{part.kind}: {part.pool} {part.number + 1} of {count}', flush=True)
            pools[pool] = read_parts(args.samples, wanted)
        print(f'{kind}: training', flush=True)
        arrays |= exported(fit(pools, args.steps, args.seed), kind, args.seed)
    arrays['about'] = np.array(json.dumps({'steps': args.steps, 'seed': args.seed, 'parts': parts}))
    np.savez_compressed(args.output, **arrays)
    print(f'{args.output}: {args.output.stat().st_size / 1e6:.2f} MB')
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split(':')[0])
    parser.add_argument('--output', type=Path, default=Path('config/recogniser.npz'))
    parser.add_argument('--samples', type=Path, default=Path('build/samples'), help='folder for drawn samples')
    parser.add_argument('--steps', type=int, default=24_000, help='batches of 512')
    parser.add_argument('--bulk', type=int, default=8, help='parts of 51,200 samples')
    parser.add_argument('--large', type=int, default=2, help='parts of 51,200 samples')
    parser.add_argument('--faulty', type=int, default=30, help='parts of 10,000 samples')
    parser.add_argument('--outliers', type=int, default=8, help='parts of 10,000 samples')
    parser.add_argument('--seed', type=int, default=1)
    return parser.parse_args()


if __name__ == '__main__':
    sys.exit(main())
