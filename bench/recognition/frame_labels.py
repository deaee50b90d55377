"""Which frames of a recording hold the object: labels given by hand, in bench/recognition/labels."""

import csv
from pathlib import Path

import numpy as np

LABELS = ('object', 'not', 'unclear')
FOLDER = Path(__file__).parent / 'labels'


def frame_labels(recording: str) -> np.ndarray:
    """Return the label of each frame of ``recording`` (a file's name without ending), str, shape (frames,).

    Raises ValueError where the ranges leave a frame out, overlap, or a label is none of LABELS.
    """
    lines = (FOLDER / f'{recording}.csv').read_text(encoding='utf-8').splitlines()
    found: list[str] = []
    for row in csv.DictReader(line for line in lines if not line.startswith('#')):
        first, last, label = int(row['first_frame']), int(row['last_frame']), row['label']
        if first != len(found) or last < first or label not in LABELS:
            raise ValueError(f'{recording}: expected frames from {len(found)} on with one of {LABELS}, got {row}')
        found += [label] * (last - first + 1)
    return np.array(found)
