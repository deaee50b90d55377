"""The presses of a disc in the frames of a pad, as far as a calibration can use them."""

from collections.abc import Iterable

import numpy as np

from tactile_node.contact.neighbours import grown
from tactile_node.learning.touches import Touch, Touches, TouchFinder, TouchFrame, Unused, choose_frames
from tactile_node.pose.pipeline import FoundContact
from tactile_node.shape.recognition import Shape

MOST_HIDDEN_AROUND = 0.1  #: share of contact and surroundings without a value
PRESS_FRAMES = 6    #: frames of a press that are used, from its lightest to its hardest
REST_SHARE = 0.04   #: share of the frames, the least loaded ones, that the zero is found from
LEAST_REST = 10     #: frames at rest, at least
MOST_SEEN = 0.9     #: share of the taxels that have a value at best: frames with fewer are not at rest for certain


class PressFinder(TouchFinder):
    """Follows the frames of one pad on which a disc is pressed; a touch goes from its lightest to its hardest frame."""

    lightest = 0.2
    least_taxels = 40  # a fit of fewer has an error larger than a skin's

    def _why_unclear(self, found: FoundContact) -> Unused | None:
        pattern = found.pattern
        if pattern.hidden[grown(grown(pattern.mask))].mean() > MOST_HIDDEN_AROUND:
            return Unused.HIDDEN
        if pattern.saturated[pattern.mask].any():
            return Unused.SATURATED
        return None if self._pipeline.recognise_alone(found)[1].shape is Shape.CIRCLE else Unused.NO_CIRCLE

    def _choose(self, frames: list[TouchFrame]) -> Touch:
        return choose_frames(sorted(frames, key=lambda frame: frame.strength), PRESS_FRAMES)


def find_presses(frames: Iterable[np.ndarray], saturated: Iterable[np.ndarray | None], unit: str | None) -> Touches:
    """Return the presses in successive frames, each (rows, cols), with which of their taxels are saturated."""
    return PressFinder(unit).find(frames, saturated)


def subtract_zero(frames: np.ndarray) -> np.ndarray:
    """Return ``frames``, (K, rows, cols), less each taxel's median in those in which the pad is loaded least."""
    values = np.isfinite(frames).sum((1, 2))
    whole = frames[values > MOST_SEEN * values.max(initial=0)]  # lost TPDOs would look like a light load
    count = max(int(REST_SHARE * len(whole)), LEAST_REST)
    if count > len(whole) / 2:
        return frames
    at_rest = whole[np.argsort(np.nanmean(whole, axis=(1, 2)), kind='stable')[:count]]
    seen = np.isfinite(at_rest).any(0)
    zero = np.zeros(frames.shape[1:], frames.dtype)
    zero[seen] = np.nanmedian(at_rest[:, seen], axis=0)
    return frames - zero
