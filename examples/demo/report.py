"""The demo's results as a table, for the terminal and as CSV."""

import csv
from pathlib import Path

import numpy as np

from examples.demo.observation import SeenFit, Verdict

SHOWN = ('pad', '[s]', 'true', 'prob', 'true size', 'size')  #: what fits into the 80 columns of a terminal
TOUCHED = ('pad', 'touch', 'taxels', 'angle_deg', 'true', 'recognised', 'confidence', 'frames')
FOUND = ('size1_mm', 'size2_mm', 'size_sd_mm', 'x_mm', 'y_mm', 'centre_sd_mm', 'found_angle_deg', 'angle_sd_deg')


def table(verdicts: list[Verdict], pitch: float) -> str:
    """Return the table as text, a line a touch, wrong ones marked; ``pitch`` of the pads [m]."""
    cells = [_shown(verdict, pitch) for verdict in verdicts]
    widths = [max(map(len, column)) for column in zip(SHOWN, *cells)]
    marks = ['', *('' if v.right else f'  <- wrong: {v.recognised}' for v in verdicts)]
    lines = ['  '.join(f'{cell:<{width}}' for cell, width in zip(row, widths)) for row in [SHOWN, *cells]]
    return '\n'.join((line + mark).rstrip() for line, mark in zip(lines, marks))


def write_csv(verdicts: list[Verdict], path: Path) -> None:
    with path.open('w', newline='', encoding='utf-8') as file:
        csv.writer(file).writerows([(*TOUCHED, *FOUND), *((*_touched(v), *_found(v.fit)) for v in verdicts)])


def _shown(v: Verdict, pitch: float) -> tuple[str, ...]:
    true = ' x '.join(f'{1000 * pitch * length:.1f}' for length in v.touch.contact.dimensions[:2])  # no handedness
    return (v.pad, f'{v.touch.begin:.1f}', v.touch.contact.shape, f'{v.confidence:.2f}', true,
            '' if v.fit is None else v.fit.size)


def _touched(v: Verdict) -> tuple:
    return (v.pad, f'{v.touch.begin:.1f} s', round(v.touch.contact.area), round(np.degrees(v.touch.contact.angle)),
            v.touch.contact.shape, v.recognised, f'{v.confidence:.2f}', v.frames)


def _found(fit: SeenFit | None) -> list[str]:
    """Empty where there is none: a circle has one length and no angle."""
    if fit is None:
        return len(FOUND) * ['']
    first, second = (*fit.dimensions.values(), None)[:2]
    lengths = first, second, max(map(fit.sd, fit.dimensions)), *fit.centre, max(fit.sd('x'), fit.sd('y'))
    angles = (None, None) if fit.angle is None else (fit.angle, fit.sd('angle'))
    return ['' if value is None else f'{factor * value:.3f}'
            for values, factor in ((lengths, 1000), (angles, 180 / np.pi)) for value in values]
