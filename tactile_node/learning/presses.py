"""Find presses of a disc in the frames of a pad, for the calibration of a skin."""

from collections.abc import Sequence

import numpy as np

from tactile_node.contact.neighbours import grown
from tactile_node.learning.touches import Touch, TouchFinder, TouchFrame, Unused
from tactile_node.pose.pipeline import FoundContact
from tactile_node.shape.recognition import Shape

MOST_HIDDEN_AROUND = 0.1  #: Largest share of taxels without a value in the contact and its surroundings.
PRESS_FRAMES = 6    #: Number of frames used from each press, from its lightest to its hardest frame.
REST_SHARE = 0.04   #: Share of the frames from which the zero is computed. The least loaded frames are used.
LEAST_REST = 10     #: Smallest number of frames at rest.

#: A frame counts as at rest only if it has more valid taxels than this share of the largest number in any frame. With
#: fewer valid taxels, a load on the pad may not be seen.
MOST_SEEN = 0.9


class PressFinder(TouchFinder):
    """Finds the presses of a disc on one pad. The frames of a touch run from the lightest to the hardest."""

    lightest = 0.2
    most_frames = PRESS_FRAMES
    least_taxels = 40  # with fewer taxels, the error of a fit exceeds the error due to a skin's response

    def _why_unclear(self, found: FoundContact) -> Unused | None:
        pattern = found.pattern
        if pattern.hidden[grown(grown(pattern.mask))].mean() > MOST_HIDDEN_AROUND:
            return Unused.HIDDEN
        if pattern.saturated[pattern.mask].any():
            return Unused.SATURATED
        return None if self._pipeline.recognise_alone(found)[1].shape is Shape.CIRCLE else Unused.NO_CIRCLE

    def _choose(self, frames: Sequence[TouchFrame]) -> Touch:
        return super()._choose(sorted(frames, key=lambda frame: frame.strength))


def subtract_zero(frames: np.ndarray) -> np.ndarray:
    """Return ``frames``, (K, rows, cols), with the zero of each taxel subtracted.

    The zero of a taxel is its median over the least loaded frames. If too few frames could be at rest, the frames are
    returned unchanged.
    """
    values = np.isfinite(frames).sum((1, 2))
    whole = frames[values > MOST_SEEN * values.max(initial=0)]  # a frame with lost TPDOs would look lightly loaded
    count = max(int(REST_SHARE * len(whole)), LEAST_REST)
    if count > len(whole) / 2:
        return frames
    at_rest = whole[np.argsort(np.nanmean(whole, axis=(1, 2)), kind='stable')[:count]]
    seen = np.isfinite(at_rest).any(0)
    zero = np.zeros(frames.shape[1:], frames.dtype)
    zero[seen] = np.nanmedian(at_rest[:, seen], axis=0)
    return frames - zero
