"""Ways of reading the frames of a skin, each of which shows one contact."""

from collections.abc import Callable

import numpy as np

from tactile_node.contact.pattern import ContactPattern, PatternExtractor


def alone(frames: list[np.ndarray]) -> list[ContactPattern]:
    """Return the patterns of frames that are read separately, as files."""
    return [PatternExtractor().extract(frame) for frame in frames]


def after_idle(frames: list[np.ndarray], idle: Callable[[], np.ndarray]) -> list[ContactPattern]:
    """Return the patterns of frames in one stream, in which an idle frame from ``idle`` precedes each frame."""
    extractor, found = PatternExtractor(), []
    for frame in frames:
        extractor.extract(idle())
        found.append(extractor.extract(frame))
    return found


def stream(frames: list[np.ndarray]) -> list[ContactPattern]:
    """Return the patterns of frames in one stream."""
    extractor = PatternExtractor()
    return [extractor.extract(frame) for frame in frames]
