"""Show a source on a terminal, for example over ssh, as pictures redrawn in place or as one line of text per second."""

import shutil
import sys
import time
from collections.abc import Sequence
from textwrap import wrap
from threading import Event
from typing import NamedTuple, TextIO

import numpy as np

from tactile_node.colour_map import PALETTE
from tactile_node.viewing.contact_text import contact_text
from tactile_node.viewing.drawn_pad import DrawnPad, Scales, said_of
from tactile_node.viewing.levels import OLD_STATUS_AGE, levels_of
from tactile_node.viewing.source import ViewSource, ViewState
from tactile_node.viewing.templates import printable_text

SHADES = ' .:-=+*#%@'
#: xterm-256 has a cube of 6 x 6 x 6 colours that starts at 16. These are the limits between its levels, of 255.
CUBE_LIMITS = 48, 115, 155, 195, 235
#: number of the xterm-256 colour next to each colour of PALETTE
XTERM_COLOURS = 16 + np.searchsorted(CUBE_LIMITS, PALETTE) @ (36, 6, 1)
CLEAR_LINE = '\x1b[2K'
CLEAR_BELOW = '\x1b[J'  #: clears the rest of a taller previous picture
PAD_GAP = '   '        #: space between two pads
LEAST_WIDTH = 38   #: minimum width of a pad [columns], so that two pads fit into 80 columns


class PadView(NamedTuple):
    """A pad to display: its taxels (rows, cols) as fractions of full scale, and the text below the picture."""

    name: str
    taxels: np.ndarray
    words: str


def picture(taxels: np.ndarray, colour: bool) -> list[str]:
    """Return the lines of a picture with two characters per taxel. '??' marks a taxel without a value.

    >>> picture(np.array([[0.0, 1.0, np.nan]]), colour=False)
    ['  @@??']
    """
    return [''.join(_cell(value, colour) for value in row) for row in taxels.tolist()]


def side_by_side(views: Sequence[PadView], colour: bool) -> list[str]:
    """Return the lines of several pads side by side, each with the name of the pad above and its text below."""
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
    return [PAD_GAP.join(lines) for lines in zip(*columns)]


def width_of(views: Sequence[PadView]) -> int:
    """Return the number of columns that `side_by_side` needs."""
    return sum(map(_width, views)) + len(PAD_GAP) * (len(views) - 1)


def _width(view: PadView) -> int:
    return max(2 * view.taxels.shape[1], LEAST_WIDTH)


def draw(stream: TextIO, lines: Sequence[str], back: int) -> int:
    """Overwrite the ``back`` lines drawn last time with ``lines``, and return the number of lines drawn."""
    up = f'\x1b[{back}A' if back else ''
    stream.write(up + ''.join(f'{CLEAR_LINE}{line}\n' for line in lines) + CLEAR_BELOW)
    stream.flush()
    return len(lines)


def _cell(value: float, colour: bool) -> str:
    if value != value:
        return '??'
    level = min(max(value, 0.0), 1.0)
    if not colour:
        return 2 * SHADES[round(level * (len(SHADES) - 1))]
    return f'\x1b[48;5;{XTERM_COLOURS[round(level * (len(XTERM_COLOURS) - 1))]}m  \x1b[0m'


PICTURE_PERIOD = 0.1       #: time between two pictures [s]
LINE_PERIOD = 1.0  #: time between two lines of text [s]


def show_in_terminal(source: ViewSource, stop_requested: Event, stream: TextIO | None = None,
                     full_scale: float = 0.0) -> None:
    """Show ``source`` until ``stop_requested`` is set or a recording reaches its end."""
    stream = sys.stdout if stream is None else stream
    live, scales, height = stream.isatty(), Scales(full_scale), 0
    source.start()
    try:
        while not stop_requested.wait(PICTURE_PERIOD if live else LINE_PERIOD):
            shown = source.store.shown()
            drawn = scales.drawn_now(source, shown)
            views, footer = [_view(pad) for pad in drawn], _footer(source, shown)
            columns = shutil.get_terminal_size().columns
            levels = _levels(shown)
            if not live:
                print('; '.join((line_of(drawn, footer), *levels)), file=stream, flush=True)
            elif width_of(views) > columns:
                narrow = f'needs {width_of(views)} columns; {line_of(drawn, footer)}'
                height = draw(stream, [narrow[:columns - 1]], height)
            else:
                wrapped = [part for line in levels for part in wrap(line, columns - 1)]
                height = draw(stream, [*side_by_side(views, True), footer[:columns - 1], *wrapped], height)
            if source.player is not None and source.player.is_complete and not source.player.is_playing:
                return
    finally:
        source.stop()


def _levels(shown: ViewState) -> list[str]:
    """Return level and text of the driver and each pad, or the age of a driver's status that is old."""
    age, levels = time.monotonic() - shown.bus_acquired, levels_of(shown.bus)
    if levels and age > OLD_STATUS_AGE:
        return [f'driver: no status for {age:.0f} s']
    return [printable_text(f'{each.where}: {each.text}') for each in levels]


def line_of(drawn: list[DrawnPad], footer: str) -> str:
    """Return the state of all pads as one line of text."""
    return '; '.join((*(f'{printable_text(pad.name)}: {_said(pad)}' for pad in drawn), footer))


def _view(pad: DrawnPad) -> PadView:
    """Return the view of a pad with row 0 at the bottom, as on the page. Old values are not drawn."""
    if pad.state is None:
        return PadView(printable_text(pad.name), np.full((1, 1), np.nan), _said(pad))
    values = pad.state.values / pad.full_scale if pad.is_live else np.full_like(pad.state.values, np.nan)
    return PadView(printable_text(pad.name), values[::-1], _said(pad).replace(', ', '\n'))


def _said(pad: DrawnPad) -> str:
    return printable_text(contact_text(pad.state.contact)) if pad.state is not None and pad.is_live else said_of(pad)


def _footer(source: ViewSource, shown: ViewState) -> str:
    player = source.player
    so_far = '' if player is None or player.is_complete else ' read so far'
    at = '' if player is None else f' {player.position:.1f} of {player.length:.1f} s{so_far}'
    return printable_text(f'{source.title}{at}' + (f'; {shown.problem}' if shown.problem else ''))
