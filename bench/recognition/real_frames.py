"""Frames of real arrays, read from a copy of their public repositories; nothing of them is kept here but labels.

Labels name the largest visible contact, as two raters (vision models) gave them apart, from pictures without names:
bench/recognition/labels/real_arrays.csv.
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

TEKSCAN = 'Tactile_Images_Dataset.zip'  #: of TaISLab/CNN-based-Methods-for-Tactile-Object-Recognition
WEISS = 'python/classification/training_grasp_profiles_thesis'  #: of peter-kiechle/tactile-sensors
VITAC, VITAC_PAD = 'Data', (12, 32)  #: of jsheng45/ViTac-Tactile-Sensing
PADS = ((14, 6), (13, 6)) * 3  #: rows and columns of the Weiss hand's pads, in the order of a frame
LABELS = Path(__file__).parent / 'labels' / 'real_arrays.csv'
UNDECIDABLE = 'undecidable'


class Labelled(NamedTuple):
    """One frame by name, as each of two raters saw it."""

    array: str   #: tekscan, weiss or vitac
    frame: str   #: file in the data, of the Weiss hand with `#pad`, of ViTac with `#frame`
    first: str
    second: str

    @property
    def object(self) -> str:
        return self.frame.split('/')[1 if self.array == 'vitac' else -2]  # of ViTac, the cover

    @property
    def label(self) -> str:
        """What both saw; undecidable where they differ."""
        return self.first if self.first == self.second else UNDECIDABLE


def read_labels(path: Path = LABELS) -> list[Labelled]:
    lines = path.read_text(encoding='utf-8').splitlines()
    return [Labelled(**row) for row in csv.DictReader(line for line in lines if not line.startswith('#'))]


def read_frames(array: str, data: Path, names: list[str]) -> Iterator[np.ndarray]:
    """Yield the frames of these names, float, (rows, cols), in counts. Raises FileNotFoundError."""
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
    """Return the frame of a `.dsa` recording in which a pad reads most in all, (rows, cols) [counts]."""
    of_pad = read_hand(path)[pad]
    found: np.ndarray = of_pad[of_pad.sum((1, 2)).argmax()]
    return found


def read_hand(path: Path) -> list[np.ndarray]:
    """Return all frames of a `.dsa` recording, (K, rows, cols) of each of PADS [counts]."""
    text = bz2.decompress(path.read_bytes()).decode()
    ends = np.cumsum([rows * cols for rows, cols in PADS])
    frames = [frame for frame in map(_unpacked, re.findall(r'<frame_data>\s*([0-9A-Fa-f\s]+?)\s*</frame_data>', text))
              if len(frame) == ends[-1]]
    parts = np.split(np.array(frames), ends[:-1], axis=1)
    return [part.reshape(-1, *pad) for part, pad in zip(parts, PADS)]


def _unpacked(packed: str) -> list[float]:
    """Big-endian float32 in hex; -n stands for n zeros."""
    values: list[float] = []
    for value in np.frombuffer(bytes.fromhex(''.join(packed.split())), '>f4').tolist():
        values += [0.0] * round(-value) if value < 0 else [value]
    return values
