"""Progress of long work with the time left, by tqdm, on stderr; silent where that is no terminal."""

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from tqdm import tqdm

DELAY = 1.0  #: what takes less shows nothing [s]
SHARE = '{desc}: {percentage:3.0f}% |{bar}| {elapsed}, {remaining} left'

Item = TypeVar('Item')


def followed(items: Iterable[Item], what: str, total: int, *, prints: bool, unit: str = ' frames') -> Iterator[Item]:
    """Yield ``items`` and show how many of ``total`` are done.

    ``prints``: their results go to standard output. Where that is a terminal they show the progress, and no bar does.
    """
    hidden = True if prints and sys.stdout.isatty() else None  # None: shown on a terminal only
    yield from tqdm(items, what, total, unit=unit, delay=DELAY, disable=hidden, leave=False, dynamic_ncols=True)


@contextmanager
def counted(what: str, unit: str, total: int | None = None) -> Iterator[tqdm]:
    """A bar whose ``update(n)`` counts ``n`` more; without ``total`` it shows count and rate alone."""
    with tqdm(desc=what, total=total, unit=unit, delay=DELAY, disable=None, dynamic_ncols=True) as bar:
        yield bar


class Stages:
    """A bar for work in stages, some of which know what share of them is done."""

    def __init__(self) -> None:
        self._bar: tqdm | None = None
        self._stage = ''

    def show(self, stage: str, share: float | None = None) -> None:
        """Begin ``stage``, or go on with it up to ``share``."""
        if self._bar is None or stage != self._stage:
            self.close()
            form = '{desc} ({elapsed})' if share is None else SHARE
            self._bar = tqdm(desc=stage, total=1.0, bar_format=form, disable=None, dynamic_ncols=True)
            self._stage = stage
        if share is not None:
            self._bar.update(share - self._bar.n)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
