"""Hands taxel frames to whoever consumes them, and outlives what goes wrong there."""

import logging
from collections.abc import Callable

from tactile_node.frames.taxel_frame import TaxelFrame

logger = logging.getLogger(__name__)

OnFrame = Callable[[str, TaxelFrame], None]


class Consumer:
    """Calls ``on_frame``; its exceptions are counted and told, and end neither bus nor log."""

    def __init__(self, on_frame: OnFrame):
        self._on_frame, self.errors = on_frame, 0

    def __call__(self, pad: str, frame: TaxelFrame) -> None:
        try:
            self._on_frame(pad, frame)
        except Exception:
            self.errors += 1
            logger.exception('on_frame of pad %r failed', pad)
