"""Draw figures 6 to 8 of the paper with our patterns and curves, and the recognition rate against size."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bench.reproduction.methods import PUBLISHED, SIZES, Method, published_share
from tactile_node.shape.recognition import Shape
from tactile_node.shape.volf import ANSWERS, Plane
from training.curve_fitting import Samples

#: Colours from Okabe and Ito, which people with any colour vision can distinguish. The marks differ as well.
COLOURS = {Shape.RECTANGLE: '#e69f00', Shape.RIGHT_TRIANGLE: '#d55e00', Shape.ISOSCELES_TRIANGLE: '#cc79a7',
           Shape.SQUARE: '#0072b2', Shape.CIRCLE: '#009e73'}
MARK_OF = {Shape.RECTANGLE: '|', Shape.RIGHT_TRIANGLE: '4', Shape.ISOSCELES_TRIANGLE: '^', Shape.SQUARE: 's',
           Shape.CIRCLE: 'o'}
SHOWN = 600  #: number of patterns per class in a cloud
HIGHEST = 0.97  #: the plot ends a little above this quantile, because a few patterns lie far above all others
LABELS = {('value', 'N'): 'N', ('dif', 'alpha9'): 'dif α9 [degrees]', ('min', 'P05'): 'min P05',
          ('min', 'info_norm5'): 'min I5', ('dif', 'P05'): 'dif P05', ('dif', 'info_norm5'): 'dif I5'}
#: Colour, mark and line style of each method. The first style belongs to the published method.
STYLES = (('black', 'o', '-'), ('#0072b2', 's', '--'), ('#d55e00', 'D', '-.'), ('#009e73', '^', ':'),
          ('#cc79a7', 'v', (0, (5, 1))), ('#e69f00', 'P', (0, (3, 1, 1, 1, 1, 1))), ('#56b4e9', 'X', (0, (1, 1))))
#: factor by which the x values of two methods differ at one size, so that their intervals do not overlap
BESIDE = 1.012


def first_plane(samples: Samples, planes: dict[str, Plane]) -> Figure:
    """Draw Fig. 6, in which two curves separate rectangles, right triangles and all other shapes."""
    return _cloud(samples, [planes['rectangle'], planes['right_triangle']], ANSWERS)


def second_plane(samples: Samples, planes: dict[str, Plane]) -> Figure:
    """Draw Fig. 7, with isosceles triangles above the curve and with circles and squares below."""
    return _cloud(samples, [planes['isosceles_triangle']], ANSWERS[2:])


def third_plane(samples: Samples, planes: dict[str, Plane]) -> Figure:
    """Draw Fig. 8, with squares above the curve and circles below."""
    return _cloud(samples, [planes['square']], ANSWERS[3:])


def _cloud(samples: Samples, curves: list[Plane], shapes: Sequence[Shape]) -> Figure:
    figure = Figure(figsize=(6.4, 4.3), layout='constrained')
    horizontal, vertical = curves[0].horizontal, curves[0].vertical
    axes = figure.add_subplot(xlabel=LABELS[horizontal], ylabel=LABELS[vertical])
    jitter = np.random.default_rng(0)  # points with equal counts would otherwise hide each other
    for shape in shapes:
        chosen = np.flatnonzero(samples.labels == ANSWERS.index(shape))[:SHOWN]
        x = samples.of(horizontal)[chosen] + jitter.uniform(-0.35, 0.35, len(chosen))
        axes.plot(x, samples.of(vertical)[chosen], MARK_OF[shape], ms=3, mew=0.7, color=COLOURS[shape],
                  fillstyle='none', label=shape.value.replace('_', ' '), rasterized=True)
    drawn = np.isin(samples.labels, [ANSWERS.index(shape) for shape in shapes])
    x = np.linspace(samples.of(horizontal)[drawn].min(), samples.of(horizontal)[drawn].max(), 400)
    for style, plane in zip(('-', '--'), curves):
        axes.plot(x, plane.curve_at(x), style, color='black', lw=1.8)
    axes.set_ylim(0, 1.15 * np.quantile(samples.of(vertical)[drawn], HIGHEST))
    axes.legend(markerscale=3, frameon=False, fontsize=9)
    return figure


def rates_by_size(methods: Sequence[Method]) -> Figure:
    """Draw the recognition rate of every method by size, with 95 % intervals and the published points."""
    figure = Figure(figsize=(9.6, 5.6), layout='constrained')
    axes = figure.add_subplot(xlabel='area [taxels]', ylabel='recognised', xscale='log')
    lowest = min(rate.interval[0] for method in methods for rate in method.rates.values())
    axes.set_ylim(min(0.3, lowest - 0.02), 1.05)
    for number, (method, style) in enumerate(zip(methods, STYLES)):
        _line(axes, method, style, beside=BESIDE ** (number - (len(methods) - 1) / 2), width=1.3 if number else 2.4)
    for taxels, text in PUBLISHED.items():
        axes.annotate(f'paper: {text}', (taxels, published_share(taxels)), (-8, 6), textcoords='offset points',
                      fontsize=9, color='#c2410c', ha='right',
                      bbox={'facecolor': 'white', 'edgecolor': 'none', 'alpha': 0.8, 'pad': 1})
        axes.plot(taxels, published_share(taxels), '*', ms=13, color='#c2410c')
    axes.set_xticks(SIZES, [str(size) for size in SIZES])
    axes.set_xticks([], minor=True)
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, fontsize=9, loc='upper left', bbox_to_anchor=(0, -0.12), ncol=2, handlelength=4)
    return figure


def _line(axes: Axes, method: Method, style: tuple, beside: float, width: float) -> None:
    rates, (colour, mark, line) = method.rates.values(), style
    spread = [[rate.value - rate.interval[0] for rate in rates], [rate.interval[1] - rate.value for rate in rates]]
    places = [beside * size for size in method.rates]
    axes.errorbar(places, [rate.value for rate in rates], spread, marker=mark, ms=4.5, lw=width, linestyle=line,
                  elinewidth=0.8, capsize=2, color=colour, label=method.name)
