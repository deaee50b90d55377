"""Training samples on disk: drawn once, in parts of known seed, then read again by every training."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tactile_node.synthetic.seeds import Purpose, generator
from training.batch import draw_many
from training.samples import Samples, draw

BULK_AREAS = {'on_off': ((7, 60), (7, 30), (30, 75)), 'graded': ((7, 60), (7, 30))}
LARGE_AREAS = ((30, 110),)
BATCH, BATCHES, SLOW = 256, 200, 10_000
KIND_SEED = {'on_off': 500_000, 'graded': 600_000}
FIRST = {'bulk': 0, 'large': 10_000, 'faulty': 20_000, 'outliers': 40_000}  #: seeds of a kind's parts start here


class Part(NamedTuple):
    """One file of samples; ``pool``: bulk, large (bulk of 30 to 110 taxels), faulty (one or two faults each,
    all areas) or outliers."""

    kind: str
    pool: str
    number: int

    def path(self, folder: Path) -> Path:
        return folder / f'{self.kind}_{self.pool}_{self.number}.npz'

    def draw(self) -> Samples:
        rng = generator(Purpose.TRAINING, KIND_SEED[self.kind] + FIRST[self.pool] + self.number)
        on_off = self.kind == 'on_off'
        if self.pool in ('bulk', 'large'):
            areas = BULK_AREAS[self.kind] if self.pool == 'bulk' else LARGE_AREAS
            return joined_samples(draw_many(rng, BATCH, on_off, areas[k % len(areas)]) for k in range(BATCHES))
        outliers = self.pool == 'outliers'
        return draw(rng, SLOW, on_off, faulty=0.3 if outliers else 1.0, outliers=float(outliers))


def draw_parts(folder: Path, parts: list[Part]) -> Iterator[Part]:
    """Draw those of ``parts`` that ``folder`` does not hold yet; yield each when it is there."""
    folder.mkdir(parents=True, exist_ok=True)
    for part in parts:
        if not part.path(folder).exists():
            unfinished = part.path(folder).with_suffix('.part.npz')
            np.savez(unfinished, **part.draw()._asdict())
            unfinished.rename(part.path(folder))
        yield part


def read_parts(folder: Path, parts: list[Part]) -> Samples:
    loaded = []
    for part in parts:
        with np.load(part.path(folder)) as data:
            loaded.append(Samples(**data))
    return joined_samples(loaded)


def joined_samples(several) -> Samples:
    return Samples(*map(np.concatenate, zip(*several)))
