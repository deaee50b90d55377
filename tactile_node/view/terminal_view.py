"""A source on a terminal, for use over ssh; where nothing can be redrawn, a line of text each second."""

import shutil
import sys
from threading import Event
from typing import TextIO

import numpy as np

from tactile_node.view.heat_map import words
from tactile_node.view.page_parts import DrawnPad, Scales, said_of
from tactile_node.view.source import Source
from tactile_node.view.store import Shown
from tactile_node.view.terminal import LivePictures, PadView, width_of

PERIOD = 0.1       #: of the pictures [s]
LINE_PERIOD = 1.0  #: of lines of text [s]


def show_in_terminal(source: Source, stop_requested: Event, stream: TextIO | None = None,
                     full_scale: float | None = None) -> None:
    """Show ``source`` until the event is set, or until a recording has been played to its end."""
    stream = sys.stdout if stream is None else stream
    live, scales, pictures = stream.isatty(), Scales(full_scale), LivePictures(stream)
    source.start()
    try:
        while not stop_requested.wait(PERIOD if live else LINE_PERIOD):
            shown = source.store.shown()
            drawn = scales.drawn_now(source, shown)
            views = [_view(pad) for pad in drawn]
            if not live:
                print(line_of(drawn, _footer(source, shown)), file=stream, flush=True)
            elif width_of(views) > shutil.get_terminal_size().columns:
                narrow = f'needs {width_of(views)} columns; {line_of(drawn, _footer(source, shown))}'
                pictures.show([], narrow[:shutil.get_terminal_size().columns - 1])
            else:
                pictures.show(views, _footer(source, shown)[:shutil.get_terminal_size().columns - 1])
            if source.player is not None and source.player.is_complete and not source.player.is_playing:
                return
    finally:
        source.stop()


def line_of(drawn: list[DrawnPad], footer: str) -> str:
    """Return all pads in one line of text."""
    return '; '.join((*(f'{_printable(pad.name)}: {_said(pad)}' for pad in drawn), footer))


def _view(pad: DrawnPad) -> PadView:
    """Row 0 at the bottom, as on the page; of what is old nothing is drawn."""
    if pad.state is None:
        return PadView(_printable(pad.name), np.full((1, 1), np.nan), _said(pad))
    values = pad.state.values / pad.full_scale if pad.is_live else np.full_like(pad.state.values, np.nan)
    return PadView(_printable(pad.name), values[::-1], _said(pad).replace(', ', '\n'))


def _said(pad: DrawnPad) -> str:
    return _printable(words(pad.state.contact)) if pad.state is not None and pad.is_live else said_of(pad)


def _footer(source: Source, shown: Shown) -> str:
    player = source.player
    so_far = '' if player is None or player.is_complete else ' read so far'
    at = '' if player is None else f' {player.position:.1f} of {player.length:.1f} s{so_far}'
    return _printable(f'{source.title}{at}' + (f'; {shown.problem}' if shown.problem else ''))


def _printable(text: str) -> str:
    """Names come from topics and bags: an escape in them would be a command to the terminal."""
    return ''.join(each if each.isprintable() else '\N{REPLACEMENT CHARACTER}' for each in text)
