"""What taught shapes are distinguished from: patches of the five shapes and of foreign contacts.

The file is written by training/background.py, from what the networks were trained on.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError
from tactile_node.package_files import config_path
from tactile_node.shape.patch import SIDE, Patch
from tactile_node.shape.recogniser import OUTPUTS, read_arrays
from tactile_node.shape.recognition import Shape

FILE = 'teach_background.npz'  #: in config/
STEPS = 10                     #: of a level 1, as training/background.py writes them
FOREIGN = OUTPUTS.index(Shape.UNKNOWN)


class Background(NamedTuple):
    """``labels`` index OUTPUTS, (K,): FOREIGN is none of the five."""

    patches: list[Patch]
    labels: np.ndarray


def load_background(kind: str, path: str | Path = FILE) -> Background:
    """Return the patches of one kind of frames, 'graded' or 'on_off'. Raises ConfigurationError for another file."""
    try:
        data = read_arrays(config_path(str(path)))
        packed, unseen, labels = (data[f'{kind}_{name}'] for name in ('levels', 'unseen', 'labels'))
        levels = np.stack((packed >> 4, packed & 15), -1).reshape(-1, SIDE, SIDE) / np.float32(STEPS)
        cells = np.unpackbits(unseen, axis=1)[:, :SIDE * SIDE].reshape(-1, SIDE, SIDE).astype(np.float32)
        patches = [Patch(level, cell, float(scale), graded=kind == 'graded')
                   for level, cell, scale in zip(levels, cells, data[f'{kind}_scales'], strict=True)]
        return Background(patches, labels.astype(int))
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise ConfigurationError(f'background, {path}', expected='a file written by training/background.py',
                                 got=' '.join(str(error).split()), remedy='Install the package again.') from None
