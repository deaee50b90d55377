"""Draw a pool of figures with their labels. A figure is drawn once and then pressed at many places, angles and sizes.

A figure is stored as the signed distance from its outline on a square raster, in units of the square root of its area.
The coverage of a taxel can therefore be computed without counting points.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from training.blemishes import BLEMISHES
from training.families import FAMILIES
from training.ground_truth.overlap import overlaps
from training.ground_truth.seeds import Purpose, generator
from training.samples import LABELS, UNKNOWN
from training.shapes import Figure

SIDE = 144           #: Number of cells along each side of the raster.
EXTENT = 1.55        #: Limit of the coordinates. Figures are drawn from -EXTENT to EXTENT.

#: A figure is foreign if its best overlap with the five shapes is below the first value. A figure is known if its best
#: overlap reaches the second value.
FOREIGN, KNOWN = 0.85, 0.92
BESIDE = 0.02        #: If the overlaps of two shapes differ by less than this value, neither shape becomes the label.
TIE = 0.005          #: Largest error of the overlaps.

#: A figure is labelled a rectangle only if its overlap with a square is at least this much smaller. A side ratio of
#: about 5:4 or more meets this condition.
LONGER = 0.15
SQUARE, RECTANGLE = (LABELS.index(shape) for shape in ('square', 'rectangle'))
STEPS = 250.0        #: Distances are stored as whole multiples of 1 / STEPS of the square root of the area.
THINNEST = 0.02      #: Smallest area of a figure, as a share of the raster.


class Forms(NamedTuple):
    """F figures."""

    #: int8 (F, SIDE, SIDE), distance from the outline, positive inside, in units of sqrt(area) / STEPS
    distance: np.ndarray
    cell: np.ndarray      #: (F,), width of a cell [square roots of the area]
    middle: np.ndarray    #: (F, 2), x and y of the centre of area [cells]
    overlaps: np.ndarray  #: (F, 5), best overlap with each of the five shapes, in the order of LABELS
    family: np.ndarray    #: str (F,), name of the family
    labels: np.ndarray    #: (F,), index into LABELS; -1 if the figure is neither foreign nor one of the shapes

    def chosen(self, which: np.ndarray) -> 'Forms':
        return Forms(*(array[which] for array in self))


def make_forms(rng: np.random.Generator, families: dict[str, Figure], count: int) -> Forms:
    """Draw ``count`` figures from the families in turn."""
    step = 2 * EXTENT / SIDE
    y, x = np.mgrid[:SIDE, :SIDE] * step - EXTENT + step / 2
    names, drawn = list(families), []
    while len(drawn) < count:
        name = names[len(drawn) % len(names)]
        figure = families[name](rng, x, y)
        if figure.mean() >= THINNEST and not _touches_rim(figure):
            drawn.append(_form(figure, step, name))
    arrays = list(map(np.array, zip(*drawn)))
    return Forms(*arrays, labels_of(arrays[3]))


def stored_forms(folder: Path, name: str, families: dict[str, Figure], count: int, seed: int) -> Forms:
    """Return the pool stored in ``folder``. If the folder holds no pool, draw a pool and store it."""
    path = folder / f'forms_{name}.npz'
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_suffix('.part.npz')
        drawn = make_forms(generator(Purpose.TRAINING, seed), families, count)._asdict()
        np.savez_compressed(unfinished, **{name: array for name, array in drawn.items() if name != 'labels'})
        unfinished.rename(path)
    with np.load(path) as data:
        return Forms(**data, labels=labels_of(data['overlaps']))


def labels_of(overlaps: np.ndarray) -> np.ndarray:
    """Return the labels of figures, (F,), from their best overlaps with the five shapes, (F, 5).

    Every square is also a rectangle. A figure is therefore labelled a rectangle only if it is much less similar to a
    square.
    """
    best, first = overlaps.max(1), overlaps.argmax(1)
    square = (overlaps[:, SQUARE] > best - TIE) & (first == RECTANGLE)
    labels = np.where(square, SQUARE, first)
    others = overlaps.copy()
    others[np.arange(len(labels)), labels] = 0
    others[square, RECTANGLE] = 0
    clear = others.max(1) < best - BESIDE
    clear &= (labels != RECTANGLE) | (overlaps[:, SQUARE] < best - LONGER)
    known = np.where((best >= KNOWN) & clear, labels, -1)
    return np.where(best < FOREIGN, UNKNOWN, known)


def _form(figure: np.ndarray, step: float, family: str) -> tuple:
    root = step * np.sqrt(figure.sum())
    distance = (ndimage.distance_transform_edt(figure) - ndimage.distance_transform_edt(~figure)) * (step / root)
    # the distance is measured from the border of the cells, not from the centre of the next cell
    distance -= np.sign(distance) * step / root / 2
    rows, cols = figure.nonzero()
    found = overlaps(ndimage.binary_fill_holes(figure))  # a ring counts as a circle of which only the rim presses
    return (np.clip(np.round(distance * STEPS), -127, 127).astype(np.int8), step / root, (cols.mean(), rows.mean()),
            [found[name] for name in LABELS[:UNKNOWN]], family)


def _touches_rim(figure: np.ndarray) -> bool:
    return bool(figure[[0, -1]].any() or figure[:, [0, -1]].any())


ALL = {'foreign': FAMILIES, 'blemish': BLEMISHES}
