"""The touches of a pad, in bounded memory: MOST_TOUCHES are listed, the PICTURED longest with their picture."""

import heapq
from dataclasses import replace

from tactile_node.report.touch import Touch

MOST_TOUCHES = 500      #: on the page
PICTURED = 24   #: a page of 2 pads stays below 1 MB


class TouchList:
    """To add, look at ``is_full`` first and count what is ``left_out``: the outline of a touch costs time."""

    def __init__(self) -> None:
        self._touches: list[Touch] = []
        self._longest: list[tuple[float, int]] = []  # seconds, index of those with a picture
        self.left_out = 0  #: beyond MOST_TOUCHES
        self.small_frames = 0  #: frames with a contact of too few taxels for a touch

    @property
    def is_full(self) -> bool:
        return len(self._touches) == MOST_TOUCHES

    def add(self, touch: Touch) -> None:
        index = len(self._touches)
        self._touches.append(touch)
        heapq.heappush(self._longest, (touch.end - touch.begin, index))
        if len(self._longest) > PICTURED:
            _, shortest = heapq.heappop(self._longest)
            self._touches[shortest] = replace(self._touches[shortest], picture=None)

    def touches(self) -> tuple[Touch, ...]:
        """In their order in time."""
        return tuple(self._touches)
