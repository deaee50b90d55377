"""The tables as text, CSV and Markdown, and the pictures of failures; nothing in them is typed by hand."""

import csv
import textwrap
from pathlib import Path

import matplotlib
import numpy as np

from bench.recognition.contest import ORDER, OURS, Result

matplotlib.use('Agg')
import matplotlib.pyplot as plt  # noqa: E402

WIDTH = 118  #: of the page's text
KIND = {True: 'on/off', False: 'pressures'}
GENERATED = '<!-- Written by bench/bench_recognition.py; not to be edited. -->\n'


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
                                 rate.count, f'{rate.value:.5f}', *(f'{bound:.5f}' for bound in rate.interval)])


def write_page(path: Path, title: str, tables: list[Table], pictures: list[tuple[str, str]]) -> None:
    text = [GENERATED, f'# {title}\n', *(table.markdown() for table in tables)]
    text += [f'## {caption}\n\n![{caption}]({file})\n' for file, caption in pictures]
    path.write_text('\n'.join(text), encoding='utf-8')


def draw_failures(path: Path, results: list[Result], columns: int = 6, rows: int = 4) -> int:
    """Draw the first failures of ours, the conditions in turn; return how many there are in all."""
    failed = [[(result, k) for k in np.flatnonzero(~result.right(OURS))] for result in results]
    alternating = [one for rank in range(max(map(len, failed), default=0)) for one in
                   (case[rank] for case in failed if rank < len(case))]
    figure, axes = plt.subplots(rows, columns, figsize=(columns * 2.3, rows * 2.9), layout='constrained')
    for axis in axes.flat:
        axis.axis('off')
    for axis, (result, k) in zip(axes.flat, alternating):
        _draw(axis, result, k)
    figure.savefig(path, dpi=75)
    plt.close(figure)
    return len(alternating)


def _draw(axis, result: Result, k: int) -> None:
    """The contact with what is around it, in taxels; white has no valid value."""
    pattern, answer = result.case.patterns[k], result.answers[OURS][k]
    touched = np.argwhere(pattern.mask)
    low, high = (touched.min(0) - 3, touched.max(0) + 4) if len(touched) else (np.zeros(2, int), np.full(2, 12))
    low, high = np.maximum(low, 0), np.minimum(high, pattern.values.shape)
    shown = np.ma.masked_invalid(pattern.values[low[0]:high[0], low[1]:high[1]])
    axis.imshow(shown, cmap='viridis', extent=(0, shown.shape[1], shown.shape[0], 0))
    axis.axis('on')
    axis.set_xticks([0, shown.shape[1]], ['0', f'{shown.shape[1]} taxels'], fontsize=7)
    axis.set_yticks([])
    said = f'{ORDER[answer.argmax()].value} {answer.max():.2f}'.replace('_', ' ')
    true = ORDER[result.case.labels[k]].value.replace('_', ' ')
    title = [*textwrap.wrap(result.case.condition, 26), f'is: {true}', f'said: {said}']
    axis.set_title('\n'.join(title), fontsize=8, loc='left')
