"""Draw the demo's picture of a pad, with taxel values, fitted outline and true outline of each touch."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse

from examples.demo.observation import SeenFit, TouchVerdict
from tactile_node.simulator.world import CLASSES

TITLE = ('Pad "{pad}": true shapes, and the report of the shape topic (probability, size, centre, angle ± '
         'standard deviation)')
KILO = 1e3
FULL_SCALE = 100.0  #: pressure shown in the brightest colour [kPa]
WIDTH = 9.0    #: width of the picture [inch]
PANEL = 1.52   #: side length of a panel [inch]
LEFT = 0.48    #: left margin [inch]
RIGHT = 0.75   #: right margin [inch]
TOP = 0.32     #: top margin [inch]
BOTTOM = 0.72  #: bottom margin [inch]
GAP = 0.05     #: space between panels [inch]
WORDS = 0.66   #: space for text above each panel [inch]
DPI = 150
TICK = 10  #: distance between ticks [mm]

#: Magnification of the centre's error ellipse, whose true axes are only some hundredths of a millimetre long.
MAGNIFIED = 50
FITTED = 'cyan'  #: Colour of the fitted outline. Its line style also differs from that of the true outline.
TRUE = 'white'   #: Colour of the true outline.
RECOGNISED, WRONG = 'black', '#b30000'


def draw_pad(verdicts: list[TouchVerdict], pitch: float, path: Path) -> None:
    """Draw the touches of one pad, with one column per shape and one row per size."""
    areas = sorted({round(verdict.touch.contact.area) for verdict in verdicts})
    height = TOP + BOTTOM + (PANEL + WORDS) * len(areas)
    figure = Figure(figsize=(WIDTH, height))
    axes = figure.subplots(len(areas), len(CLASSES), sharex=True, sharey=True, squeeze=False, gridspec_kw={
        'left': LEFT / WIDTH, 'right': 1 - RIGHT / WIDTH, 'wspace': GAP / PANEL, 'hspace': WORDS / PANEL,
        'top': 1 - (TOP + WORDS) / height, 'bottom': BOTTOM / height})
    for axis in axes.flat:
        axis.set_visible(False)
    for verdict in verdicts:
        contact = verdict.touch.contact
        axis = axes[areas.index(round(contact.area)), CLASSES.index(contact.shape)]
        axis.set_visible(True)
        image = _draw_touch(axis, verdict, pitch)
    bar = figure.add_axes((1 - 0.9 * RIGHT / WIDTH, BOTTOM / height, 0.015, PANEL / height))
    figure.colorbar(image, cax=bar).set_label('pressure [kPa]', fontsize=7, labelpad=2)
    bar.tick_params(labelsize=7)
    axes[-1, 0].set_xlabel('x [mm]', fontsize=7, labelpad=1)
    axes[-1, 0].set_ylabel('y [mm]', fontsize=7, labelpad=1)
    figure.text(0.5, 1 - 0.2 / height, TITLE.format(pad=verdicts[0].pad), fontsize=8.5, ha='center')
    figure.legend(handles=_legend(), loc='lower center', ncols=3, fontsize=7.5, facecolor='0.2', labelcolor='white',
                  bbox_to_anchor=(0.55, 0.0))
    figure.savefig(path, dpi=DPI)


def _draw_touch(axis: Axes, verdict: TouchVerdict, pitch: float) -> AxesImage:
    """Draw one touch, and return the image for the colour bar."""
    millimetres = 1000 * pitch
    rows, cols = verdict.taxels.shape
    left, right, bottom, top = (millimetres * (edge - 0.5) for edge in (0, cols, 0, rows))
    image = axis.imshow(verdict.taxels / KILO, cmap='inferno', vmin=0, vmax=FULL_SCALE, origin='lower',
                        extent=(left, right, bottom, top))
    if verdict.fit is not None:
        _draw_fit(axis, verdict.fit)
    axis.plot(*_closed(millimetres * verdict.touch.contact.outline()), color=TRUE, linewidth=1, linestyle=(0, (3, 2)))
    axis.tick_params(labelsize=7)
    for ticks in (axis.set_xticks, axis.set_yticks):
        ticks(range(0, int(max(right, top)) + 1, TICK))
    name = f'{verdict.recognised.replace("_", " ")} {verdict.confidence:.2f}'
    is_right = verdict.is_right_shape and verdict.is_right_size
    if not is_right:
        name = f'WRONG {"SIZE" if verdict.is_right_shape else "SHAPE"}: {name}'
    axis.annotate(name, (0.5, 1), (0, 29), xycoords='axes fraction', textcoords='offset points', fontsize=7.5,
                  fontweight='bold', ha='center', color=RECOGNISED if is_right else WRONG)
    numbers = ['no outline'] if verdict.fit is None else [verdict.fit.size, verdict.fit.place, verdict.fit.turn]
    axis.annotate('\n'.join(numbers), (0.5, 1), (0, 27), xycoords='axes fraction', textcoords='offset points',
                  fontsize=6.5, ha='center', va='top')
    return image


def _draw_fit(axis: Axes, fit: SeenFit) -> None:
    axis.plot(*_closed(1000 * fit.outline), color=FITTED, linewidth=1.4)
    x, y = fit.names.index('x'), fit.names.index('y')
    variances, axes = np.linalg.eigh(1e6 * fit.covariance[np.ix_((x, y), (x, y))])
    width, height = 2 * MAGNIFIED * np.sqrt(variances)
    axis.add_patch(Ellipse(tuple(1000 * np.array(fit.centre)), width, height, fill=False, edgecolor=FITTED,
                           angle=float(np.degrees(np.arctan2(axes[1, 0], axes[0, 0])))))


def _closed(corners: np.ndarray) -> np.ndarray:
    return np.vstack((corners, corners[:1])).T


def _legend() -> list[Line2D]:
    return [Line2D([], [], color=FITTED, linewidth=1.4, label='outline found'),
            Line2D([], [], color=TRUE, linewidth=1, linestyle=(0, (3, 2)), label='true outline'),
            Line2D([], [], color=FITTED, linestyle='', marker='o', fillstyle='none',
                   label=f'standard deviation of its centre, {MAGNIFIED} times as large')]
