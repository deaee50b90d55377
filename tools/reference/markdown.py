"""Write tables, code and prose in Markdown."""

import textwrap
from collections.abc import Iterable, Sequence

COLUMNS = 120


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table. Bars in cells are escaped, and line breaks in cells become spaces.

    >>> print(table(('a', 'b'), [('1', 'x | y')]))
    | a | b |
    | --- | --- |
    | 1 | x \\| y |
    """
    lines = [head, ['---'] * len(head), *([_cell(cell) for cell in row] for row in rows)]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


def code(text: object) -> str:
    """Return ``text`` as inline code, or an empty string for an empty text."""
    return f'`{text}`' if str(text) else ''


def prose(text: str) -> str:
    """Return a comment from a message file as Markdown, with ``<``, ``*``, ``[`` and ``]`` escaped.

    >>> prose('on <pad>/shape, see 2*pi and tpdo_ages')
    'on \\\\<pad>/shape, see 2\\\\*pi and tpdo_ages'
    """
    return ''.join('\\' + letter if letter in '<*[]' else letter for letter in text)


def paragraph(text: str) -> str:
    """Return a comment from a message file as a paragraph of lines that fit into COLUMNS."""
    return textwrap.fill(prose(text), COLUMNS, break_long_words=False, break_on_hyphens=False)


def _cell(text: str) -> str:
    return ' '.join(text.replace('|', '\\|').split())
