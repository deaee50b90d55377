"""Train the anchors on our own training samples, with the pools in the same proportions."""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import torch

from bench.recognition.anchors import Cnn, ContourTrees
from training.drawn_by import claim
from training.mechanics import solution_pool
from training.pools import Part, draw_part, forms_of, read_parts
from training.samples import UNKNOWN, Samples
from training.train import MIX, PARTS

WITHOUT = frozenset({'foreign', 'noise'})  #: Pools to skip, because the anchors know only the five classes.


def train_anchors(folder: Path, share: float, epochs: float, jobs: int, say: Callable[[str], None]) -> dict[bool, list]:
    """Return the trained CNN and trees, in a dict with the keys True for on/off frames and False for pressures.

    Parameters
    ----------
    folder : Path
        Folder of the training samples. The function draws missing samples.
    share : float
        Share of the largest pool to train on.
    epochs : float
        Number of training epochs for the CNN.
    jobs : int
        Number of processes. With 2 processes, both kinds of frames are trained at the same time.
    say : Callable[[str], None]
        Function that prints a progress message.
    """
    if not any(folder.glob('*')):
        claim(folder)
    parts = parts_of(share)
    say(f'training the anchors on {sum(parts.values())} parts of training for each kind of frame ('
        f'{", ".join(f"{name} {count}" for name, count in parts.items())}), the CNN for {epochs:g} epochs')
    forms_of(folder, 'blemish')  # both kinds of frames share these pools, so make them before the processes start
    solution_pool(folder.parent / 'mechanics')
    kinds, of_each = (True, False), (folder, share, epochs)
    if jobs < 2:
        return {on_off: trained(on_off, *of_each) for on_off in kinds}
    with ProcessPoolExecutor(2, get_context('spawn')) as pool:
        return dict(zip(kinds, pool.map(trained, kinds, *([value] * 2 for value in of_each))))


def parts_of(share: float) -> dict[str, int]:
    """Return the number of parts per pool, at least 1, in the proportions of a batch in our training."""
    known = {name: size for name, size in MIX.items() if name not in WITHOUT}
    most = max(known, key=lambda name: known[name])
    unit = share * PARTS[most] / known[most]
    return {name: int(np.clip(round(unit * size), 1, PARTS[name])) for name, size in known.items()}


def trained(on_off: bool, folder: Path, share: float, epochs: float) -> list:
    """Return the CNN and the trees for one kind of frames."""
    torch.set_num_threads(1)
    samples = anchor_samples(on_off, folder, share)
    return [Cnn(samples, epochs), ContourTrees(samples, not on_off)]


def anchor_samples(on_off: bool, folder: Path, share: float) -> Samples:
    """Return the training samples of the five classes."""
    wanted = [Part('on_off' if on_off else 'graded', pool, number)
              for pool, count in parts_of(share).items() for number in range(count)]
    for part in wanted:
        draw_part(folder, part)
    samples = read_parts(folder, wanted)
    return Samples(*(array[samples.labels != UNKNOWN] for array in samples))
