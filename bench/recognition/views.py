"""Pages of results, made of recorded tables: a page shows what a reader decides by, the CSV files have the rest.

A table is recorded as CSV in the folder TABLES beside the page, named by its heading; a note about it has the same name
and ends in .txt. `about.txt` says of which run they are.
"""

import csv
import re
import textwrap
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import NamedTuple

from bench.recognition.page import GENERATED, WIDTH, file_name, markdown_table

Row = dict[str, str]
Cells = Callable[[list[Row]], dict[str, str]]  #: columns and their texts, of recorded rows that are one row of the page


class View(NamedTuple):
    """A table of the page: recorded rows that are alike in the columns ``down`` are one row."""

    heading: str
    text: str           #: may name columns of the first row in braces
    source: str         #: heading of the recorded table
    down: tuple[str, ...]
    cells: Cells
    shown: Callable[[Row], bool] = lambda row: True


def value(row: Row, column: str) -> str:
    """Return a rate without its interval, marked by the verdict of its row."""
    text = re.split(r' [(\[]', row[column])[0]
    mark = '*' if row.get('ours against the better') == 'BELOW' and column.startswith('ours') else ''
    return f'**{text}**' if row.get('required') == 'NOT MET' and column.startswith('ours') else text + mark


def of(*columns: str) -> Callable[[Row], str]:
    """Return what shows ``columns`` of a row; those that a run without anchors has not are left out."""
    return lambda row: ' / '.join(value(row, column) for column in columns if column in row)


def across(column: str, show: Callable[[Row], str]) -> Cells:
    """Return cells with a column of the page for each value of ``column``; what is shown in one is joined."""
    def cells(rows: list[Row]) -> dict[str, str]:
        found: dict[str, list[str]] = {}
        for row in rows:
            found.setdefault(row[column], []).append(show(row))
        return {name: ' / '.join(texts) for name, texts in found.items()}
    return cells


def columns(**shown: Callable[[Row], str]) -> Cells:
    return lambda rows: {name.replace('_', ' '): show(rows[0]) for name, show in shown.items()}


def names(*shown: str) -> Cells:
    return lambda rows: {name: rows[0][name] for name in shown if name in rows[0]}


def lines_of(view: View, rows: list[Row]) -> list[str]:
    """Return the lines of a table; rows in the order in which they were recorded."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in filter(view.shown, rows):
        groups.setdefault(tuple(row[name] for name in view.down), []).append(row)
    cells = {key: view.cells(of_row) for key, of_row in groups.items()}
    heads = list(dict.fromkeys(name for each in cells.values() for name in each))
    return markdown_table([*view.down, *heads],
                          [[*key, *(each.get(name, '') for name in heads)] for key, each in cells.items()])


class Page(NamedTuple):
    """A page of results, made of what is recorded in a folder."""

    script: str                      #: that writes it
    file: str
    tables: str                      #: folder of the recorded tables
    title: str
    reading: str                     #: how to read all of its tables
    views: Sequence[View]
    picture: tuple[str, str] = ('', '')  #: file and caption

    def write(self, folder: Path, recorded: Collection[str] | None = None) -> None:
        """Write it into ``folder``; ``recorded``: headings of the tables to show, default all that are there."""
        (folder / self.file).write_text(self.text(folder, recorded), encoding='utf-8')

    def text(self, folder: Path, recorded: Collection[str] | None = None) -> str:
        tables = folder / self.tables
        text = [GENERATED.format(self.script), f'# {self.title}', '']
        text += [*_note(tables, 'about'), _filled(self.reading), '']
        for view in self.views:
            if (tables / f'{file_name(view.source)}.csv').exists() and (recorded is None or view.source in recorded):
                text += _shown(view, tables)
        file, caption = self.picture
        if file and (folder / file).exists():
            text += [f'## {caption}', '', f'![{caption}]({file})', '']
        return '\n'.join(text)


def _shown(view: View, tables: Path) -> list[str]:
    name = file_name(view.source)
    with (tables / f'{name}.csv').open(newline='', encoding='utf-8') as stream:
        rows = list(csv.DictReader(stream))
    verdicts = [row['required'] for row in rows if row.get('required')]
    missed = verdicts.count('NOT MET')
    text = view.text.format_map(next(filter(view.shown, rows)))
    if verdicts and 'equired' in text:
        text += f' Not met by {missed} of {len(verdicts)}.' if missed else ' Met.'
    return [f'## {view.heading}', '', *([_filled(text), ''] if text else []), *_note(tables, name),
            *lines_of(view, rows), '']


def _note(tables: Path, name: str) -> list[str]:
    path = tables / f'{name}.txt'
    return [*map(_filled, path.read_text(encoding='utf-8').splitlines()), ''] if path.exists() else []


def _filled(text: str) -> str:
    return textwrap.fill(text, WIDTH, break_on_hyphens=False, break_long_words=False)
