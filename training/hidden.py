"""Draw contacts that are only partly visible, because TPDOs are lost or rows and columns are silent.

The library's segmentation decides which pressed taxels on both sides of hidden taxels form one contact.
"""

import numpy as np

from tactile_node.shape.patch import joined
from training.field import field_frame
from training.outliers import TRAINED
from training.samples import LABELS, SMALLEST, UNKNOWN, Samples, random_conditions, samples_from
from training.segmentation import as_shipped

AREAS = (20.0, 160.0)     #: Range of the areas of contacts, log-uniform [taxels].
SIDE = 16                 #: Smallest number of rows and columns of a pad.
FOREIGN = 0.15            #: Fraction of the contacts whose shape is none of the five.
FAULTY = 0.15             #: Fraction of the frames that also have another fault.
WIDTHS = (2, 4, 8)        #: Number of taxels in a TPDO, along a row of the pad, for taxels of 32, 16 and 8 bits.
MOST = 0.5                #: Largest share of the pad's TPDOs that are lost.
LINES = 6                 #: Largest number of adjacent hidden rows or columns.


def draw_hidden(rng: np.random.Generator, count: int, on_off: bool) -> Samples:
    """Draw ``count`` samples. Each sample has the label of the whole contact."""
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
    """Draw hidden taxels, bool (rows, cols): random TPDOs, successive TPDOs, or adjacent rows or columns."""
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
    """Return the number of each taxel's TPDO. The TPDOs run along rows or, on half of the pads, along columns."""
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
