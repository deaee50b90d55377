"""Make pages of results from recorded tables, with the main columns of the CSV files.

Each table is recorded as a CSV file in a folder next to the page. The file is named after the heading of the table. A
note about the table is a file of the same name with the suffix .txt. The file `about.txt` describes the run that
recorded the tables.
"""

import csv
import re
import textwrap
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import NamedTuple

from bench.recognition.page import GENERATED, WIDTH, file_name, markdown_table

Row = dict[str, str]
#: Function that makes the cells of one page row, by column, from the recorded rows that belong to this row.
Cells = Callable[[list[Row]], dict[str, str]]


class View(NamedTuple):
    """A table on the page. Recorded rows with the same values in the columns ``down`` become one row."""

    heading: str
    text: str              #: description, in which a column name in braces is replaced by the value in the first row
    source: str            #: heading of the recorded table
    down: tuple[str, ...]  #: columns that identify a row
    cells: Cells
    shown: Callable[[Row], bool] = lambda row: True  #: function that returns True for each recorded row to show


def value(row: Row, column: str) -> str:
    """Return a rate without its interval. Bold marks a rate that misses its requirement, * a rate below the anchors."""
    text = re.split(r' [(\[]', row[column])[0]
    mark = '*' if row.get('ours against the better') == 'BELOW' and column.startswith('ours') else ''
    return f'**{text}**' if row.get('required') == 'NOT MET' and column.startswith('ours') else text + mark


def of(*columns: str) -> Callable[[Row], str]:
    """Return a function that joins the values from ``columns`` of a row.

    The function skips missing columns, such as the columns of the anchors after a run without them.
    """
    return lambda row: ' / '.join(value(row, column) for column in columns if column in row)


def across(column: str, show: Callable[[Row], str]) -> Cells:
    """Return cells with one page column per value of ``column``, and join the texts that fall into the same column."""
    def cells(rows: list[Row]) -> dict[str, str]:
        found: dict[str, list[str]] = {}
        for row in rows:
            found.setdefault(row[column], []).append(show(row))
        return {name: ' / '.join(texts) for name, texts in found.items()}
    return cells


def columns(**shown: Callable[[Row], str]) -> Cells:
    """Return cells with one column per keyword, each filled by the function passed for that keyword."""
    return lambda rows: {name.replace('_', ' '): show(rows[0]) for name, show in shown.items()}


def names(*shown: str) -> Cells:
    """Return cells that show recorded columns unchanged."""
    return lambda rows: {name: rows[0][name] for name in shown if name in rows[0]}


def lines_of(view: View, rows: list[Row]) -> list[str]:
    """Return the Markdown lines of a table, with the rows in the recorded order."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in filter(view.shown, rows):
        groups.setdefault(tuple(row[name] for name in view.down), []).append(row)
    cells = {key: view.cells(of_row) for key, of_row in groups.items()}
    heads = list(dict.fromkeys(name for each in cells.values() for name in each))
    return markdown_table([*view.down, *heads],
                          [[*key, *(each.get(name, '') for name in heads)] for key, each in cells.items()])


class ResultPage(NamedTuple):
    """A page of results, made from the recorded tables in a folder."""

    script: str   #: command that writes the page
    file: str     #: name of the page
    tables: str   #: folder of the recorded tables
    title: str
    reading: str  #: explanation that applies to all tables of the page
    views: Sequence[View]
    picture: tuple[str, str] = ('', '')  #: file name and caption of the picture

    def write(self, folder: Path, recorded: Collection[str] | None = None) -> None:
        """Write the page into ``folder``, with all tables or only with those whose headings are in ``recorded``."""
        (folder / self.file).write_text(self.text(folder, recorded), encoding='utf-8')

    def text(self, folder: Path, recorded: Collection[str] | None = None) -> str:
        """Return the text of the page that `write` writes."""
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
        text += (f' {missed} of {len(verdicts)} values do not meet this requirement.' if missed
                 else ' All values meet this requirement.')
    return [f'## {view.heading}', '', *([_filled(text), ''] if text else []), *_note(tables, name),
            *lines_of(view, rows), '']


def _note(tables: Path, name: str) -> list[str]:
    path = tables / f'{name}.txt'
    return [*map(_filled, path.read_text(encoding='utf-8').splitlines()), ''] if path.exists() else []


def _filled(text: str) -> str:
    return textwrap.fill(text, WIDTH, break_on_hyphens=False, break_long_words=False)
