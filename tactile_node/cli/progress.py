"""Show the progress of a long task and the time left with tqdm on stderr, if stderr is a terminal."""

import sys
from collections.abc import Iterable, Iterator
from typing import TypeVar

from tqdm import tqdm

BAR_DELAY = 1.0  #: duration of a task below which no bar appears [s]

Item = TypeVar('Item')


def show_progress(items: Iterable[Item], what: str, total: int, *, prints: bool) -> Iterator[Item]:
    """Yield frames and show how many of them are done.

    Parameters
    ----------
    items
        Frames to pass on.
    what
        Text next to the bar.
    total
        Number of frames.
    prints
        True if the results go to standard output. If that is a terminal, the results show the progress and no bar is
        drawn.
    """
    hidden = True if prints and sys.stdout.isatty() else None  # None: tqdm shows the bar on a terminal only
    yield from tqdm(items, what, total, unit=' frames', delay=BAR_DELAY, disable=hidden, leave=False,
                    dynamic_ncols=True)


def count_progress(what: str, unit: str, total: int | None = None) -> tqdm:
    """Return a progress bar whose ``update(n)`` adds ``n``; without ``total`` it shows only the count and the rate."""
    return tqdm(desc=what, total=total, unit=unit, delay=BAR_DELAY, disable=None, dynamic_ncols=True)
