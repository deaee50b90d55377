"""Contacts that are seen in part: what lost TPDOs, silent rows and columns leave of them, marked as not seen.

Through the library's own segmentation, which decides what is one contact across hidden taxels.
"""

import numpy as np

from tactile_node.shape.patch import joined
from training.field import field_frame
from training.outliers import TRAINED
from training.samples import LABELS, SMALLEST, UNKNOWN, Samples, random_conditions, samples_from
from training.segmentation import as_shipped

AREAS = (20.0, 160.0)     #: log-uniform
SIDE = 16                 #: least of the pads
FOREIGN = 0.15            #: fraction of figures that are none of the five
FAULTY = 0.15             #: and of frames with another fault
WIDTHS = (2, 4, 8)        #: taxels of a TPDO, in a row of the pad: of 32, 16 and 8 bits
MOST = 0.5                #: of the pad's TPDOs that are lost
LINES = 6                 #: adjacent rows or columns at most


def draw_hidden(rng: np.random.Generator, count: int, on_off: bool) -> Samples:
    """Draw ``count`` samples with the labels of the whole contacts."""
    found: list[tuple] = []
    while len(found) < count:
        label = UNKNOWN if rng.random() < FOREIGN else int(rng.integers(UNKNOWN))
        kind = TRAINED[rng.integers(len(TRAINED))] if label == UNKNOWN else LABELS[label]
        area = float(np.exp(rng.uniform(*np.log(AREAS))))
        conditions = random_conditions(rng, on_off, FAULTY)
        if conditions.second:
            continue
        frame = field_frame(rng, kind, area, conditions, least_side=SIDE)
        frame[hidden_taxels(rng, *frame.shape)] = np.nan
        pattern = as_shipped(frame, on_off)
        if np.count_nonzero(pattern.mask & ~pattern.hidden) >= SMALLEST:
            found.append((pattern, joined(pattern), label))
    return samples_from(found)


def hidden_taxels(rng: np.random.Generator, rows: int, cols: int) -> np.ndarray:
    """Draw what is hidden, bool: TPDOs at random, TPDOs that follow each other, or adjacent rows or columns."""
    kind = rng.integers(3)
    if kind == 2:
        return _adjacent_lines(rng, rows, cols)
    tpdos = _tpdos(rng, rows, cols)
    count = int(tpdos.max()) + 1
    lost = max(1, round(count * MOST * rng.random() ** 2))
    if kind == 1:
        return (tpdos - rng.integers(count)) % count < lost
    return np.isin(tpdos, rng.choice(count, lost, replace=False))


def _tpdos(rng: np.random.Generator, rows: int, cols: int) -> np.ndarray:
    """The TPDO of each taxel, along rows or, on half of the pads, along columns."""
    if rng.random() < 0.5:
        return _tpdos_along_rows(int(rng.choice(WIDTHS)), rows, cols)
    return _tpdos_along_rows(int(rng.choice(WIDTHS)), cols, rows).T


def _tpdos_along_rows(width: int, rows: int, cols: int) -> np.ndarray:
    in_row = -(-cols // width)
    return np.arange(rows)[:, np.newaxis] * in_row + np.arange(cols) // width


def _adjacent_lines(rng: np.random.Generator, rows: int, cols: int) -> np.ndarray:
    hidden = np.zeros((rows, cols), bool)
    lines = hidden if rng.random() < 0.5 else hidden.T
    count = int(rng.integers(1, LINES + 1))
    first = int(rng.integers(0, max(1, len(lines) - count)))
    lines[first:first + count] = True
    return hidden
