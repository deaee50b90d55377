"""Generate the sentences about the findings from the numbers, so that text and numbers always agree."""

import numpy as np

from bench.reproduction.experiments import VANISHING, Results
from bench.reproduction.methods import PUBLISHED, SIZES, Method
from bench.reproduction.worlds import LONG_RECTANGLES, ONE_PROPORTION
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
