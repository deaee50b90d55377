"""Taxel frames as text: a line a row of taxels, an empty line between frames, an empty cell without a valid value."""

import numpy as np

from tactile_node.errors import InputError

SEPARATORS = ',', ';', '\t'
REMEDY = 'Write numbers with a decimal point, a line for each row of taxels, and an empty line between frames.'


def read_text(content: bytes, where: str) -> np.ndarray:
    r"""Return the frames of ``content``, shape (K, rows, cols), NaN where a cell is empty or not finite.

    Cells are separated by the first of comma, semicolon and tab that the first row has, else by blanks. Lines that
    begin with # count for nothing. Raises InputError, with line and cell, for anything else.

    >>> read_text(b'1,2\n,4\n\n5,6\n7,8\n', 'a file').tolist()
    [[[1.0, 2.0], [nan, 4.0]], [[5.0, 6.0], [7.0, 8.0]]]
    """
    try:
        lines = [(number, line) for number, line in enumerate(content.decode('utf-8-sig').splitlines(), 1)
                 if not line.startswith('#')]
    except UnicodeDecodeError:
        raise _bad(where, 'text', 'bytes that are no text') from None
    first = next((line for _, line in lines if line.strip(' ')), None)
    if first is None:
        raise _bad(where, 'a row of taxels', 'no line with numbers')
    separator = next((each for each in SEPARATORS if each in first), None)
    width = len(first.split(separator))
    frames: list[list[list[float]]] = [[]]
    for number, line in lines:
        if line.strip(' '):
            frames[-1].append(_row(line.split(separator), width, f'{where}, line {number}'))
        else:
            frames.append([])
    given = [frame for frame in frames if frame]
    if len({len(frame) for frame in given}) > 1:
        raise _bad(where, f'{len(given[0])} rows in each frame, as in the first',
                   ', '.join(str(len(frame)) for frame in given[:8]))
    found = np.array(given)
    found[~np.isfinite(found)] = np.nan
    return found


def _row(cells: list[str], width: int, where: str) -> list[float]:
    if len(cells) != width:
        raise _bad(where, f'{width} cells, as in the first row', str(len(cells)))
    return [_value(cell, f'{where}, cell {place}') for place, cell in enumerate(cells, 1)]


def _value(cell: str, where: str) -> float:
    try:
        return float(cell) if cell.strip() else float('nan')
    except ValueError:
        raise _bad(where, 'a number, or nothing', repr(cell[:40])) from None


def _bad(where: str, expected: str, got: str) -> InputError:
    return InputError(where, expected=expected, got=got, remedy=REMEDY)
