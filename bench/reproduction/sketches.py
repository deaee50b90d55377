"""Draw figures 1 to 5 of the paper with our own functions."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from bench.reproduction.matrices import border, matrix
from tactile_node.helmholtz.features import Group, compute_features
from tactile_node.helmholtz.rotation import FINE, fill_holes, fine_lattice
from tactile_node.helmholtz.taxel_list import Stencil
from tactile_node.simulator.world import Contact

CIRCLE = Contact('circle', (5.3,), x=6.5, y=6.5)
ROOM = 14
INK, FAINT, ACCENT = '#222222', '#c8c8c8', '#c2410c'
RULES = {'rule 1, axis y': ['.#.', '...', '.#.'], 'rule 2, axis x': ['...', '#.#', '...'],
         'rule 3, diagonal': ['#..', '...', '..#']}


def discrete_circle() -> Figure:
    """Draw Fig. 1, in which a taxel is active if its centre lies inside the circle."""
    figure, axes = _lattice()
    mask = CIRCLE.pattern(ROOM, ROOM)
    _dots(axes, ~mask, FAINT, 12)
    _dots(axes, mask, INK, 42)
    axes.add_patch(Circle((CIRCLE.x, CIRCLE.y), CIRCLE.dimensions[0], fill=False, color=ACCENT, lw=1.5))
    axes.set_title(f'N = {mask.sum()} active taxels')
    return figure


def circle_border() -> Figure:
    """Draw Fig. 2, with the border taxels of the five-point operator in black."""
    figure, axes = _lattice()
    mask = CIRCLE.pattern(ROOM, ROOM)
    rim = border(mask, Stencil.FIVE)
    _dots(axes, ~mask, FAINT, 12)
    row, col = np.nonzero(mask & ~rim)
    axes.scatter(col, row, s=42, facecolor='white', edgecolor=INK)
    _dots(axes, rim, INK, 42)
    axes.set_title(f'P05 = {rim.sum()} border taxels')
    return figure


def centre_of_gravity() -> Figure:
    """Draw Fig. 3, the strictly lower triangle of the normalised matrix A9 with its centre of gravity T."""
    mask = Contact('rectangle', (5.2, 3.2), x=4, y=4).pattern(9, 9)
    entries = np.tril(matrix(mask, Stencil.NINE).toarray(), -1)
    i, j = np.nonzero(entries)
    values = compute_features(mask, Group.GRAVITY9).values
    figure = Figure(figsize=(4.6, 4.2), layout='constrained')
    axes = figure.add_subplot(aspect='equal', xlabel='jj', ylabel='ii', xlim=(-0.03, 1.03), ylim=(1.03, -0.03))
    marks = axes.scatter(j / (len(entries) - 1), i / (len(entries) - 1), c=-entries[i, j], s=26, cmap='Greys',
                         vmin=0, edgecolor=INK, lw=0.5)
    figure.colorbar(marks, label='-a(i, j)', shrink=0.8)
    axes.plot([0, values['y9']], [0, values['x9']], color=ACCENT)
    axes.plot(values['y9'], values['x9'], 'o', color=ACCENT)
    axes.annotate(f'T: x = {values["x9"]:.3f}, y = {values["y9"]:.3f}\nV = {values["V9"]:.3f}, '
                  f'α = {values["alpha9"]:.2f}°', (values['y9'], values['x9']), (0.42, 0.2), color=ACCENT,
                  arrowprops={'arrowstyle': '-', 'color': ACCENT})
    axes.plot([0, 1], [0, 1], color=FAINT, zorder=0)
    return figure


def fictive_points() -> Figure:
    """Draw Fig. 4, a triplet of taxels with the fictive points between the taxels."""
    fine = fine_lattice(np.array([[True, False], [True, True]]))
    real = np.zeros_like(fine)
    real[::FINE, ::FINE] = fine[::FINE, ::FINE]
    figure, axes = _lattice()
    _dots(axes, fine & ~real, INK, 18)
    _dots(axes, real, INK, 190)
    axes.set_title(f'{real.sum()} real + {(fine & ~real).sum()} fictive points')
    return figure


def hole_rules() -> Figure:
    """Draw Fig. 5, the holes before (above) and after (below) each rule fills them."""
    figure = Figure(figsize=(5.2, 3.6), layout='constrained')
    for column, (title, rows) in enumerate(RULES.items()):
        mask = np.array([[cell == '#' for cell in row] for row in rows])
        stack = np.pad(mask, 1)[np.newaxis].copy()
        fill_holes(stack)
        filled = stack[0, 1:-1, 1:-1]
        for row, after in enumerate((mask, filled)):
            axes = _bare(figure.add_subplot(2, 3, 3 * row + column + 1, aspect='equal'))
            axes.set(xlim=(-0.5, 2.5), ylim=(2.5, -0.5), title='' if row else title)
            _dots(axes, ~after, FAINT, 30)
            _dots(axes, mask, INK, 200)
            _dots(axes, after & ~mask, ACCENT, 200)
    return figure


def _lattice() -> tuple[Figure, Axes]:
    figure = Figure(figsize=(3.8, 3.9), layout='constrained')
    axes = _bare(figure.add_subplot(aspect='equal'))
    axes.invert_yaxis()
    return figure, axes


def _bare(axes: Axes) -> Axes:
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_color(FAINT)
    return axes


def _dots(axes: Axes, mask: np.ndarray, color: str, size: float) -> None:
    row, col = np.nonzero(mask)
    axes.scatter(col, row, s=size, color=color)
