"""Leaves out the CAN frames of a log whose stamp has a damaged digit: far from those before and after it."""

from collections.abc import Callable, Iterable, Iterator

import can

SET_BACK = 1.0  # s: two frames of one clock are recorded in a wrong order by less
FAR = 10.0      # s ahead of the frame before: between two frames of a skin at work there is less


def without_strays(messages: Iterable[can.Message], on_stray: Callable[[can.Message], None]) -> Iterator[can.Message]:
    """Leave out each frame that alone lies FAR ahead of its neighbours, or SET_BACK behind; ``on_stray`` gets it.

    Where a clock was set, or the bus was at rest, the next frame follows the new time.

    >>> def log(*stamps):
    ...     return [can.Message(stamp) for stamp in stamps]
    >>> strays = []
    >>> [m.timestamp for m in without_strays(log(7000, 1, 2, 9000, 3, 4, 5000, 5001, 40, 41), strays.append)]
    [1, 2, 3, 4, 5000, 5001, 40, 41]
    >>> [m.timestamp for m in strays]
    [7000, 9000]
    """
    last = message = None
    for following in messages:
        if message is not None:
            if _is_stray(last, message.timestamp, following.timestamp):
                on_stray(message)
            else:
                last = message.timestamp
                yield message
        message = following
    if message is not None:
        yield message


def _is_stray(last: float | None, stamp: float, following: float) -> bool:
    if last is None:
        return following < stamp - SET_BACK
    return not _fits(stamp, last) and _fits(following, last)


def _fits(stamp: float, last: float) -> bool:
    return last - SET_BACK <= stamp <= last + FAR
