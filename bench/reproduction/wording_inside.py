"""How much of the published figures the reading of N as inside taxels explains, in words made from the numbers."""

import math

from bench.reproduction.experiments import Results
from bench.reproduction.inside_reading import LARGEST, InsideReading
from bench.reproduction.methods import PUBLISHED, Method, published_share
from bench.reproduction.worlds import EQUILATERAL_TRIANGLES


def explained(results: Results) -> str:
    """Return the paragraph of the page."""
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
    return 50 * math.hypot(*(method.rates[size].high - method.rates[size].low for method in methods))


def _share(method: Method, size: int) -> float:
    return method.rates[size].value
