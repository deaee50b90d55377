"""The presses of an object in the frames of a pad, as far as a calibration can use them."""

from collections.abc import Iterable
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import touches_edge
from tactile_node.contact.pattern import ContactPattern
from tactile_node.pose.pipeline import ContactPipeline, Taxels
from tactile_node.shape.recognition import Shape

LEAST_TAXELS = 40   #: of a contact: of fewer the fit's own error is larger than a skin's
AROUND = 2          #: taxels around a contact that a fit looks at
MOST_HIDDEN = 0.1   #: of contact and surroundings without a value
MOVED = 1.0         #: centres so far apart are of two presses [pitches]
OF_EACH = 6         #: frames of a press that are used, from its lightest to its hardest
LIGHTEST = 0.2      #: of the hardest one's level: lighter, the object is still being set down or lifted
REST = 0.04         #: share of the frames, the least loaded ones, that the zero is found from
LEAST_REST = 10     #: of them
MOST_SEEN = 0.9     #: of the taxels that have a value at best: frames with fewer are not at rest for certain


class Unused(IntEnum):
    """Why a frame with a contact is of no use. The codes are stable."""

    NOT_KNOWN = 0
    SEVERAL_CONTACTS = 1
    AT_EDGE = 2
    TOO_SMALL = 3
    HIDDEN = 4      #: dead, missing or stuck taxels
    SATURATED = 5   #: readings at the end of their range
    NO_CIRCLE = 6   #: recognised as another shape, or as none


class PressFrame(NamedTuple):
    """One frame of a press."""

    readings: np.ndarray  #: (rows, cols), NaN = no valid value
    mask: np.ndarray      #: bool, the contact


class Presses(NamedTuple):
    """Presses, each a list of frames from the lightest to the hardest; ``unused`` counts the others by reason."""

    presses: list[list[PressFrame]]
    unused: dict[Unused, int]


def zeroed(frames: np.ndarray) -> np.ndarray:
    """Return ``frames``, (K, rows, cols), less each taxel's median in those in which the pad is loaded least."""
    values = np.isfinite(frames).sum((1, 2))
    whole = frames[values > MOST_SEEN * values.max(initial=0)]  # lost TPDOs would look like a light load
    count = max(int(REST * len(whole)), LEAST_REST)
    if count > len(whole) / 2:
        return frames
    at_rest = whole[np.argsort(np.nanmean(whole, axis=(1, 2)), kind='stable')[:count]]
    seen = np.isfinite(at_rest).any(0)
    zero = np.zeros(frames.shape[1:], frames.dtype)
    zero[seen] = np.nanmedian(at_rest[:, seen], axis=0)
    less: np.ndarray = frames - zero
    return less


def find_presses(frames: Iterable[np.ndarray], saturated: Iterable[np.ndarray | None], unit: str | None) -> Presses:
    """Return the presses in successive frames, each (rows, cols), with which of their taxels are saturated."""
    pipeline = ContactPipeline()
    presses: list[list[PressFrame]] = []
    unused: dict[Unused, int] = {}
    centre: np.ndarray | None = None  # of the contact in the frame before
    for readings, at_end in zip(frames, saturated):
        found = pipeline.find(readings, Taxels(unit=unit), saturated=at_end)
        pattern = found.pattern
        if not pattern.contacts:
            centre = None
            continue
        before, centre = centre, np.argwhere(pattern.mask).mean(0)
        if before is None or np.hypot(*(centre - before)) > MOVED:
            presses.append([])
        reason = _unusable(pattern)
        if reason is None and pipeline.recognise_alone(found)[1].shape is not Shape.CIRCLE:
            reason = Unused.NO_CIRCLE
        if reason is None:
            presses[-1].append(PressFrame(pattern.values, pattern.mask))
        else:
            unused[reason] = unused.get(reason, 0) + 1
    return Presses([_chosen(press) for press in presses if press], unused)


def _unusable(pattern: ContactPattern) -> Unused | None:
    if pattern.contacts > 1:
        return Unused.SEVERAL_CONTACTS
    if touches_edge(pattern.mask):
        return Unused.AT_EDGE
    if pattern.sizes[0] < LEAST_TAXELS:
        return Unused.TOO_SMALL
    around = ndimage.binary_dilation(pattern.mask, np.ones((3, 3)), AROUND)
    if pattern.hidden[around].mean() > MOST_HIDDEN:
        return Unused.HIDDEN
    return Unused.SATURATED if pattern.saturated[pattern.mask].any() else None


def _chosen(press: list[PressFrame]) -> list[PressFrame]:
    """Frames at equal steps between the lightest, of those pressed for certain, and the hardest."""
    levels = np.array([np.nanmean(frame.readings[frame.mask]) for frame in press])
    order = np.argsort(levels, kind='stable')
    order = order[levels[order] >= LIGHTEST * levels[order[-1]]]
    picked = np.unique(np.linspace(0, len(order) - 1, OF_EACH).round().astype(int))
    return [press[order[place]] for place in picked]
