"""A picture of a frame with the outline found in it (needs matplotlib: `pip install tactile-skin[picture]`)."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from tactile_node.contact.pattern import as_frame
from tactile_node.pose.fit import ShapeFit
from tactile_node.pose.pitch import check_pitch

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_frame(values: ArrayLike, fit: ShapeFit | None = None, pitch: float = 1.0,
               axes: 'Axes | None' = None) -> 'Axes':
    """Draw a frame, shape (rows, cols), and the outline of ``fit``; return the axes.

    ``pitch`` as given to `fit_shape`. ``axes``: matplotlib's, None for those of the current figure. Row 0 is at the
    bottom, taxel (row, col) at x = col * pitch, y = row * pitch. Raises InputError for another array,
    ConfigurationError for a pitch that is no length > 0.

    >>> import numpy as np, matplotlib
    >>> matplotlib.use('Agg')
    >>> [round(float(edge), 3) for edge in plot_frame(np.zeros((16, 12)), pitch=0.004).get_xlim()]
    [-0.002, 0.046]
    """
    from matplotlib import pyplot  # optional, and slow to import
    check_pitch(pitch)
    frame = as_frame(values)
    axes = pyplot.gca() if axes is None else axes
    rows, cols = frame.shape
    left, right, bottom, top = (pitch * (edge - 0.5) for edge in (0, cols, 0, rows))
    axes.imshow(frame.astype(float), origin='lower', extent=(left, right, bottom, top), cmap='inferno')
    if fit is not None:
        axes.plot(*np.vstack((fit.outline, fit.outline[:1])).T, color='cyan')
        axes.set_title(fit.shape.value)
    return axes
