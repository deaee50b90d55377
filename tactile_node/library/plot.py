"""A picture of a frame with the outline found in it (needs matplotlib: `pip install tactile-skin[picture]`)."""

from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from tactile_node.contact.pattern import as_frame
from tactile_node.errors import ConfigurationError
from tactile_node.pose.fit import ShapeFit
from tactile_node.pose.pitch import check_pitch

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INVALID = 'grey'  #: a colour that inferno has not

def plot_frame(values: ArrayLike, fit: ShapeFit | None = None, pitch: float = 1.0,
               axes: 'Axes | None' = None) -> 'Axes':
    """Draw a frame, shape (rows, cols), and the outline of ``fit``; return the axes.

    ``pitch`` as given to `fit_shape`. ``axes``: matplotlib's, None for those of the current figure. Row 0 is at the
    bottom, taxel (row, col) at x = col * pitch, y = row * pitch. A taxel without a valid value is grey. Raises
    InputError for another array, ConfigurationError for a pitch that is no length > 0 and without matplotlib.

    >>> import numpy as np, matplotlib
    >>> matplotlib.use('Agg')
    >>> [round(float(edge), 3) for edge in plot_frame(np.zeros((16, 12)), pitch=0.004).get_xlim()]
    [-0.002, 0.046]
    """
    check_pitch(pitch)
    frame = as_frame(values)
    pyplot = _pyplot()
    axes = pyplot.gca() if axes is None else axes
    rows, cols = frame.shape
    left, right, bottom, top = (pitch * (edge - 0.5) for edge in (0, cols, 0, rows))
    colours = pyplot.get_cmap('inferno').with_extremes(bad=INVALID)
    axes.imshow(frame.astype(float), origin='lower', extent=(left, right, bottom, top), cmap=colours)
    axes.set_xlabel('x, in the unit of the pitch')
    axes.set_ylabel('y, in the unit of the pitch')
    if fit is not None:
        axes.plot(*np.vstack((fit.outline, fit.outline[:1])).T, color='cyan')
        axes.set_title(fit.shape.value)
    return axes


def _pyplot() -> ModuleType:
    """Import matplotlib when it is needed: it is optional, and slow to import."""
    try:
        from matplotlib import pyplot
    except ModuleNotFoundError as error:
        raise ConfigurationError('plot_frame', expected='matplotlib', got=f'no module {error.name!r}',
                                 remedy="Install it: pip install 'tactile-skin[picture]'.") from None
    return pyplot
