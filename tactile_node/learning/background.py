"""Load the background: contacts of untaught objects, with which the heads and adaptations to a skin are fitted.

config/teach_background.npz holds contacts of the five shapes and foreign contacts. training/background.py writes it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError
from tactile_node.package_files import config_path
from tactile_node.shape.invariants import LOG_TAXELS
from tactile_node.shape.patch import SIDE, Patch
from tactile_node.shape.recogniser import KINDS, OUTPUTS, ShapeRecogniser, geometry_of, read_arrays
from tactile_node.shape.recognition import Shape

BACKGROUND_FILE = 'teach_background.npz'  #: File in config/.
LEVEL_FRACTIONS = 10  #: Number of steps from level 0 to level 1 in BACKGROUND_FILE, as in training/background.py.
FOREIGN = OUTPUTS.index(Shape.UNKNOWN)
CHUNK_PATCHES = 256  #: Number of patches processed at a time, because describe_all needs a lot of memory.


class Background(NamedTuple):
    """Contacts of untaught objects.

    ``labels``, (K,), holds indices into OUTPUTS. The index FOREIGN means none of the five shapes.
    """

    patches: list[Patch]
    labels: np.ndarray


def load_background(kind: str) -> Background:
    """Return the background contacts for one kind of frame.

    Parameters
    ----------
    kind : str
        'graded' or 'on_off'.

    Raises
    ------
    ConfigurationError
        Raised if the file cannot be used.
    """
    try:
        data = read_arrays(config_path(BACKGROUND_FILE))
        packed, unseen, labels = (data[f'{kind}_{name}'] for name in ('levels', 'unseen', 'labels'))
        levels = np.stack((packed >> 4, packed & 15), -1).reshape(-1, SIDE, SIDE) / np.float32(LEVEL_FRACTIONS)
        cells = np.unpackbits(unseen, axis=1)[:, :SIDE * SIDE].reshape(-1, SIDE, SIDE).astype(np.float32)
        patches = [Patch(level, cell, float(scale), graded=kind == 'graded')
                   for level, cell, scale in zip(levels, cells, data[f'{kind}_scales'], strict=True)]
        return Background(patches, labels.astype(int))
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise ConfigurationError(f'background, {BACKGROUND_FILE}', expected='a file written by training/background.py',
                                 got=' '.join(str(error).split()), remedy='Install the package again.') from None


class Seen(NamedTuple):
    """Embedding, size and probabilities of K patches, to which a head or an adaptation is fitted."""

    embedding: np.ndarray   #: (K, F)
    log_taxels: np.ndarray  #: (K,)
    known: np.ndarray       #: (K, 6), probabilities of OUTPUTS

    def chosen(self, which: np.ndarray) -> 'Seen':
        return Seen(*(array[which] for array in self))


def seen_by(recogniser: ShapeRecogniser, patches: Sequence[Patch]) -> Seen:
    """Return the embedding and the probabilities of patches, which must be all graded or all on/off.

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
