"""One more reading of the paper: N counts inside taxels only, and the isosceles triangles are equilateral.

Section 7 calls N once the number of sensors "inside" and once of those active in the area, and one class once
isosceles and once equilateral triangles. Each change is measured alone, then both together. The worlds differ
in one class, so that the patterns of the four others are shared, and a difference is not that of two draws.
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
ACTIVE = COLUMNS[0]  #: the number of active taxels, N by the matrix A
GROWTH = (0.7, 3.6)  #: √area grows by more and by less than this from a pattern's inside to the whole [pitches]


class InsideReading(NamedTuple):
    """What each change gives, and the planes of both together."""

    equilateral: Method         #: the triangles alone
    read_inside: Method         #: only what recognition is read off at; curves as published
    inside: Method              #: that and plane 1 over inside taxels
    both: Method
    kept: Method                #: both, vanishing angles left out
    active: dict[int, float]    #: mean number of active taxels of patterns with N inside ones
    lost: dict[int, float]      #: with both, by plane, at the largest size
    clouds: Samples             #: training patterns of both
    classifier: VolfClassifier  #: of both

    @property
    def methods(self) -> list[Method]:
        """The rows of the table."""
        return [self.equilateral, self.read_inside, self.inside, self.both, self.kept]


def wanted_inside(patterns: int, training: int) -> dict[str, Wanted]:
    """Return what is drawn besides the benchmark, of which ``patterns`` at each size and ``training``."""
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
    """Measure the reading; ``published`` has the curves of the method as published."""
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
        read_inside=measured('read off at N inside taxels, curves as published', published,
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
    """Return the least and the greatest area [taxels] at which a class may have so many inside taxels.

    The border takes 0.7 to 1 pitch from each side, by its direction, so that √area of a polygon around a circle
    shrinks by as much times perimeter / (2 √area): 1.3 for a circle, at most 2.8 for a right triangle of legs 5:2.
    GROWTH leaves room for how a pattern lies on the lattice, 0.4 in 60,000 patterns.
    """
    least, most = ((np.sqrt(inside) + growth) ** 2 for growth in GROWTH)
    return float(least), float(most)


def by_inside(samples: Samples) -> Samples:
    """Return ``samples`` with inside taxels in the place of N, so that plane 1 is drawn over them."""
    return Samples({**samples.columns, ACTIVE: samples.of(INSIDE)}, samples.labels)


def replaced(drawn: Drawn, triangles: Drawn) -> Drawn:
    """Return the patterns of ``drawn`` with others in the place of its isosceles triangles."""
    return Drawn(*(_joined(old, new) for old, new in zip(drawn, triangles)))


def _triangles_among(patterns: int) -> int:
    """How many of ``patterns`` are triangles where the classes take turns."""
    return len(range(ANSWERS.index(TRIANGLE), patterns, len(ANSWERS)))


def _joined(old: Samples, new: Samples) -> Samples:
    stay = old.labels != ANSWERS.index(TRIANGLE)
    columns = {name: np.concatenate((values[stay], new.of(name))) for name, values in old.columns.items()}
    return Samples(columns, np.concatenate((old.labels[stay], new.labels)))
