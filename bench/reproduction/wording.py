"""Generate the sentences about the findings from the numbers, so that text and numbers always agree."""

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
    """Return the findings in the order in which the page shows them."""
    return [_against_the_paper(results), _third_plane(results), _where_it_goes_wrong(results),
            _elongation(results), _vanishing(results), _learner(results)]


def _against_the_paper(results: Results) -> str:
    figures = (f'{size} taxels: {results.methods[0].rates[size].value:.1%}, the paper {text}'
            for size, text in PUBLISHED.items())
    return f'Recognition rates of the method as published on our benchmark: {"; ".join(figures)}.'


def _third_plane(results: Results) -> str:
    shares = ' and '.join(f'{rate.value:.1%} as in the {name}' for name, rate in results.readings.items())
    axis = ' '.join(results.classifier.planes['square'].horizontal)
    return (f'The third plane has two readings. With new curves, the rates for validation patterns are {shares}. '
            f'The classifier of this package uses {axis}.')


def _where_it_goes_wrong(results: Results) -> str:
    lost = results.lost[LARGEST]
    worst = max(lost, key=lost.__getitem__)
    rectangle, right = (ANSWERS.index(shape) for shape in (Shape.RECTANGLE, Shape.RIGHT_TRIANGLE))
    table = results.confusions[LARGEST]
    return (f'At {LARGEST} taxels, plane {worst} loses the most patterns, {lost[worst]:.1%} of all. '
            f'{table[rectangle, right]:.0%} of the rectangles are taken for right triangles, and '
            f'{table[right, rectangle]:.0%} of the right triangles for rectangles: dif α9 depends on the length of a '
            'pattern, and a rectangle can be as long as a right triangle.')


def _elongation(results: Results) -> str:
    one, long = (_method(results, f'three planes, {world}') for world in ('one proportion', 'long rectangles'))
    return (f'In a world with one aspect ratio per class, rectangles of {ONE_PROPORTION.rectangle:g}:1, right '
            f'triangles of {ONE_PROPORTION.right_triangle:g}:1 and new curves, the rate at {LARGEST} taxels is '
            f'{one.rates[LARGEST].value:.1%}. With rectangles of {LONG_RECTANGLES.rectangle:g}:1, it is '
            f'{long.rates[LARGEST].value:.1%}. The paper does not state its aspect ratios.')


def _vanishing(results: Results) -> str:
    without = _method(results, 'three planes, benchmark, vanishing angles left out')
    both = _method(results, 'three planes, long rectangles, vanishing angles left out')
    small, worst = VANISHING, np.argsort(results.remaining)[:4]
    angles = ', '.join(f'{ANGLES[angle]}° ({results.remaining[angle]:.0%})' for angle in worst)
    return (f'At some angles, the rotated fine points miss many sites of the decimated lattice. With {small} taxels, '
            f'the fewest taxels remain on average at {angles}. A minimum or a difference over all angles then depends '
            f'only on these angles. They change a feature in {results.vanished[small]:.0%} of the patterns of {small} '
            'taxels. Without the angles that keep less than half of the taxels, the rate at '
            f'{small} taxels is {without.rates[small].value:.1%} instead of '
            f'{results.methods[0].rates[small].value:.1%}. With long rectangles as well, it is '
            f'{both.rates[small].value:.1%}, and {both.rates[LARGEST].value:.1%} at {LARGEST} taxels. There, the '
            f'planes 1, 2 and 3 lose {", ".join(f"{share:.1%}" for share in results.long_lost.values())}.')


def _learner(results: Results) -> str:
    learner, planes = results.methods[-1], results.methods[0]
    return (f'The six features contain more information than the three planes use. The {results.neighbours} nearest '
            f'training patterns recognise {learner.rates[20].value:.1%} at 20 taxels instead of '
            f'{planes.rates[20].value:.1%}, and {learner.rates[LARGEST].value:.1%} at {LARGEST} taxels instead of '
            f'{planes.rates[LARGEST].value:.1%}.')


def _method(results: Results, name: str) -> Method:
    return next(method for method in results.methods if method.name == name)


def explained(results: Results) -> str:
    """Return a text about how much of the gap to the published rates this interpretation of the paper explains."""
    reading, published = results.inside, results.methods[0]
    return ' '.join((_what_is_counted(reading), *(_at(size, reading, published) for size in PUBLISHED),
                     _of_the_count(reading, published), _what_remains(reading)))


def _what_is_counted(reading: InsideReading) -> str:
    active = ', '.join(f'{size} of {reading.active[size]:.0f}' for size in PUBLISHED)
    return ('In this reading, N counts only the taxels that are not border taxels (N - P05), as the size and in '
            f'plane 1. All isosceles triangles have an apex of {EQUILATERAL_TRIANGLES.apex:g}°. The curves are fitted '
            f'again. On average, this number of active taxels is inside: {active}.')


def _at(size: int, reading: InsideReading, published: Method) -> str:
    before, goal = _share(published, size), published_share(size)
    triangles, inside, both = (100 * (_share(method, size) - before)
                               for method in (reading.equilateral, reading.inside, reading.both))
    missing = 100 * (goal - before)
    return (f'At N = {size}, the method as published reaches {before:.1%} and the paper {PUBLISHED[size]}, a '
            f'difference of {missing:.1f} points. Equilateral triangles alone add {triangles:+.1f} points, inside '
            f'taxels alone {inside:+.1f}, and both {both:+.1f} ± {_half_width(size, reading.both, published):.1f} '
            f'(95 %). {missing - both:.1f} points remain.')


def _of_the_count(reading: InsideReading, published: Method) -> str:
    parts = ', '.join(f'{100 * (_share(reading.read_inside, size) - _share(published, size)):+.1f} of '
                      f'{100 * (_share(reading.inside, size) - _share(published, size)):+.1f}' for size in PUBLISHED)
    names = ', '.join(map(str, PUBLISHED))
    return (f'At {names} taxels, a part of the points that inside taxels alone add comes from the larger patterns at '
            f'the same N, with the curves as published: {parts}. The other points come from inside taxels in plane 1.')


def _what_remains(reading: InsideReading) -> str:
    lost = ', '.join(f'{share:.1%}' for share in reading.lost.values())
    kept = ', '.join(f'{_share(reading.kept, size):.1%}' for size in PUBLISHED)
    return (f'With both changes, the planes 1, 2 and 3 still lose {lost} of all patterns of {LARGEST} inside taxels. '
            'The changes do not explain this loss. If the vanishing angles are left out as well, the rates are '
            f'{kept} at {", ".join(map(str, PUBLISHED))} taxels.')


def _half_width(size: int, *methods: Method) -> float:
    """Return half the width of the 95 % interval for the difference of two methods on different patterns [points]."""
    return 50 * math.hypot(*(high - low for low, high in (method.rates[size].interval for method in methods)))


def _share(method: Method, size: int) -> float:
    return method.rates[size].value
