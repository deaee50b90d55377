"""A pool of figures with the shape each is most like: drawn once, then pressed at many places, angles and sizes.

A figure is kept as its distance from the outline on a square raster, in units of the root of its area, so that its
coverage of a taxel is found without counting points.
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

SIDE = 144           #: cells along the raster
EXTENT = 1.55        #: figures are drawn from -EXTENT to EXTENT
FOREIGN, KNOWN = 0.85, 0.92  #: below, above these overlaps with the best of the five shapes
BESIDE = 0.02        #: of two shapes whose overlaps differ by less neither is the truth
TIE = 0.005          #: overlaps are found so exactly
LONGER = 0.15        #: by so much less a square than a rectangle is a rectangle: from about 5:4 on
SQUARE, RECTANGLE = (LABELS.index(shape) for shape in ('square', 'rectangle'))
STEPS = 250.0        #: distances are kept in whole numbers of a fraction of the area's root
THINNEST = 0.02      #: least area of a figure that is worth its raster [of the raster]


class Forms(NamedTuple):
    """F figures."""

    distance: np.ndarray  #: int8, (F, SIDE, SIDE), positive inside, STEPS to a root of the area
    cell: np.ndarray      #: of the raster [roots of the area], (F,)
    middle: np.ndarray    #: centre of area [cells], x and y, (F, 2)
    overlaps: np.ndarray  #: best with each of the five shapes, in the order of LABELS, (F, 5)
    family: np.ndarray    #: str, (F,)
    labels: np.ndarray    #: index into LABELS, or -1: neither foreign nor a shape, (F,)

    def chosen(self, which: np.ndarray) -> 'Forms':
        return Forms(*(array[which] for array in self))


def make_forms(rng: np.random.Generator, families: dict[str, Figure], count: int) -> Forms:
    """Draw ``count`` figures, the families in turn."""
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
    """Read the pool, or draw and store it where ``folder`` does not hold it."""
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
    """The labels of figures, (F,), by their best overlaps with the five shapes, (F, 5).

    A square is a rectangle, too: a rectangle is only what is much less of a square.
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
    distance -= np.sign(distance) * step / root / 2  # from the cells' border, not from the next cell's middle
    rows, cols = figure.nonzero()
    found = overlaps(ndimage.binary_fill_holes(figure))  # a ring is a circle that is pressed with its rim
    return (np.clip(np.round(distance * STEPS), -127, 127).astype(np.int8), step / root, (cols.mean(), rows.mean()),
            [found[name] for name in LABELS[:UNKNOWN]], family)


def _touches_rim(figure: np.ndarray) -> bool:
    return bool(figure[[0, -1]].any() or figure[:, [0, -1]].any())


ALL = {'foreign': FAMILIES, 'blemish': BLEMISHES}
