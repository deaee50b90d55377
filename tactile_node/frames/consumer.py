"""Passes taxel frames on to their consumer, and survives its exceptions."""

import logging
from collections.abc import Callable

from tactile_node.frames.taxel_frame import TaxelFrame

logger = logging.getLogger(__name__)

#: Called with the pad's name and its frame
OnFrame = Callable[[str, TaxelFrame], None]


class Consumer:
    """Calls ``on_frame``. Its exceptions are counted in ``errors`` and logged; reception continues."""

    def __init__(self, on_frame: OnFrame):
        self._on_frame = on_frame
        self.errors = 0

    def __call__(self, pad: str, frame: TaxelFrame) -> None:
        try:
            self._on_frame(pad, frame)
        except Exception:
            self.errors += 1
            logger.exception('on_frame of pad %r failed', pad)
