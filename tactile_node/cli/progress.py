"""Show the progress and the remaining time of a long task with tqdm, if stderr is a terminal."""

import sys
from collections.abc import Iterable, Iterator
from typing import TypeVar

from tqdm import tqdm

BAR_DELAY = 1.0  #: delay before the bar appears, so that short tasks show no bar [s]

Item = TypeVar('Item')


def show_progress(items: Iterable[Item], what: str, *, prints: bool) -> Iterator[Item]:
    """Yield frames, and show a progress bar.

    Parameters
    ----------
    items
        Frames to yield.
    what
        Text shown next to the bar.
    prints
        True if the results go to standard output. If standard output is a terminal, the results show the progress, so
        no bar is drawn.
    """
    hidden = True if prints and sys.stdout.isatty() else None  # None makes tqdm show the bar only on a terminal
    yield from tqdm(items, what, unit=' frames', delay=BAR_DELAY, disable=hidden, leave=False,
                    dynamic_ncols=True)


def count_progress(what: str, unit: str, total: int | None = None) -> tqdm:
    """Return a progress bar whose ``update(n)`` adds ``n``. Without ``total``, the bar shows only count and rate."""
    return tqdm(desc=what, total=total, unit=unit, delay=BAR_DELAY, disable=None, dynamic_ncols=True)
