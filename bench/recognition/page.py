"""The tables as text, CSV and Markdown, and the pictures of failures; nothing in them is typed by hand."""

import csv
import textwrap
from collections.abc import Iterable
from pathlib import Path

import matplotlib
import numpy as np

from bench.recognition.contest import ORDER, OURS, Result

matplotlib.use('Agg')
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.patches import Patch  # noqa: E402

WIDTH = 118  #: of the page's text
COLOURS = plt.get_cmap('viridis').with_extremes(bad='white')
BEYOND = '#c8c8c8'
PANEL, BETWEEN, WORDS, BELOW = 2.0, 0.18, 0.88, 0.55  #: side, gap, room above a panel, and below all [inch]
AROUND = 3  #: taxels around a contact that are shown
KIND = {True: 'on/off', False: 'pressures'}
GENERATED = '<!-- Written by {}; not to be edited. -->\n'


class Table:
    """A heading, a line about it, columns and rows of text."""

    def __init__(self, heading: str, text: str, columns: list[str]):
        self.heading = heading
        self.text = text
        self.columns = columns
        self.rows: list[list[str]] = []

    def add(self, *row) -> None:
        self.rows.append([str(value) for value in row])

    def markdown(self) -> str:
        text = textwrap.fill(self.text, WIDTH, break_on_hyphens=False)
        lines = [f'## {self.heading}\n', text, '', '| ' + ' | '.join(self.columns) + ' |',
                 '| ' + ' | '.join('---' for _ in self.columns) + ' |']
        return '\n'.join([*lines, *('| ' + ' | '.join(row) + ' |' for row in self.rows), ''])

    def plain(self) -> str:
        widths = [max(map(len, column)) for column in zip(self.columns, *self.rows)]
        lines = ['  '.join(value.ljust(width) for value, width in zip(row, widths)).rstrip()
                 for row in (self.columns, *self.rows)]
        return '\n'.join([f'\n{self.heading}: {self.text}', *lines])


def write_csv(path: Path, results: list[Result]) -> None:
    """One line a case and contestant."""
    with path.open('w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream)
        writer.writerow(['condition', 'frames', 'area_taxels', 'contestant', 'right', 'count', 'rate', 'low', 'high'])
        for result in results:
            for name in result.answers:
                rate = result.rate(name)
                writer.writerow([result.case.condition, KIND[result.case.on_off], result.case.area, name, rate.right,
                                 rate.total, f'{rate.value:.5f}', *(f'{bound:.5f}' for bound in rate.interval)])


def write_page(path: Path, title: str, tables: list[Table], pictures: list[tuple[str, str]],
               script: str = 'bench/bench_recognition.py') -> None:
    text = [GENERATED.format(script), f'# {title}\n', *(table.markdown() for table in tables)]
    text += [f'## {caption}\n\n![{caption}]({file})\n' for file, caption in pictures]
    path.write_text('\n'.join(text), encoding='utf-8')


def draw_failures(path: Path, results: Iterable[Result], columns: int = 6, rows: int = 4) -> int:
    """Draw the first failures of ours, the conditions in turn; return how many there are in all."""
    failed = [[(result, k) for k in np.flatnonzero(~result.right(OURS))] for result in results]
    alternating = [one for rank in range(max(map(len, failed), default=0)) for one in
                   (case[rank] for case in failed if rank < len(case))]
    width, height = columns * (PANEL + BETWEEN) + BETWEEN, rows * (PANEL + WORDS) + BELOW
    figure, axes = plt.subplots(rows, columns, figsize=(width, height), gridspec_kw={
        'left': BETWEEN / width, 'right': 1 - BETWEEN / width, 'wspace': BETWEEN / PANEL, 'hspace': WORDS / PANEL,
        'top': 1 - WORDS / height + 0.2 / height, 'bottom': BELOW / height})
    for axis in axes.flat:
        axis.axis('off')
    for axis, (result, k) in zip(axes.flat, alternating):
        _draw(axis, result, k)
    figure.legend(handles=[Patch(facecolor='white', edgecolor='black', label='no valid value'),
                           Patch(facecolor=BEYOND, label='beyond the pad'),
                           Patch(facecolor=COLOURS(0.0), label='not pressed'),
                           Patch(facecolor=COLOURS(1.0), label='pressed most')],
                  loc='lower center', ncols=4, fontsize=9, frameon=False)
    figure.savefig(path, dpi=80)
    plt.close(figure)
    return len(alternating)


def _draw(axis, result: Result, k: int) -> None:
    """The contact with what is around it, a square of taxels, so that panels and titles stand in line."""
    pattern, answer = result.case.patterns[k], result.answers[OURS][k]
    touched = np.argwhere(pattern.mask)
    low, high = (touched.min(0), touched.max(0) + 1) if len(touched) else (np.zeros(2, int), np.full(2, 12))
    side = int((high - low).max()) + 2 * AROUND
    top, left = ((low + high - side) // 2).tolist()
    rows, cols = pattern.values.shape
    axis.set_facecolor(BEYOND)
    axis.imshow(np.ma.masked_invalid(pattern.values), cmap=COLOURS, extent=(0, cols, rows, 0))
    axis.set(xlim=(left, left + side), ylim=(top + side, top))
    axis.axis('on')
    axis.tick_params(length=2, pad=1)
    axis.set_xticks([left, left + side], ['0', f'{side} taxels'], fontsize=8)
    for label, alignment in zip(axis.get_xticklabels(), ('left', 'right')):
        label.set_horizontalalignment(alignment)
    axis.set_yticks([])
    said = f'{ORDER[answer.argmax()].value} {answer.max():.2f}'.replace('_', ' ')
    true = ORDER[result.case.labels[k]].value.replace('_', ' ')
    title = [*textwrap.wrap(result.case.condition, 28), f'is: {true}', f'answer: {said}']
    axis.set_title('\n'.join(title), fontsize=8.5, loc='left')
