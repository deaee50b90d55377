"""Pictures of fits: the taxels, the true outline, the fitted one."""

from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use('Agg')
from matplotlib import pyplot
from pose_world import true_outline


def draw(fits: list, path: Path, cols: int = 5) -> None:
    """``fits``: (name, (sample, fit, error))."""
    rows = -(-len(fits) // cols)
    figure, axes = pyplot.subplots(rows, cols, figsize=(3 * cols, 3.6 * rows), squeeze=False,
                                   layout='constrained')
    for axis in axes.flat:
        axis.axis('off')
    for axis, (name, (sample, fit, error)) in zip(axes.flat, fits):
        axis.imshow(np.asarray(sample.values, float), cmap='gray', origin='upper')
        for corners, colour in ((true_outline(sample.contact), 'lime'), (fit.outline, 'red')):
            axis.plot(*np.vstack((corners, corners[:1])).T, color=colour, linewidth=1.2)
        reach = 9
        axis.set_xlim(sample.contact.x - reach, sample.contact.x + reach)
        axis.set_ylim(sample.contact.y + reach, sample.contact.y - reach)
        angle = '' if error.angle != error.angle else f', {error.angle:.2g}°'
        axis.set_title(f'{name}\n{fit.shape.value}\ncentre {error.centre:.2g}{angle}, length {error.length:.2g} %',
                       fontsize=8)
    figure.savefig(path, dpi=80)
    pyplot.close(figure)
