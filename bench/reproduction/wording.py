"""The findings in words, made from the numbers, so that a sentence cannot outlive its figure."""

import math

import numpy as np

from bench.reproduction.experiments import VANISHING, Results
from bench.reproduction.inside import InsideReading
from bench.reproduction.methods import PUBLISHED, SIZES, Method, published_share
from bench.reproduction.worlds import EQUILATERAL_TRIANGLES, LONG_RECTANGLES, ONE_PROPORTION
from tactile_node.helmholtz.rotation import ANGLES
from tactile_node.shape.recognition import Shape
from tactile_node.shape.volf import ANSWERS

LARGEST = SIZES[-1]


def findings(results: Results) -> list[str]:
    """Return the sentences of the page's list."""
    return [_against_the_paper(results), _third_plane(results), _where_it_goes_wrong(results),
            _elongation(results), _vanishing(results), _learner(results)]


def _against_the_paper(results: Results) -> str:
    figures = (f'{size} taxels: {results.methods[0].rates[size].value:.1%}, the paper {text}'
            for size, text in PUBLISHED.items())
    return f'The method as published, on our benchmark: {"; ".join(figures)}.'


def _third_plane(results: Results) -> str:
    shares = ' and '.join(f'{rate.value:.1%} as in the {name}' for name, rate in results.readings.items())
    axis = ' '.join(results.classifier.planes['square'].horizontal)
    return (f'The third plane read both ways, curves fitted again, validation patterns of all sizes: {shares}. '
            f'The classifier of this package uses {axis}.')


def _where_it_goes_wrong(results: Results) -> str:
    lost = results.lost[LARGEST]
    worst = max(lost, key=lost.__getitem__)
    rectangle, right = (ANSWERS.index(shape) for shape in (Shape.RECTANGLE, Shape.RIGHT_TRIANGLE))
    table = results.confusions[LARGEST]
    return (f'At {LARGEST} taxels plane {worst} loses most, {lost[worst]:.1%} of all patterns. There '
            f'{table[rectangle, right]:.0%} of the rectangles are taken for right triangles and '
            f'{table[right, rectangle]:.0%} the other way: dif α9 follows how long a pattern is, and a '
            'rectangle can be as long as a right triangle.')


def _elongation(results: Results) -> str:
    one, long = (_method(results, f'three planes, {world}') for world in ('one proportion', 'long rectangles'))
    return (f'With one proportion a class and rectangles {ONE_PROPORTION.rectangle:g}:1 beside right '
            f'triangles {ONE_PROPORTION.right_triangle:g}:1, curves fitted for that world, {LARGEST} '
            f'taxels give {one.rates[LARGEST].value:.1%}; with rectangles {LONG_RECTANGLES.rectangle:g}:1 '
            f'{long.rates[LARGEST].value:.1%}. The paper does not give its proportions.')


def _vanishing(results: Results) -> str:
    without = _method(results, 'three planes, benchmark, vanishing angles left out')
    both = _method(results, 'three planes, long rectangles, vanishing angles left out')
    small, worst = VANISHING, np.argsort(results.remaining)[:4]
    angles = ', '.join(f'{ANGLES[angle]}° ({results.remaining[angle]:.0%})' for angle in worst)
    return (f'At some angles the rotated fine points miss many sites of the decimated lattice. Of {small} taxels the '
            f'fewest remain, on average, at {angles}; a minimum or a difference over all angles then depends on these '
            'angles alone. '
            f'They change a feature of {results.vanished[small]:.0%} of the patterns of {small} taxels. '
            f'Without the angles that keep less than half of the taxels, {small} taxels give '
            f'{without.rates[small].value:.1%} instead of {results.methods[0].rates[small].value:.1%}; with long '
            f'rectangles as well {both.rates[small].value:.1%} '
            f'(and {both.rates[LARGEST].value:.1%} at {LARGEST}, where the planes 1, 2 and 3 then lose '
            f'{", ".join(f"{share:.1%}" for share in results.long_lost.values())}).')


def _learner(results: Results) -> str:
    learner, planes = results.methods[-1], results.methods[0]
    return (f'The six features hold more than three planes use: the {results.neighbours} nearest training patterns '
            f'recognise {learner.rates[20].value:.1%} at 20 taxels instead of {planes.rates[20].value:.1%}, and '
            f'{learner.rates[LARGEST].value:.1%} at {LARGEST} instead of {planes.rates[LARGEST].value:.1%}.')


def _method(results: Results, name: str) -> Method:
    return next(method for method in results.methods if method.name == name)


def explained(results: Results) -> str:
    """Return how much of the published figures the reading of N as inside taxels explains."""
    reading, published = results.inside, results.methods[0]
    return ' '.join((_what_is_counted(reading), *(_at(size, reading, published) for size in PUBLISHED),
                     _of_the_count(reading, published), _what_remains(reading)))


def _what_is_counted(reading: InsideReading) -> str:
    active = ', '.join(f'{size} of {reading.active[size]:.0f}' for size in PUBLISHED)
    return ('N counts the taxels that are not border taxels (N - P05), where recognition is read off and in plane 1; '
            f'the isosceles triangles have an apex of {EQUILATERAL_TRIANGLES.apex:g}° only; curves are fitted again. '
            f'So many active taxels are inside, on average: {active}.')


def _at(size: int, reading: InsideReading, published: Method) -> str:
    before, goal = _share(published, size), published_share(size)
    triangles, inside, both = (100 * (_share(method, size) - before)
                               for method in (reading.equilateral, reading.inside, reading.both))
    missing = 100 * (goal - before)
    return (f'N = {size}: as published {before:.1%}, the paper {PUBLISHED[size]}, so that {missing:.1f} points are '
            f'missing. Equilateral triangles alone give {triangles:+.1f}, inside taxels alone {inside:+.1f}, both '
            f'{both:+.1f} ± {_half_width(size, reading.both, published):.1f} (95 %); {missing - both:.1f} remain.')


def _of_the_count(reading: InsideReading, published: Method) -> str:
    parts = ', '.join(f'{100 * (_share(reading.read_inside, size) - _share(published, size)):+.1f} of '
                      f'{100 * (_share(reading.inside, size) - _share(published, size)):+.1f}' for size in PUBLISHED)
    names = ', '.join(map(str, PUBLISHED))
    return (f'Of what inside taxels alone change at {names}, so many points come from the larger patterns at the same '
            f'N, with the curves as published: {parts}; the others from plane 1 over inside taxels.')


def _what_remains(reading: InsideReading) -> str:
    lost = ', '.join(f'{share:.1%}' for share in reading.lost.values())
    kept = ', '.join(f'{_share(reading.kept, size):.1%}' for size in PUBLISHED)
    return (f'With both, the planes 1, 2 and 3 still lose {lost} of all patterns of {LARGEST} inside taxels, which the '
            'count and the triangles do not explain. Without the vanishing angles as well: '
            f'{kept} at {", ".join(map(str, PUBLISHED))}.')


def _half_width(size: int, *methods: Method) -> float:
    """Half the 95 % interval of the difference of two methods measured on different patterns, in points."""
    return 50 * math.hypot(*(high - low for low, high in (method.rates[size].interval for method in methods)))


def _share(method: Method, size: int) -> float:
    return method.rates[size].value
