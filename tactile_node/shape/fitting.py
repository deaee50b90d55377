"""How the curves of the paper's planes are fitted: on synthetic patterns in general position."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from tactile_node.helmholtz.features import compute_features
from tactile_node.shape.plane import Plane, fit_plane
from tactile_node.shape.volf import (
    GROUPS,
    SHAPES,
    SMALLEST,
    by_curves,
    down_the_tree,
    plane_feature,
)
from tactile_node.synthetic.world import CLASSES, random_pattern

AREAS = (13.0, 300.0)  #: training areas, log-uniform [taxels]
COLUMNS = (('value', 'N'), ('dif', 'alpha9'), ('min', 'P05'), ('min', 'info_norm5'),
           ('dif', 'P05'), ('dif', 'info_norm5'))
READINGS = {'caption': ('min', 'P05'), 'text': ('dif', 'P05')}  #: the third plane's horizontal axis


class Samples(NamedTuple):
    """The planes' features of n patterns by name, each of shape (n,), and what the patterns are."""

    columns: Mapping[tuple[str, str], np.ndarray]
    labels: np.ndarray  #: index into volf.SHAPES

    def of(self, name: tuple[str, str]) -> np.ndarray:
        return self.columns[name]


def draw_samples(rng: np.random.Generator, patterns: int, areas: tuple[float, float] = AREAS,
                 progress: Callable[[int], None] = lambda done: None) -> Samples:
    """Draw patterns, the classes in turn, areas log-uniform; those under SMALLEST taxels are drawn anew."""
    rows, labels = [], []
    names = [shape.value for shape in SHAPES]
    while len(rows) < patterns:
        shape = CLASSES[len(rows) % len(CLASSES)]
        mask = random_pattern(rng, shape, float(np.exp(rng.uniform(*np.log(areas)))))
        if mask.sum() < SMALLEST:
            continue
        features = compute_features(mask, GROUPS)
        rows.append([plane_feature(features, column) for column in COLUMNS])
        labels.append(names.index(shape))
        progress(len(rows))
    return Samples(dict(zip(COLUMNS, np.array(rows, float).T)), np.array(labels))


def fit_planes(samples: Samples, third: tuple[str, str]) -> dict[str, Plane]:
    """Fit the four curves in the order of decision, each on what the curves before it should leave."""
    axes = [(COLUMNS[0], COLUMNS[1]), (COLUMNS[0], COLUMNS[1]), (COLUMNS[2], COLUMNS[3]), (third, COLUMNS[5])]
    planes = {}
    for index, (horizontal, vertical) in enumerate(axes):
        left = samples.labels >= index
        planes[SHAPES[index].value] = fit_plane(
            horizontal, vertical, samples.of(horizontal)[left], samples.of(vertical)[left],
            samples.labels[left] == index)
    return planes


def recognised(planes: Mapping[str, Plane], samples: Samples) -> dict[str, np.ndarray]:
    """Which patterns are recognised rightly, bool, shape (n,): by the curves alone, by probability."""
    logits = np.array([plane.height(samples.of(plane.horizontal), samples.of(plane.vertical))
                       for plane in planes.values()])
    return {'by_curves': by_curves(logits) == samples.labels,
            'most_probable': down_the_tree(logits).argmax(0) == samples.labels}
