"""Read frames of real arrays from local copies of their public repositories.

This repository stores only the labels of the frames.

A label names the largest visible contact. Two raters (vision models) labelled the frames independently, from pictures
without names. The file bench/recognition/labels/real_arrays.csv contains the labels. The frames of the square block
need no raters, because a camera measured where the block lay.
"""

import bz2
import csv
import io
import json
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

TEKSCAN = 'Tactile_Images_Dataset.zip'  #: In TaISLab/CNN-based-Methods-for-Tactile-Object-Recognition.
WEISS = 'python/classification/training_grasp_profiles_thesis'  #: In peter-kiechle/tactile-sensors.
VITAC = 'Data'        #: In jsheng45/ViTac-Tactile-Sensing.
VITAC_PAD = (12, 32)  #: Number of rows and columns of a frame.
BLOCKS = 'ROS2/block_position_prediction/data_set'  #: In aidanmohammed-ali/Tactile-Skin, branch Applications.
BLOCK_PAD = (8, 16)   #: Number of rows and columns of a frame.

#: Numbers of rows and columns of the Weiss hand's pads, in the order in which a frame contains the pads.
PADS = ((14, 6), (13, 6)) * 3
LABELS = Path(__file__).parent / 'labels' / 'real_arrays.csv'
UNDECIDABLE = 'undecidable'


class Labelled(NamedTuple):
    """The name of one frame with the labels from two raters."""

    array: str   #: tekscan, weiss or vitac
    frame: str   #: name of the file, with `#pad` appended for the Weiss hand and `#frame` for ViTac
    first: str
    second: str

    @property
    def object(self) -> str:
        # the name of the cover serves as the object for ViTac
        return self.frame.split('/')[1 if self.array == 'vitac' else -2]

    @property
    def label(self) -> str:
        """The label that both raters gave, or UNDECIDABLE if their labels differ."""
        return self.first if self.first == self.second else UNDECIDABLE


def read_labels(path: Path = LABELS) -> list[Labelled]:
    lines = path.read_text(encoding='utf-8').splitlines()
    return [Labelled(**row) for row in csv.DictReader(line for line in lines if not line.startswith('#'))]


def read_frames(array: str, data: Path, names: list[str]) -> Iterator[np.ndarray]:
    """Yield the frames with these ``names`` as float arrays (rows, cols) [counts]. Raises FileNotFoundError."""
    if array == 'tekscan':
        with zipfile.ZipFile(data / TEKSCAN) as images:
            for name in names:
                yield np.asarray(Image.open(io.BytesIO(images.read(name))).convert('L'), float)
        return
    for name in names:
        file, number = name.split('#')
        if array == 'vitac':
            yield np.loadtxt(data / file, delimiter=',')[int(number)].reshape(VITAC_PAD)
        else:
            yield peak_frame(data / WEISS / file, int(number))


def read_whole_blocks(data: Path) -> list[np.ndarray]:
    """Return the frames (rows, cols) [0 to 1] in which a square block of 24 mm lies on the array as a whole.

    The frames are in the order of the recording. The corners of the block are given in taxels, and the centre of the
    first taxel is (0, 0).
    """
    found, ends = [], np.array(BLOCK_PAD)[::-1] - 0.5
    for path in sorted((data / BLOCKS).glob('*/labels.jsonl')):
        for line in path.read_text(encoding='utf-8').splitlines():
            sample = json.loads(line)
            if sample['annotation'] is None:
                continue
            corners = np.array(sample['annotation']['footprint_corners_taxel'])
            if (corners >= -0.5).all() and (corners <= ends).all():
                found.append(np.array(sample['input']['values'], float).reshape(BLOCK_PAD))
    return found


def peak_frame(path: Path, pad: int) -> np.ndarray:
    """Return the frame in a `.dsa` recording with the highest sum of readings on ``pad``, (rows, cols) [counts]."""
    of_pad = read_hand(path)[pad]
    found: np.ndarray = of_pad[of_pad.sum((1, 2)).argmax()]
    return found


def read_hand(path: Path) -> list[np.ndarray]:
    """Return all frames in a `.dsa` recording, as one (K, rows, cols) array for each of PADS [counts]."""
    text = bz2.decompress(path.read_bytes()).decode()
    ends = np.cumsum([rows * cols for rows, cols in PADS])
    frames = [frame for frame in map(_unpacked, re.findall(r'<frame_data>\s*([0-9A-Fa-f\s]+?)\s*</frame_data>', text))
              if len(frame) == ends[-1]]
    parts = np.split(np.array(frames), ends[:-1], axis=1)
    return [part.reshape(-1, *pad) for part, pad in zip(parts, PADS)]


def _unpacked(packed: str) -> list[float]:
    """Decode a text of big-endian float32 in hex, in which a value of -n means n zeros."""
    values: list[float] = []
    for value in np.frombuffer(bytes.fromhex(''.join(packed.split())), '>f4').tolist():
        values += [0.0] * round(-value) if value < 0 else [value]
    return values
