"""Waits until the last taxel frames of a stopped source have come out as shapes."""

from collections.abc import Callable
from threading import Event

from tactile_node.frames.frame_source import FrameSource
from tactile_node.nodes.spinning import Spinner

TIMEOUT = 5.0  # s without a new shape: no more will come
POLL_PERIOD = 0.05  # s


def published_frames(source: FrameSource) -> int:
    """Taxel frames of all pads that the driver has published."""
    return sum(pad.published for pad in source.statistics().pads.values())


def drain(source: FrameSource, shapes: Callable[[], int], spinner: Spinner, stop_requested: Event) -> int:
    """Wait until ``shapes()`` counts as many as ``source`` has published, or none has come for TIMEOUT.

    Returns the count; raises what a callback has raised.
    """
    count, remaining = shapes(), TIMEOUT
    while remaining > 0 and not stop_requested.wait(POLL_PERIOD):
        spinner.check()
        before, count = count, shapes()
        if count >= published_frames(source):
            break
        remaining = TIMEOUT if count > before else remaining - POLL_PERIOD
    return count
