"""Waits until the last taxel frames of a stopped source have come out as shapes."""

import logging
import time
from collections.abc import Callable
from threading import Event

from tactile_node.frames.frame_source import FrameSource
from tactile_node.nodes.spinning import Spinner
from tactile_node.threads.reminder import Reminder

logger = logging.getLogger(__name__)

TIMEOUT = 5.0  # s without a new shape: no more will come
POLL_PERIOD = 0.05  # s


def published_frames(source: FrameSource) -> int:
    """Taxel frames of all pads that the driver has published."""
    return sum(pad.published for pad in source.statistics().pads.values())


def drain(source: FrameSource, shapes: Callable[[], int], spinner: Spinner, stop_requested: Event) -> int:
    """Wait until ``shapes()`` counts as many as ``source`` has published, or none has come for TIMEOUT.

    Returns the count; raises what a callback has raised.
    """
    count, remaining, reminder = shapes(), TIMEOUT, Reminder()
    while remaining > 0 and not stop_requested.wait(POLL_PERIOD):
        spinner.check()
        before, count = count, shapes()
        if count >= published_frames(source):
            break
        if reminder.is_due(drain.__name__, time.monotonic()):
            logger.info('Waiting for the last shapes: %d of %d taxel frames so far.', count, published_frames(source))
        remaining = TIMEOUT if count > before else remaining - POLL_PERIOD
    return count
