"""Fit the head of the taught shapes: a multinomial logistic regression on the embedding of the networks.

All other classes together have the logit 0. Some foreign contacts of the background may have the same shape as a taught
object, for example a cross if a cross is taught. A first fit identifies these contacts, and a second fit excludes them.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from tactile_node.errors import ConfigurationError
from tactile_node.package_files import config_path
from tactile_node.shape.invariants import LOG_TAXELS
from tactile_node.shape.patch import SIDE, Patch
from tactile_node.shape.recogniser import KINDS, OUTPUTS, ShapeRecogniser, geometry_of, read_arrays
from tactile_node.shape.recognition import Shape
from tactile_node.shape.taught import Head
from tactile_node.taxel_frame import read_only

BACKGROUND_FILE = 'teach_background.npz'  #: File in config/.
LEVEL_FRACTIONS = 10  #: Number of steps from level 0 to level 1 in BACKGROUND_FILE, as in training/background.py.
FOREIGN = OUTPUTS.index(Shape.UNKNOWN)


class Background(NamedTuple):
    """Contacts of untaught objects.

    ``labels``, (K,), holds indices into OUTPUTS. The index FOREIGN means none of the five shapes.
    """

    patches: list[Patch]
    labels: np.ndarray


def load_background(kind: str, path: str | Path = BACKGROUND_FILE) -> Background:
    """Return the background contacts for one kind of frame.

    Parameters
    ----------
    kind : str
        'graded' or 'on_off'.
    path : str or Path
        The file.

    Raises
    ------
    ConfigurationError
        Raised if the file cannot be used.
    """
    try:
        data = read_arrays(config_path(str(path)))
        packed, unseen, labels = (data[f'{kind}_{name}'] for name in ('levels', 'unseen', 'labels'))
        levels = np.stack((packed >> 4, packed & 15), -1).reshape(-1, SIDE, SIDE) / np.float32(LEVEL_FRACTIONS)
        cells = np.unpackbits(unseen, axis=1)[:, :SIDE * SIDE].reshape(-1, SIDE, SIDE).astype(np.float32)
        patches = [Patch(level, cell, float(scale), graded=kind == 'graded')
                   for level, cell, scale in zip(levels, cells, data[f'{kind}_scales'], strict=True)]
        return Background(patches, labels.astype(int))
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise ConfigurationError(f'background, {path}', expected='a file written by training/background.py',
                                 got=' '.join(str(error).split()), remedy='Install the package again.') from None


#: Penalty on the weights. The constants from RIDGE_WEIGHT to LARGER_SIZE were chosen on validation touches.
RIDGE_WEIGHT = 1e-3
EXAMPLE_SHARE = 0.25  #: Weight of all examples of one shape, as a share of the background's weight.
FOREIGN_WEIGHT = 0.5  #: Weight of a foreign contact.
SMALLER_SIZE = 0.8    #: Smallest recognised number of taxels, as a multiple of the smallest taught number.
LARGER_SIZE = 1.25    #: Largest recognised number of taxels, as a multiple of the largest taught number.
MOST_ITERATIONS = 200
CHUNK_PATCHES = 256  #: Number of patches processed at a time, because describe_all needs a lot of memory.


class Seen(NamedTuple):
    """The input of a head for K patches."""

    embedding: np.ndarray   #: (K, F)
    log_taxels: np.ndarray  #: (K,)
    known: np.ndarray       #: (K, 6), probabilities of OUTPUTS

    def chosen(self, which: np.ndarray) -> 'Seen':
        return Seen(*(array[which] for array in self))


def seen_by(recogniser: ShapeRecogniser, patches: Sequence[Patch]) -> Seen:
    """Return the input of a head for patches, which must be all graded or all on/off.

    If there are no patches, the arrays have the width 0.
    """
    if not patches:
        return Seen(np.zeros((0, 0)), np.zeros(0), np.zeros((0, 0)))
    kind = KINDS[patches[0].graded]
    parts = []
    for first in range(0, len(patches), CHUNK_PATCHES):
        chunk = patches[first:first + CHUNK_PATCHES]
        geometry = geometry_of(chunk)
        embedding, log_taxels = recogniser.embedding(chunk, geometry), geometry[:, LOG_TAXELS]
        parts.append((embedding, log_taxels, recogniser.known(kind, embedding, log_taxels)))
    return Seen(*(np.concatenate(arrays) for arrays in zip(*parts)))


def fit_head(background: Seen, labels: np.ndarray, shapes: Sequence[Seen]) -> Head:
    """Return the head for the taught shapes. The head never reports a shape without examples.

    Parameters
    ----------
    background : Seen
        Background contacts.
    labels : np.ndarray
        Label of each background contact, (K,).
    shapes : sequence of Seen
        Examples of each taught shape.
    """
    middle, spread = background.embedding.mean(0), background.embedding.std(0) + 1e-3
    head = Head(np.zeros((len(middle), len(shapes))), np.zeros(len(shapes)), middle, spread,
                np.array([_sizes(each) for each in shapes]))
    counts = [len(labels), *(len(each.log_taxels) for each in shapes)]
    inputs = np.concatenate([head.standard(each.embedding) for each in (background, *shapes) if len(each.log_taxels)])
    targets = np.repeat(np.arange(len(counts)), counts)
    of_background = np.where(labels == FOREIGN, FOREIGN_WEIGHT, 1.0)
    weights = np.concatenate([of_background, *(np.full(count, EXAMPLE_SHARE * of_background.sum() / max(count, 1))
                                               for count in counts[1:])])
    head = _fitted(head, inputs, targets, weights)
    is_alike = (head.standard(background.embedding) @ head.weights + head.biases > 0).any(1) & (labels == FOREIGN)
    weights[:len(labels)][is_alike] = 0.0
    found = _fitted(head, inputs, targets, weights)
    return Head(*(read_only(np.asarray(array, np.float32)) for array in found))


def _sizes(seen: Seen) -> tuple[float, float]:
    if not len(seen.log_taxels):
        return 1.0, 0.0
    return float(seen.log_taxels.min() + np.log(SMALLER_SIZE)), float(seen.log_taxels.max() + np.log(LARGER_SIZE))


def _fitted(head: Head, inputs: np.ndarray, targets: np.ndarray, weights: np.ndarray) -> Head:
    """Return the head after a fit that starts from ``head``."""
    inputs = np.column_stack((inputs, np.ones(len(inputs))))
    count = head.weights.shape[1]
    is_target = targets[:, None] == np.arange(1, count + 1)
    share = weights / weights.sum()
    rows = np.arange(len(targets))

    def loss(flat: np.ndarray) -> tuple[float, np.ndarray]:
        matrix = flat.reshape(-1, count)
        logits = np.column_stack((np.zeros(len(inputs)), inputs @ matrix))
        logits -= logits.max(1, keepdims=True)
        odds = np.exp(logits)
        total = odds.sum(1)
        ridge = RIDGE_WEIGHT * matrix
        ridge[-1] = 0
        value = share @ (np.log(total) - logits[rows, targets]) + (ridge * matrix).sum() / 2
        slope = inputs.T @ ((odds[:, 1:] / total[:, None] - is_target) * share[:, None]) + ridge
        return float(value), slope.reshape(-1)

    start = np.vstack((head.weights, head.biases)).reshape(-1)
    found = minimize(loss, start, jac=True, method='L-BFGS-B', options={'maxiter': MOST_ITERATIONS}).x
    found = found.reshape(-1, count)
    return head._replace(weights=found[:-1], biases=found[-1])
