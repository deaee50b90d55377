"""Draw the training samples in parts with fixed seeds, and store them so that later trainings can reuse them."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from tactile_node.shape.patch import joined
from training.batch import MEMORY, TRIANGLES, draw_forms, draw_many
from training.forms import ALL, Forms, stored_forms
from training.ground_truth.seeds import Purpose, generator
from training.hidden import draw_hidden
from training.mechanics import draw_mechanics, solution_pool
from training.noise import draw_noise
from training.real_arrays import draw_real
from training.samples import SMALLEST, UNKNOWN, Samples, draw, joined_samples, samples_from
from training.segmentation import pattern_beside

#: Smallest and largest area of the contacts and side of the pad [taxels]. The entries are used in turn.
BULK = {'on_off': ((7, 60, 30), (7, 30, 22), (30, 75, 30)), 'graded': ((7, 60, 30), (7, 30, 22))}
LARGE = ((30, 110, 30), (60, 300, 46), (300, 4300, 68), (60, 110, 36))

#: Smallest and largest area of the figures, side of the pad [taxels], and share of the samples.
FOREIGN_AREAS = ((14, 40, 24, 0.12), (40, 110, 34, 0.55), (110, 400, 54, 0.26), (400, 3000, 70, 0.07))
BLEMISH_AREAS = ((16, 60, 30, 0.1), (60, 150, 36, 0.45), (150, 400, 52, 0.37), (400, 3000, 70, 0.08))

#: Areas [taxels] of contacts computed by contact mechanics: the usual range, and the range for larger contacts.
MECHANICS_AREAS = (8.0, 130.0), (60.0, 600.0)
WIDE = 0.2  #: Fraction of the contacts computed by contact mechanics that are drawn from the second range.

#: Fraction of the blemished figures whose blemish is so large that they are foreign.
FOREIGN_BLEMISHES = 0.35
FORMS = {'foreign': 4000, 'blemish': 1600}  #: Number of figures drawn for each pool.
FORMS_SEED = 700_000
KIND_SEED = {'on_off': 500_000, 'graded': 600_000}

#: Seed of the first part of each pool, relative to the seed of the kind.
FIRST = {'bulk': 0, 'large': 10_000, 'faulty': 20_000, 'foreign': 40_000, 'blemish': 50_000, 'noise': 60_000,
         'mechanics': 70_000, 'hidden': 80_000, 'real': 90_000}
PART = 10_000  #: Approximate number of samples in a part.


class Part(NamedTuple):
    """One file of samples.

    Attributes
    ----------
    kind : str
        'graded' or 'on_off'.
    pool : str
        One of the keys of FIRST. The pool ``large`` has contacts of 30 to 4,300 taxels, and each sample of ``faulty``
        has one or two faults. The pools ``foreign`` and ``blemish`` contain figures from training/forms.py. The
        contacts in ``mechanics`` are computed by contact mechanics, and those in ``hidden`` are partly visible. The
        pool ``real`` imitates contacts on real arrays.
    number : int
        Number of the part within its pool.
    """

    kind: str
    pool: str
    number: int

    def path(self, folder: Path) -> Path:
        """Return the path of the file in ``folder``."""
        return folder / f'{self.kind}_{self.pool}_{self.number}.npz'

    def draw(self, folder: Path) -> Samples:
        """Draw the samples of this part.

        Parameters
        ----------
        folder : Path
            Folder for the pools of figures. A missing pool is drawn first.

        Returns
        -------
        Samples
            About PART samples.
        """
        rng = generator(Purpose.TRAINING, KIND_SEED[self.kind] + FIRST[self.pool] + self.number)
        on_off = self.kind == 'on_off'
        if self.pool in ('bulk', 'large'):
            return _contacts(rng, on_off, BULK[self.kind] if self.pool == 'bulk' else LARGE)
        if self.pool in ALL:
            return _figures(rng, on_off, self.pool, forms_of(folder, self.pool))
        if self.pool == 'mechanics':
            return _mechanics(rng, on_off, folder)
        if self.pool == 'noise':
            return joined_samples(draw_noise(rng, PART // 40, on_off) for _ in range(40))
        if self.pool == 'hidden':
            return draw_hidden(rng, PART, on_off)
        if self.pool == 'real':
            return draw_real(rng, PART, on_off, forms_of(folder, 'foreign'))
        return draw(rng, PART, on_off, faulty=1.0, outliers=0.0)


def forms_of(folder: Path, pool: str) -> Forms:
    """Return the labelled figures of a pool.

    The triangles of the foreign families are left out, because their angles are arbitrary.

    Parameters
    ----------
    folder : Path
        Folder with the pool. If the folder holds no pool, a pool is drawn first.
    pool : str
        'foreign' or 'blemish'.
    """
    forms = stored_forms(folder, pool, ALL[pool], FORMS[pool], FORMS_SEED + FIRST[pool])
    triangle = np.isin(forms.labels, TRIANGLES) & (pool == 'foreign')
    return forms.chosen((forms.labels >= 0) & ~triangle)


def _contacts(rng, on_off: bool, areas) -> Samples:
    drawn, count = [], 0
    while count < PART:
        low, high, pad = areas[len(drawn) % len(areas)]
        drawn.append(draw_many(rng, min(256, MEMORY // pad ** 2), on_off, (low, high), pad=pad))
        count += len(drawn[-1].labels)
    return joined_samples(drawn)


def _figures(rng, on_off: bool, pool: str, forms: Forms) -> Samples:
    """Draw about PART samples from the figures of a pool.

    All foreign figures are equally probable. Among the blemished figures, the five shapes are equally probable.
    """
    if pool == 'blemish':
        share = np.append(np.full(UNKNOWN, 1 - FOREIGN_BLEMISHES) / UNKNOWN, FOREIGN_BLEMISHES)
        weight = (share / np.maximum(np.bincount(forms.labels, minlength=UNKNOWN + 1), 1))[forms.labels]
    else:
        weight = np.ones(len(forms.labels))
    drawn = []
    for low, high, pad, share in FOREIGN_AREAS if pool == 'foreign' else BLEMISH_AREAS:
        left, each = int(PART * share), min(128, MEMORY // pad ** 2)
        while left > 0:
            which = rng.choice(len(weight), each, p=weight / weight.sum())
            area = np.exp(rng.uniform(np.log(low), np.log(high), each))
            drawn.append(draw_forms(rng, forms.chosen(which), area, on_off, pad=pad))
            left -= each
    return joined_samples(drawn)


def _mechanics(rng, on_off: bool, folder: Path) -> Samples:
    solutions, found = solution_pool(folder.parent / 'mechanics'), []
    while len(found) < PART:
        drawn = draw_mechanics(rng, PART // 4, on_off, solutions, MECHANICS_AREAS[rng.random() < WIDE])
        patterns = [pattern_beside(rng, frame, on_off) for frame in drawn.frames]
        found += [(pattern, joined(pattern), label) for pattern, label in zip(patterns, drawn.labels)
                  if pattern.mask.sum() >= SMALLEST]
    return samples_from(found)


def draw_part(folder: Path, part: Part) -> None:
    """Draw ``part`` and store it in ``folder``, unless the folder already holds it."""
    folder.mkdir(parents=True, exist_ok=True)
    if not part.path(folder).exists():
        unfinished = part.path(folder).with_suffix('.part.npz')
        np.savez(unfinished, **part.draw(folder)._asdict())
        unfinished.rename(part.path(folder))


def read_parts(folder: Path, parts: list[Part]) -> Samples:
    """Return the samples of all ``parts`` stored in ``folder``."""
    loaded = []
    for part in parts:
        with np.load(part.path(folder)) as data:
            loaded.append(Samples(**data))
    return joined_samples(loaded)
