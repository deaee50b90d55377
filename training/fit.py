"""Train one network of the recogniser. An interrupted training can be resumed and gives the same result."""

import copy
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from training.model import TorchModel
from training.samples import UNKNOWN, Samples

#: Number of samples from each pool in a batch.
MIX = {'bulk': 150, 'large': 60, 'faulty': 130, 'foreign': 112, 'blemish': 40, 'mechanics': 70, 'noise': 12,
       'hidden': 50, 'real': 200}
FOREIGN_WEIGHT = 0.5  #: Weight of the loss term that separates known and foreign shapes.

#: Peak learning rate, weight decay, and largest decay factor of the averaged weights.
RATE, DECAY, AVERAGED = 2e-3, 1e-3, 0.998

#: Attributes of `Fit` whose state is written to disk.
STATES = 'model', 'average', 'optimiser'


def batches(pools: dict[str, Samples], rng: np.random.Generator):
    """Yield an endless series of batches, each with images, geometry and labels.

    The samples of each batch are chosen at random. MIX gives the number of samples from each pool.

    Parameters
    ----------
    pools : dict of str to Samples
        Samples of each pool in MIX.
    rng : np.random.Generator
        Random generator that chooses the samples.

    Yields
    ------
    tuple of torch.Tensor
        Images (K, 2, SIDE, SIDE), geometry (K, COUNT) and labels (K,).
    """
    while True:
        chosen = [(pools[name], rng.integers(len(pools[name].labels), size=size)) for name, size in MIX.items()]
        images, geometry = zip(*(pool.inputs(which) for pool, which in chosen))
        labels = np.concatenate([pool.labels[which] for pool, which in chosen])
        yield tuple(map(torch.as_tensor, (np.concatenate(images), np.concatenate(geometry), labels)))


def loss_of(found: torch.Tensor, labels: torch.Tensor) -> torch.Tensor:
    """Return the loss of a batch.

    The loss has two terms: the cross-entropy over the known classes, and a weighted cross-entropy for the decision
    between known and foreign shapes.

    Parameters
    ----------
    found : torch.Tensor
        Logits of the network, (K, UNKNOWN + 1).
    labels : torch.Tensor
        Correct labels, (K,).

    Returns
    -------
    torch.Tensor
        The loss, a scalar.
    """
    known = labels != UNKNOWN
    foreign = functional.binary_cross_entropy_with_logits(found[:, UNKNOWN], (~known).float())
    return functional.cross_entropy(found[known, :UNKNOWN], labels[known]) + FOREIGN_WEIGHT * foreign


class Fit:
    """A training in progress.

    The optimiser is AdamW. The learning rate rises linearly during the first 300 steps and follows a
    cosine decay.

    Parameters
    ----------
    pools : dict of str to Samples
        Samples of each pool in MIX.
    steps : int
        Number of steps in the whole training.
    seed : int
        Seed for the initial weights and the batches.

    Attributes
    ----------
    done : int
        Number of completed steps.
    model : TorchModel
        The network being trained.
    average : TorchModel
        A copy of the network with the running average of the weights. This copy is the result of the training.
    """

    def __init__(self, pools: dict[str, Samples], steps: int, seed: int):
        geometry = np.concatenate([pool.geometry[:5000] for pool in pools.values()])
        torch.manual_seed(seed)
        self.steps, self.done, self.rng = steps, 0, np.random.default_rng(seed)
        self.batches = batches(pools, self.rng)
        model = TorchModel(geometry.mean(0), geometry.std(0) + 1e-3)
        self.model, self.average = (each.to(memory_format=torch.channels_last)
                                    for each in (model, copy.deepcopy(model)))
        self.optimiser = torch.optim.AdamW(self.model.parameters(), RATE, weight_decay=DECAY)

    def step(self) -> float:
        """Train on one batch and return its loss."""
        images, geometry, labels = next(self.batches)
        rate = RATE * min(1, (self.done + 1) / 300) * (0.5 + 0.5 * np.cos(np.pi * self.done / self.steps) + 0.005)
        self.optimiser.param_groups[0]['lr'] = rate
        loss = loss_of(self.model(images.contiguous(memory_format=torch.channels_last), geometry), labels)
        self.optimiser.zero_grad()
        loss.backward()
        self.optimiser.step()
        with torch.no_grad():
            torch._foreach_lerp_(list(self.average.parameters()), list(self.model.parameters()),
                                 1 - min(AVERAGED, 1 - 1 / (self.done + 1)))
        self.done += 1
        return loss.item()

    def write(self, path: Path) -> None:
        """Write the complete state of the training to a file, so that the training can be resumed.

        The file replaces the previous one only after it is complete.
        """
        unfinished = path.with_suffix('.unfinished')
        torch.save({'done': self.done, 'generator': self.rng.bit_generator.state,
                    **{name: getattr(self, name).state_dict() for name in STATES}}, unfinished)
        unfinished.rename(path)

    def read(self, path: Path) -> None:
        """Restore the state of the training from a file written by `write`."""
        kept = torch.load(path, weights_only=False)
        self.done, self.rng.bit_generator.state = kept['done'], kept['generator']
        for name in STATES:
            getattr(self, name).load_state_dict(kept[name])
