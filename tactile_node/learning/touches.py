"""Taxel frames -> touches: what a pad reads while one object is held on it, from contact to lift.

Of a touch a few frames at equal steps are used, on purpose, and none is recognised: the nodes answer every frame, but
the many frames of one hold teach no more than a few.
"""

from collections.abc import Iterable
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from tactile_node.contact.neighbours import touches_edge
from tactile_node.contact.pattern import ContactPattern
from tactile_node.pose.pipeline import ContactPipeline, Taxels
from tactile_node.shape.patch import join_pieces
from tactile_node.shape.shapeless import is_shapeless

OF_EACH = 5        #: frames of a touch that are used
LIGHTEST = 0.5     #: of the strongest frame of a touch: lighter, the object is still being set down or lifted
MOVED = 1.0        #: centres so far apart are of two touches [pitches]
LEAST_TAXELS = 12  #: of a contact that shows a shape
MOST_HIDDEN = 0.1  #: of its taxels without a value


class Unused(IntEnum):
    """Why a frame with a contact, or a touch, is of no use. The codes are stable."""

    NOT_KNOWN = 0
    SEVERAL_CONTACTS = 1
    AT_EDGE = 2
    TOO_SMALL = 3
    HIDDEN = 4     #: dead or missing taxels
    SHAPELESS = 5  #: ragged, a line, or from edge to edge: answered UNKNOWN whatever is taught


class TouchFrame(NamedTuple):
    """One frame of a touch."""

    values: np.ndarray  #: (rows, cols), float, NaN = no valid value
    mask: np.ndarray    #: bool, the contact with the pieces near it


class Touch(NamedTuple):
    """One object held on the pad; ``frames``: at equal steps through it, 1 to OF_EACH."""

    frames: tuple[TouchFrame, ...]

    @property
    def middle(self) -> TouchFrame:
        return self.frames[len(self.frames) // 2]


class Touches(NamedTuple):
    """``unused`` counts frames by reason."""

    touches: list[Touch]
    unused: dict[Unused, int]


class TouchFinder:
    """Follows the frames of one pad; ``unit`` as in `find_contact`."""

    def __init__(self, unit: str | None):
        self._pipeline, self._taxels = ContactPipeline(), Taxels(unit=unit)
        self._held: list[TouchFrame] = []
        self.unused: dict[Unused, int] = {}
        self.reason: Unused | None = None  #: why the latest frame was not used

    @property
    def held(self) -> int:
        """Frames of the touch under way that can be used."""
        return len(self._held)

    def feed(self, values: np.ndarray) -> list[Touch]:
        """Take a frame, (rows, cols); return the touches that have ended with it, as a rule none or one.

        A frame in which the pad is not seen ends none: it shows no lift.
        """
        found = self._pipeline.find(values, self._taxels)
        self.reason = None
        if not found.pattern.contacts:
            return self.end() if found.visibility.pad_seen else []
        pattern = join_pieces(found.pattern)
        self.reason = _unusable(pattern)
        if self.reason is None:
            self._held.append(TouchFrame(np.asarray(pattern.values, float), pattern.mask))
        else:
            self.unused[self.reason] = self.unused.get(self.reason, 0) + 1
        return []

    def is_steady(self, frames: int) -> bool:
        """Whether the last ``frames`` show one object at rest."""
        last = self._held[-frames:]
        if len(last) < frames or self.reason is not None:
            return False
        centres, strengths = np.array([_centre(each) for each in last]), np.array([_strength(each) for each in last])
        return bool(np.ptp(centres, axis=0).max() < MOVED / 2 and np.ptp(strengths) < 0.15 * strengths.max())

    def end(self) -> list[Touch]:
        """End the touch under way."""
        held, self._held = self._held, []
        return _touches(held)


def find_touches(frames: Iterable[np.ndarray], unit: str | None) -> Touches:
    """Return the touches in successive frames of one pad."""
    finder = TouchFinder(unit)
    touches = [touch for values in frames for touch in finder.feed(values)]
    return Touches(touches + finder.end(), finder.unused)


def _touches(held: list[TouchFrame]) -> list[Touch]:
    """Return the touches between two frames without a contact: one, or several where it jumps without a lift."""
    if not held:
        return []
    strengths = np.array([_strength(frame) for frame in held])
    firm = [frame for frame, strength in zip(held, strengths) if strength >= LIGHTEST * strengths.max()]
    centres = np.array([_centre(frame) for frame in firm])
    jumps = np.flatnonzero(np.hypot(*np.diff(centres, axis=0).T) > MOVED) + 1
    return [_chosen(firm[first:last]) for first, last in zip((0, *jumps), (*jumps, len(firm)))]


def _chosen(frames: list[TouchFrame]) -> Touch:
    which = np.unique(np.linspace(0, len(frames) - 1, OF_EACH).round().astype(int))
    return Touch(tuple(frames[k] for k in which))


def _unusable(pattern: ContactPattern) -> Unused | None:
    if pattern.contacts > 1:
        return Unused.SEVERAL_CONTACTS
    if touches_edge(pattern.mask):
        return Unused.AT_EDGE
    if np.count_nonzero(pattern.mask) < LEAST_TAXELS:
        return Unused.TOO_SMALL
    if pattern.hidden[pattern.mask].mean() > MOST_HIDDEN:
        return Unused.HIDDEN
    return Unused.SHAPELESS if is_shapeless(pattern) else None


def _centre(frame: TouchFrame) -> np.ndarray:
    centre: np.ndarray = np.argwhere(frame.mask).mean(0)
    return centre


def _strength(frame: TouchFrame) -> float:
    return float(np.nansum(frame.values[frame.mask]))
