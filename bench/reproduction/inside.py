"""Another reading of the paper: N counts only the inside taxels, and the isosceles triangles are equilateral.

Section 7 uses two definitions of N: the number of sensors "inside", and the number of active sensors in the area. It
also uses two names for one class: isosceles and equilateral triangles. Each change is measured alone, and then both
together. The worlds differ only in this class and share the patterns of the other four classes. Therefore a difference
of the rates is not caused by different draws.
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
GROWTH = (0.7, 3.6)  #: bounds of √(area of a pattern) - √(its inside taxels) [pitches]


class InsideReading(NamedTuple):
    """Results of each change, and of both changes together."""

    equilateral: Method         #: only the triangles are changed
    read_inside: Method         #: sizes are inside taxels; curves as published
    inside: Method              #: sizes and plane 1 use inside taxels
    both: Method
    kept: Method                #: both changes, without the vanishing angles
    active: dict[int, float]    #: mean number of active taxels of patterns with N inside taxels
    lost: dict[int, float]      #: lost patterns with both changes, by plane, largest size
    clouds: Samples             #: training patterns with both changes
    classifier: VolfClassifier  #: classifier with both changes

    @property
    def methods(self) -> list[Method]:
        """The methods in the order of the table."""
        return [self.equilateral, self.read_inside, self.inside, self.both, self.kept]


def wanted_inside(patterns: int, training: int) -> dict[str, Wanted]:
    """Return the patterns to draw in addition to the benchmark. ``patterns`` is the number at each size."""
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
    """Measure this reading. ``published`` contains the curves of the method as published."""
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
    """Return the smallest and the largest area [taxels] at which a pattern may have ``inside`` inside taxels.

    The border takes 0.7 to 1 pitch from each side, depending on the direction of the side. The square root of the area
    of a polygon around a circle therefore shrinks by this width times perimeter / (2 √area): by 1.3 for a circle,
    and by at most 2.8 for a right triangle with legs of 5:2. GROWTH also allows for the position of a pattern on the
    lattice, which changed the value by up to 0.4 in 60,000 patterns.
    """
    least, most = ((np.sqrt(inside) + growth) ** 2 for growth in GROWTH)
    return float(least), float(most)


def by_inside(samples: Samples) -> Samples:
    """Return ``samples`` with the number of inside taxels as N, which plane 1 then uses."""
    return Samples({**samples.columns, ACTIVE: samples.of(INSIDE)}, samples.labels)


def replaced(drawn: Drawn, triangles: Drawn) -> Drawn:
    """Return ``drawn`` with its isosceles triangles replaced by ``triangles``."""
    return Drawn(*(_joined(old, new) for old, new in zip(drawn, triangles)))


def _triangles_among(patterns: int) -> int:
    """Return the number of isosceles triangles among ``patterns`` patterns whose classes take turns."""
    return len(range(ANSWERS.index(TRIANGLE), patterns, len(ANSWERS)))


def _joined(old: Samples, new: Samples) -> Samples:
    stay = old.labels != ANSWERS.index(TRIANGLE)
    columns = {name: np.concatenate((values[stay], new.of(name))) for name, values in old.columns.items()}
    return Samples(columns, np.concatenate((old.labels[stay], new.labels)))
