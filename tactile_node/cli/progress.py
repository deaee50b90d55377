"""Progress of long work with the time left, by tqdm, on stderr; silent where that is no terminal."""

import sys
from collections.abc import Iterable, Iterator
from typing import TypeVar

from tqdm import tqdm

BAR_DELAY = 1.0  #: what takes less shows nothing [s]

Item = TypeVar('Item')


def show_progress(items: Iterable[Item], what: str, total: int, *, prints: bool) -> Iterator[Item]:
    """Yield ``items``, which are frames, and show how many of ``total`` are done.

    ``prints``: their results go to standard output. Where that is a terminal they show the progress, and no bar does.
    """
    hidden = True if prints and sys.stdout.isatty() else None  # None: shown on a terminal only
    yield from tqdm(items, what, total, unit=' frames', delay=BAR_DELAY, disable=hidden, leave=False,
                    dynamic_ncols=True)


def count_progress(what: str, unit: str, total: int | None = None) -> tqdm:
    """A bar whose ``update(n)`` counts ``n`` more; without ``total`` it shows count and rate alone."""
    return tqdm(desc=what, total=total, unit=unit, delay=BAR_DELAY, disable=None, dynamic_ncols=True)
