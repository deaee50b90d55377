"""Read frames of real arrays from copies of their public repositories. Only the labels are stored here.

A label names the largest visible contact. Two raters (vision models) labelled the frames separately, from pictures
without names. The labels are in bench/recognition/labels/real_arrays.csv.
"""

import bz2
import csv
import io
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
VITAC_PAD = (12, 32)  #: Rows and columns of a frame.
PADS = ((14, 6), (13, 6)) * 3  #: Rows and columns of the Weiss hand's pads, in the order of a frame.
LABELS = Path(__file__).parent / 'labels' / 'real_arrays.csv'
UNDECIDABLE = 'undecidable'


class Labelled(NamedTuple):
    """One frame by name, with the labels of two raters."""

    array: str   #: tekscan, weiss or vitac
    frame: str   #: file in the data; with `#pad` for the Weiss hand, with `#frame` for ViTac
    first: str
    second: str

    @property
    def object(self) -> str:
        return self.frame.split('/')[1 if self.array == 'vitac' else -2]  # for ViTac, the cover

    @property
    def label(self) -> str:
        """Label of both raters, or UNDECIDABLE if they differ."""
        return self.first if self.first == self.second else UNDECIDABLE


def read_labels(path: Path = LABELS) -> list[Labelled]:
    lines = path.read_text(encoding='utf-8').splitlines()
    return [Labelled(**row) for row in csv.DictReader(line for line in lines if not line.startswith('#'))]


def read_frames(array: str, data: Path, names: list[str]) -> Iterator[np.ndarray]:
    """Yield the frames of these names, float (rows, cols) [counts]. Raises FileNotFoundError."""
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


def peak_frame(path: Path, pad: int) -> np.ndarray:
    """Return the frame of a `.dsa` recording with the highest sum of a pad's readings, (rows, cols) [counts]."""
    of_pad = read_hand(path)[pad]
    found: np.ndarray = of_pad[of_pad.sum((1, 2)).argmax()]
    return found


def read_hand(path: Path) -> list[np.ndarray]:
    """Return all frames of a `.dsa` recording, (K, rows, cols) for each of PADS [counts]."""
    text = bz2.decompress(path.read_bytes()).decode()
    ends = np.cumsum([rows * cols for rows, cols in PADS])
    frames = [frame for frame in map(_unpacked, re.findall(r'<frame_data>\s*([0-9A-Fa-f\s]+?)\s*</frame_data>', text))
              if len(frame) == ends[-1]]
    parts = np.split(np.array(frames), ends[:-1], axis=1)
    return [part.reshape(-1, *pad) for part, pad in zip(parts, PADS)]


def _unpacked(packed: str) -> list[float]:
    """Return the numbers in a text of big-endian float32 in hex, in which -n stands for n zeros."""
    values: list[float] = []
    for value in np.frombuffer(bytes.fromhex(''.join(packed.split())), '>f4').tolist():
        values += [0.0] * round(-value) if value < 0 else [value]
    return values
