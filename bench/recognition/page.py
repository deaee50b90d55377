"""Write tables as text, CSV and Markdown, so that no number is typed by hand."""

import csv
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

WIDTH = 118  #: Text width of the page [columns].
KIND = {True: 'on/off', False: 'pressures'}
GENERATED = '<!-- Written by {}; not to be edited. -->\n'


class Table:
    """A table with a heading, a description, and columns and rows of text."""

    def __init__(self, heading: str, text: str, columns: list[str]):
        self.heading = heading
        self.text = text
        self.columns = columns
        self.rows: list[list[str]] = []

    def add(self, *row) -> None:
        self.rows.append([str(value) for value in row])

    def record(self, folder: Path) -> None:
        """Write all rows as CSV into ``folder``, in a file named after the heading."""
        folder.mkdir(exist_ok=True)
        with (folder / f'{file_name(self.heading)}.csv').open('w', newline='', encoding='utf-8') as stream:
            csv.writer(stream, lineterminator='\n').writerows([self.columns, *self.rows])

    def plain(self) -> str:
        widths = [max(map(len, column)) for column in zip(self.columns, *self.rows)]
        lines = ['  '.join(value.ljust(width) for value, width in zip(row, widths)).rstrip()
                 for row in (self.columns, *self.rows)]
        return '\n'.join([f'\n{self.heading}: {self.text}', *lines])


def file_name(heading: str) -> str:
    """Return the file name of a recorded table without its suffix.

    >>> file_name('Known shapes, with a blemish')
    'known_shapes_with_a_blemish'
    """
    return re.sub(r'[^a-z0-9]+', '_', heading.lower())


def markdown_table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    return ['| ' + ' | '.join(row) + ' |' for row in (columns, ['---'] * len(columns), *rows)]
