"""Show the demo's results as a table in the terminal, and write them as CSV."""

import csv
from pathlib import Path

import numpy as np

from examples.demo.observation import SIZE_TOLERANCE, Performance, SeenFit, TouchVerdict

#: table columns, which together fit into a terminal of 80 columns
SHOWN = ('pad', '[s]', 'true', 'prob', 'true size', 'size')
TOUCHED = ('pad', 'touch', 'taxels', 'angle_deg', 'true', 'recognised', 'confidence', 'frames',
           'size_error_mm')
FOUND = ('size1_mm', 'size2_mm', 'size_sd_mm', 'x_mm', 'y_mm', 'centre_sd_mm', 'found_angle_deg', 'angle_sd_deg')


def table(verdicts: list[TouchVerdict]) -> str:
    """Return the table as text with one line per touch, and mark wrong results."""
    cells = [_shown(verdict) for verdict in verdicts]
    widths = [max(map(len, column)) for column in zip(SHOWN, *cells)]
    marks = ['', *map(_mark, verdicts)]
    lines = ['  '.join(f'{cell:<{width}}' for cell, width in zip(row, widths)) for row in [SHOWN, *cells]]
    return '\n'.join((line + mark).rstrip() for line, mark in zip(lines, marks))


def _mark(v: TouchVerdict) -> str:
    if not v.is_right_shape:
        return f'  <- wrong: {v.recognised}'
    return '' if v.is_right_size else '  <- wrong size'


def score(verdicts: list[TouchVerdict]) -> str:
    """Return a sentence with the numbers of right shapes and right sizes."""
    return (f'{sum(v.is_right_shape for v in verdicts)} of {len(verdicts)} touches recognised, '
            f'{sum(v.is_right_size for v in verdicts)} of them with the right size '
            f'(within {SIZE_TOLERANCE:g} taxel pitches).')


def speed(performance: Performance) -> str:
    """Return a text about the latency for a planner, and a warning if the machine was too slow to judge it."""
    if not performance.latency:
        return 'No shape was received.'
    median, high = 1e3 * np.percentile(performance.latency, (50, 99))
    text = (f'Latency from SYNC to the shape, as seen by a planner in another process: median {median:.0f} ms, '
            f'99 % within {high:.0f} ms.\n{performance.answered:.0%} of the taxel frames have a shape.')
    if performance.is_machine_too_slow:
        late = 1e3 * performance.skin_late
        text += ('\nThis machine was too slow or too busy to judge the latency. The simulated skin alone, '
                 f'which needs a tenth of a core,\nsent 1 % of its CAN frames {late:.0f} ms late or later, and the '
                 f'nodes waited for a processor for {performance.waited:.0%} of the time.\n'
                 'Try again when two cores are idle.')
    return text


def write_csv(verdicts: list[TouchVerdict], path: Path) -> None:
    with path.open('w', newline='', encoding='utf-8') as file:
        csv.writer(file).writerows([(*TOUCHED, *FOUND), *((*_touched(v), *_found(v.fit)) for v in verdicts)])


def _shown(v: TouchVerdict) -> tuple[str, ...]:
    true = ' x '.join(f'{1000 * length:.1f}' for length in v.true_lengths)
    return (v.pad, f'{v.touch.begin:.1f}', v.touch.contact.shape, f'{v.confidence:.2f}', true,
            '' if v.fit is None else v.fit.size)


def _touched(v: TouchVerdict) -> tuple:
    return (v.pad, f'{v.touch.begin:.1f} s', round(v.touch.contact.area), round(np.degrees(v.touch.contact.angle)),
            v.touch.contact.shape, v.recognised, f'{v.confidence:.2f}', v.frames,
            '' if np.isnan(v.size_error) else f'{1000 * v.size_error:.3f}')


def _found(fit: SeenFit | None) -> list[str]:
    """Return the cells of a fit as text. Missing values, such as the angle of a circle, give empty cells."""
    if fit is None:
        return len(FOUND) * ['']
    first, second = (*fit.dimensions.values(), None)[:2]
    lengths = first, second, max(map(fit.sd, fit.dimensions)), *fit.centre, max(fit.sd('x'), fit.sd('y'))
    angles = (None, None) if fit.angle is None else (fit.angle, fit.sd('angle'))
    return ['' if value is None else f'{factor * value:.3f}'
            for values, factor in ((lengths, 1000), (angles, 180 / np.pi)) for value in values]
