"""Pictures of fits: the taxels, the true outline, the fitted one."""

from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use('Agg')
from matplotlib import pyplot
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from pose_world import true_outline

REACH = 10.5  #: taxels around the centre
#: Okabe and Ito's blue and vermilion, apart also by their lines; contacts are grey, so that both are seen
TRUE = {'color': '#0072b2', 'linewidth': 2.2}
FOUND = {'color': '#d55e00', 'linewidth': 1.4, 'linestyle': (0, (4, 2))}
INVALID = '#f0e442'
GREYS = pyplot.get_cmap('Greys').with_extremes(bad=INVALID)


def draw(fits: list, path: Path, cols: int = 5) -> None:
    """``fits``: (name, (sample, fit, error))."""
    rows = -(-len(fits) // cols)
    figure, axes = pyplot.subplots(rows, cols, figsize=(2.5 * cols, 3.05 * rows + 0.3), squeeze=False,
                                   layout='constrained')
    for axis in axes.flat:
        axis.set_visible(False)
    for axis, (name, (sample, fit, error)) in zip(axes.flat, fits):
        axis.set(visible=True, xticks=[], yticks=[])
        _draw(axis, name, sample, fit, error)
    figure.legend(handles=[Line2D([], [], label='truth', **TRUE), Line2D([], [], label='fit', **FOUND),
                           Patch(facecolor=INVALID, label='no valid value')],
                  loc='outside lower center', ncols=3, fontsize=10, frameon=False)
    figure.savefig(path, dpi=80, bbox_inches='tight', pad_inches=0.1)
    pyplot.close(figure)


def _draw(axis, name: str, sample, fit, error) -> None:
    values = np.asarray(sample.values, float)
    # Twice the highest, so that the darkest grey is lighter than the lines
    axis.imshow(values, cmap=GREYS, origin='upper', vmin=0, vmax=2 * np.nanmax(values))
    for corners, style in ((true_outline(sample.contact), TRUE), (fit.outline, FOUND)):
        axis.plot(*np.vstack((corners, corners[:1])).T, **style)
    x, y = np.clip((sample.contact.x, sample.contact.y), REACH - 0.5, np.array(values.shape[::-1]) - 0.5 - REACH)
    axis.set(xlim=(x - REACH, x + REACH), ylim=(y + REACH, y - REACH))
    turned = '' if error.angle != error.angle else f', angle by {error.angle:.1f}°'
    axis.set_title(f'{name}: {fit.shape.value.replace("_", " ")}\ncentre off by {error.centre:.3f} pitches\n'
                   f'length by {error.length:.1f} %{turned}', fontsize=9)
