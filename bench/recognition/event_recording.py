"""Reads recordings of the real 64x64 event-based array (NUS SINAPSE): a line an event, "stamp x y polarity"."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tactile_node.errors import InputError

SIDE = 64
STAMP_UNIT = 1e-3  # s; the recordings do not say. Polls are 64 units apart, as they would be at about 16 Hz


class Event(NamedTuple):
    stamp: int
    row: int
    col: int
    pressed: bool


class Recording(NamedTuple):
    """``stamps`` [s], shape (polls,); ``frames`` bool, shape (polls, 64, 64): pressed after each poll."""

    stamps: np.ndarray
    frames: np.ndarray
    skipped: dict[str, int]  #: lines that are no event, by reason


def load_recording(path: str | Path) -> Recording:
    """Read a recording; InputError when it is missing or holds no event."""
    skipped: Counter[str] = Counter()
    try:
        lines = Path(path).read_text(encoding='ascii', errors='replace').splitlines()
    except OSError as error:
        raise InputError(str(path), expected='a recording of taxel events', got=error.strerror or str(error),
                         remedy='Check the path.') from error
    events = list(_events(lines, skipped))
    if not events:
        raise InputError(str(path), expected='lines "stamp x y polarity"', got=f'none ({dict(skipped)})',
                         remedy='Give a recording in that format.')
    stamps = np.array(sorted({event.stamp for event in events}))
    frames = np.zeros((len(stamps), SIDE, SIDE), bool)
    state, begun = np.zeros((SIDE, SIDE), bool), 0
    for poll, stamp in enumerate(stamps):
        while begun < len(events) and events[begun].stamp == stamp:
            _, row, col, state[row, col] = events[begun]
            begun += 1
        frames[poll] = state
    return Recording(stamps * STAMP_UNIT, frames, dict(skipped))


def _events(lines: list[str], skipped: Counter) -> Iterator[Event]:
    latest = 0
    for line in lines:
        words = line.split()
        if not words:
            continue
        reason = _noise(words, latest)
        if reason:
            skipped[reason] += 1
        else:
            latest = int(words[0])
            yield Event(latest, int(words[1]), int(words[2]), words[3] == '1')


def _noise(words: list[str], latest: int) -> str | None:
    """Why these words are no event, None when they are one."""
    if len(words) != 4 or not all(word.isdecimal() for word in words):
        return 'not_four_numbers'
    stamp, row, col, polarity = map(int, words)
    if row >= SIDE or col >= SIDE:
        return 'outside_the_array'
    if polarity > 1:
        return 'unknown_polarity'
    return 'stamp_fell' if stamp < latest else None
