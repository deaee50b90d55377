"""Measure another interpretation of the paper: N counts only inside taxels, and isosceles triangles are equilateral.

Section 7 of the paper uses two definitions of N: the number of sensors "inside", and the number of active sensors in
the area. Section 7 also uses two names for one class: isosceles and equilateral triangles. This module measures each
change alone, and then both together. The worlds differ only in the triangles and share the patterns of the other four
classes, so that different draws cannot cause a difference in the rates.
"""

from typing import NamedTuple

import numpy as np

from bench.reproduction.methods import SIZES, Method, best_fit, lost_in_plane, measured
from bench.reproduction.sampling import INSIDE, Drawn, Wanted
from tactile_node.shape.recognition import Shape
from tactile_node.shape.volf import ANSWERS, VolfClassifier
from training.curve_fitting import AREAS, COLUMNS, Samples, answers
from training.ground_truth.seeds import Purpose

WORLD = 'equilateral triangles'
TRIANGLE = Shape.ISOSCELES_TRIANGLE
LARGEST = SIZES[-1]
ACTIVE = COLUMNS[0]  #: number of active taxels, which is N in the matrix A
GROWTH = (0.7, 3.6)  #: bounds of √(area) - √(inside taxels) of a pattern [pitches]


class InsideReading(NamedTuple):
    """Results of each change alone and of both changes together."""

    equilateral: Method         #: result with changed triangles and N as published
    read_inside: Method         #: result with inside taxels as sizes and curves as published
    inside: Method              #: result with inside taxels as sizes and as N in plane 1
    both: Method
    kept: Method                #: result with both changes, without the vanishing angles
    active: dict[int, float]    #: mean number of active taxels in patterns with N inside taxels
    lost: dict[int, float]      #: loss by plane with both changes, at the largest size
    clouds: Samples             #: training patterns for both changes
    classifier: VolfClassifier  #: classifier for both changes

    @property
    def methods(self) -> list[Method]:
        """The methods in the order of the table's rows."""
        return [self.equilateral, self.read_inside, self.inside, self.both, self.kept]


def wanted_inside(patterns: int, training: int) -> dict[str, Wanted]:
    """Return the patterns to draw in addition to the benchmark, with ``patterns`` patterns at each size."""
    triangles, training_triangles = _triangles_among(patterns), _triangles_among(training)
    wanted = {'triangles training': Wanted(WORLD, Purpose.TRAINING, training_triangles, AREAS, (TRIANGLE,))}
    for size in SIZES:
        areas = areas_around(size)
        wanted |= {
            f'triangles {size}': Wanted(WORLD, Purpose.EVALUATION, triangles, (size, size), (TRIANGLE,)),
            f'inside {size}': Wanted('benchmark', Purpose.EVALUATION, patterns, areas, inside=size),
            f'triangles inside {size}': Wanted(WORLD, Purpose.EVALUATION, triangles, areas, (TRIANGLE,), size)}
    return wanted


def measure_inside(drawn: dict[str, Drawn], published: VolfClassifier) -> InsideReading:
    """Measure this interpretation of the paper. ``published`` contains the curves of the published method."""
    training = drawn['benchmark training']
    triangles = replaced(training, drawn['triangles training'])
    by_area = {size: replaced(drawn[f'benchmark {size}'], drawn[f'triangles {size}']).every for size in SIZES}
    inside = {size: drawn[f'inside {size}'] for size in SIZES}
    both = {size: replaced(inside[size], drawn[f'triangles inside {size}']) for size in SIZES}
    every = {size: by_inside(each.every) for size, each in both.items()}
    print('fitting curves: N inside taxels, equilateral triangles', flush=True)
    classifier = best_fit(by_inside(triangles.every))
    return InsideReading(
        equilateral=measured('equilateral triangles', best_fit(triangles.every), by_area),
        read_inside=measured('N inside taxels only as the size, curves as published', published,
                             {size: each.every for size, each in inside.items()}),
        inside=measured('N inside taxels', best_fit(by_inside(training.every)),
                        {size: by_inside(each.every) for size, each in inside.items()}),
        both=measured('N inside taxels, equilateral triangles', classifier, every),
        kept=measured('N inside taxels, equilateral triangles, vanishing angles left out',
                      best_fit(by_inside(triangles.kept)),
                      {size: by_inside(each.kept) for size, each in both.items()}),
        active={size: float(np.mean(each.every.of(ACTIVE))) for size, each in both.items()},
        lost=lost_in_plane(answers(classifier.planes, every[LARGEST]), every[LARGEST].labels),
        clouds=by_inside(triangles.every),
        classifier=classifier)


def areas_around(inside: int) -> tuple[float, float]:
    """Return the smallest and the largest area of patterns that may have ``inside`` inside taxels [taxels].

    The border is 0.7 to 1 pitch wide on each side of a pattern, depending on the direction of the side. Without the
    border, the square root of the area of a polygon around a circle therefore shrinks by the border's width times
    perimeter / (2 √area). The shrinkage is 1.3 for a circle, and at most 2.8 for a right triangle with legs of 5:2.
    GROWTH also allows for the position of a pattern on the lattice, which changed the shrinkage by up to 0.4 in 60,000
    patterns.
    """
    least, most = ((np.sqrt(inside) + growth) ** 2 for growth in GROWTH)
    return float(least), float(most)


def by_inside(samples: Samples) -> Samples:
    """Return ``samples`` with the number of inside taxels as N, so that plane 1 uses this number."""
    return Samples({**samples.columns, ACTIVE: samples.of(INSIDE)}, samples.labels)


def replaced(drawn: Drawn, triangles: Drawn) -> Drawn:
    """Return ``drawn`` with all isosceles triangles replaced by ``triangles``."""
    return Drawn(*(_joined(old, new) for old, new in zip(drawn, triangles)))


def _triangles_among(patterns: int) -> int:
    """Return the number of isosceles triangles among ``patterns`` patterns that cycle through the classes."""
    return len(range(ANSWERS.index(TRIANGLE), patterns, len(ANSWERS)))


def _joined(old: Samples, new: Samples) -> Samples:
    stay = old.labels != ANSWERS.index(TRIANGLE)
    columns = {name: np.concatenate((values[stay], new.of(name))) for name, values in old.columns.items()}
    return Samples(columns, np.concatenate((old.labels[stay], new.labels)))
