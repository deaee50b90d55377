"""Taxels and shapes as text: pictures side by side, redrawn in place on a terminal."""

import sys
from collections.abc import Sequence
from typing import NamedTuple, TextIO

import numpy as np

SHADES = ' .:-=+*#%@'
COLOURS = (16, 17, 18, 19, 54, 90, 126, 162, 198, 203, 208, 214, 220, 226, 229, 231)  # xterm-256: dark to bright
CLEAR_LINE = '\x1b[2K'
CLEAR_BELOW = '\x1b[J'
GAP = '   '        #: between two pads
LEAST_WIDTH = 38   #: of a pad [columns]: two fit into 80


class PadView(NamedTuple):
    """What is known of one pad: the latest taxels (rows, cols) as fractions of full scale, and words below."""

    name: str
    taxels: np.ndarray
    words: str


def picture(taxels: np.ndarray, colour: bool) -> list[str]:
    """Return the lines of a picture, two characters a taxel; '??' marks a taxel without a value.

    >>> picture(np.array([[0.0, 1.0, np.nan]]), colour=False)
    ['  @@??']
    """
    return [''.join(_cell(value, colour) for value in row) for row in taxels.tolist()]


def side_by_side(views: Sequence[PadView], colour: bool) -> list[str]:
    """Return the lines of several pads next to each other, names above, words (lines of them) below."""
    if not views:
        return []
    columns = []
    most = max(view.words.count('\n') for view in views) + 1
    rows = max(len(view.taxels) for view in views)
    for view in views:
        width = _width(view)
        pad = ' ' * (width - 2 * view.taxels.shape[1])
        words = [line[:width] for line in view.words.split('\n')]
        drawn = [line + pad for line in picture(view.taxels, colour)]
        drawn += [' ' * width] * (rows - len(drawn))
        columns.append([f'{view.name[:width]:<{width}}', *drawn,
                        *(f'{line:<{width}}' for line in words + [''] * (most - len(words)))])
    return [GAP.join(lines) for lines in zip(*columns)]


def width_of(views: Sequence[PadView]) -> int:
    """Return how many columns `side_by_side` takes."""
    return sum(map(_width, views)) + len(GAP) * (len(views) - 1)


def _width(view: PadView) -> int:
    return max(2 * view.taxels.shape[1], LEAST_WIDTH)


class LivePictures:
    """Redraws pictures in place where ``stream`` is a terminal; elsewhere prints only the pictures to keep."""

    def __init__(self, stream: TextIO = sys.stdout):
        self._stream = stream
        self._live = stream.isatty()
        self._height = 0

    def show(self, views: Sequence[PadView], footer: str) -> None:
        """Draw, over what was drawn before."""
        if self._live:
            self._write([*side_by_side(views, True), footer], back=self._height)

    def keep(self, views: Sequence[PadView]) -> None:
        """Print a picture that stays, where nothing can be redrawn."""
        if not self._live:
            self._write([*side_by_side(views, False), ''], back=0)

    def _write(self, lines: list[str], back: int) -> None:
        up = f'\x1b[{back}A' if back else ''
        start = CLEAR_LINE if self._live else ''
        below = CLEAR_BELOW if self._live else ''  # what a taller picture has left
        self._stream.write(up + ''.join(f'{start}{line}\n' for line in lines) + below)
        self._stream.flush()
        self._height = len(lines)


def _cell(value: float, colour: bool) -> str:
    if value != value:
        return '??'
    level = min(max(value, 0.0), 1.0)
    if not colour:
        return 2 * SHADES[round(level * (len(SHADES) - 1))]
    return f'\x1b[48;5;{COLOURS[round(level * (len(COLOURS) - 1))]}m  \x1b[0m'
