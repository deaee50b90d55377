"""The demo's results: a table for the terminal and as CSV, and a picture of the run."""

import csv
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402 (after the backend is chosen)

from tactile_node.demo.observation import Verdict  # noqa: E402

COLUMNS = ('pad', 'touch', 'taxels', 'angle_deg', 'true', 'recognised', 'confidence', 'frames')
FULL_SCALE = 100e3  # Pa, for the colours


def rows(verdicts: list[Verdict]) -> list[tuple]:
    """Return the table's rows, in the order of COLUMNS."""
    return [(v.pad, f'{v.touch.begin:.1f} s', round(v.touch.contact.area), round(np.degrees(v.touch.contact.angle)),
             v.touch.contact.shape, v.recognised, f'{v.confidence:.2f}', v.frames) for v in verdicts]


def table(verdicts: list[Verdict]) -> str:
    """Return the table as text, a line a touch, wrong ones marked."""
    cells = [tuple(map(str, row)) for row in rows(verdicts)]
    widths = [max(map(len, column)) for column in zip(COLUMNS, *cells)]
    marks = ['', *('' if v.right else '  <- wrong' for v in verdicts)]
    lines = ['  '.join(f'{cell:<{width}}' for cell, width in zip(row, widths)) for row in [COLUMNS, *cells]]
    return '\n'.join((line + mark).rstrip() for line, mark in zip(lines, marks))


def write_csv(verdicts: list[Verdict], path: Path) -> None:
    with path.open('w', newline='', encoding='utf-8') as file:
        csv.writer(file).writerows([COLUMNS, *rows(verdicts)])


def draw(verdicts: list[Verdict], path: Path) -> None:
    """Draw every touch: its taxels, the true outline, true and recognised name."""
    columns, lines = 6, -(-len(verdicts) // 6)
    figure, axes = pyplot.subplots(lines, columns, figsize=(15, 2.9 * lines))
    for axis in axes.flat:
        axis.set_axis_off()
    for axis, verdict in zip(axes.flat, verdicts):
        _draw_touch(axis, verdict)
    figure.suptitle('tactile_skin demo: taxels under each touch, its true outline, and the shape on the topic')
    figure.tight_layout()
    figure.savefig(path, dpi=80)
    pyplot.close(figure)


def _draw_touch(axis, verdict: Verdict) -> None:
    outline = verdict.touch.contact.outline()
    axis.imshow(verdict.taxels, cmap='inferno', vmin=0, vmax=FULL_SCALE, origin='lower')
    axis.plot(*np.vstack((outline, outline[:1])).T, color='cyan', linewidth=1)
    axis.set_title(f'{verdict.pad}: {verdict.touch.contact.shape}\n-> {verdict.recognised} {verdict.confidence:.2f}',
                   fontsize=9, color='darkgreen' if verdict.right else 'firebrick')
