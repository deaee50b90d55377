"""Pieces of Markdown."""

from collections.abc import Iterable, Sequence


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; a bar or a line break within a cell does not break it.

    >>> print(table(('a', 'b'), [('1', 'x | y')]))
    | a | b |
    | --- | --- |
    | 1 | x \\| y |
    """
    lines = [head, ['---'] * len(head), *([_cell(cell) for cell in row] for row in rows)]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


def code(text: object) -> str:
    """Return ``text`` as code; nothing for nothing."""
    return f'`{text}`' if str(text) else ''


def prose(text: str) -> str:
    """Return a comment of a message file as Markdown: what is neither code nor a link there stays as it is written.

    >>> prose('on <pad>/shape, see 2*pi and tpdo_ages')
    'on \\\\<pad>/shape, see 2\\\\*pi and tpdo_ages'
    """
    return ''.join('\\' + letter if letter in '<*[]' else letter for letter in text)


def _cell(text: str) -> str:
    return ' '.join(text.replace('|', '\\|').split())
