"""Taxel frames -> touches: what a pad reads while one object is held on it, from contact to lift.

Of a touch a few frames at equal steps are used, on purpose, and none is recognised: the nodes answer every frame, but
the many frames of one hold teach no more than a few.
"""

from collections.abc import Iterable, Sequence
from enum import IntEnum
from itertools import repeat
from typing import NamedTuple

import numpy as np

from tactile_node.contact.neighbours import touches_edge
from tactile_node.contact.pattern import ContactPattern
from tactile_node.pose.pipeline import ContactPipeline, FoundContact, Taxels
from tactile_node.shape.patch import join_pieces
from tactile_node.shape.shapeless import is_shapeless

TOUCH_FRAMES = 5   #: frames of a touch that are used
CENTRE_MOVED = 1.0  #: centres so far apart are of two touches [pitches]
MOST_HIDDEN_SHARE = 0.1  #: share of its taxels without a value


class Unused(IntEnum):
    """Why a frame with a contact is of no use."""

    NOT_KNOWN = 0
    SEVERAL_CONTACTS = 1
    AT_EDGE = 2
    TOO_SMALL = 3
    HIDDEN = 4     #: dead, missing or stuck taxels
    SHAPELESS = 5  #: ragged, a line, or from edge to edge: answered UNKNOWN whatever is taught
    SATURATED = 6  #: readings at the end of their range
    NO_CIRCLE = 7  #: recognised as another shape, or as none


class TouchFrame(NamedTuple):
    """One frame of a touch."""

    mask: np.ndarray         #: bool (rows, cols), the contact with the pieces near it
    pattern: ContactPattern  #: the contact as a recogniser takes it, without those pieces
    reading: np.ndarray      #: (rows, cols), the frame as it was fed

    @classmethod
    def of(cls, values: np.ndarray, mask: np.ndarray) -> 'TouchFrame':
        """Return the frame of ``values`` in which ``mask`` alone is pressed."""
        return cls(mask, ContactPattern.of(mask, values), values)

    @property
    def values(self) -> np.ndarray:
        """Values of the taxels, (rows, cols), NaN where there is no valid one."""
        return self.pattern.values

    @property
    def strength(self) -> float:
        """The sum of the contact's values."""
        return float(np.nansum(self.values[self.mask]))

    @property
    def centre(self) -> np.ndarray:
        """The mean place of the contact's taxels: row, column."""
        return np.argwhere(self.mask).mean(0)


class Touch(NamedTuple):
    """One object held on the pad; ``frames``: at equal steps through it, one at least."""

    frames: tuple[TouchFrame, ...]

    @property
    def middle(self) -> TouchFrame:
        return self.frames[len(self.frames) // 2]


class Touches(NamedTuple):
    """``unused`` counts frames by reason."""

    touches: list[Touch]
    unused: dict[Unused, int]

    def __str__(self) -> str:
        counts = ', '.join(f'{count} {reason.name.lower()}' for reason, count in sorted(self.unused.items()))
        return f'{len(self.touches)} touches' + (f'; frames not used: {counts}' if counts else '')


class TouchFinder:
    """Follows the frames of one pad; ``unit`` as in `find_contact`."""

    lightest = 0.5     #: share of the strongest frame of a touch: lighter, the object is still being set down or lifted
    least_taxels = 12  #: fewest taxels of a contact that shows a shape

    def __init__(self, unit: str | None):
        self._pipeline, self._taxels = ContactPipeline(), Taxels(unit=unit)
        self._held: list[TouchFrame] = []
        self.unused: dict[Unused, int] = {}
        self.reason: Unused | None = None  #: why the latest frame was not used

    def feed(self, values: np.ndarray, saturated: np.ndarray | None = None) -> list[Touch]:
        """Take a frame, (rows, cols); return the touches that have ended with it, as a rule none or one.

        A frame in which the pad is not seen ends none: it shows no lift.
        """
        found = self._pipeline.find(values, self._taxels, saturated=saturated)
        self.reason = None
        if not found.pattern.contacts:
            return self.end() if found.visibility.pad_seen else []
        alone = found.pattern
        found = found.of_pattern(join_pieces(alone))
        self.reason = self._why_unusable(found)
        if self.reason is None:
            self._held.append(TouchFrame(found.pattern.mask, alone, values))
        else:
            self.unused[self.reason] = self.unused.get(self.reason, 0) + 1
        return []

    def is_steady(self, frames: int) -> bool:
        """Whether the last ``frames`` show one object at rest."""
        last = self._held[-frames:]
        if len(last) < frames or self.reason is not None:
            return False
        centres, strengths = np.array([each.centre for each in last]), np.array([each.strength for each in last])
        return bool(np.ptp(centres, axis=0).max() < CENTRE_MOVED / 2 and np.ptp(strengths) < 0.15 * strengths.max())

    def end(self) -> list[Touch]:
        """End the touch under way: one, or several where the contact jumps without a lift."""
        held, self._held = self._held, []
        if not held:
            return []
        least = self.lightest * max(frame.strength for frame in held)
        firm = [frame for frame in held if frame.strength >= least]
        centres = np.array([frame.centre for frame in firm])
        jumps = np.flatnonzero(np.hypot(*np.diff(centres, axis=0).T) > CENTRE_MOVED) + 1
        return [self._choose(firm[first:last]) for first, last in zip((0, *jumps), (*jumps, len(firm)))]

    def find(self, frames: Iterable[np.ndarray], saturated: Iterable[np.ndarray | None] = repeat(None)) -> Touches:
        """Return the touches in successive ``frames``, with which of their taxels are saturated."""
        touches = [touch for values, at_end in zip(frames, saturated) for touch in self.feed(values, at_end)]
        return Touches(touches + self.end(), self.unused)

    def _why_unusable(self, found: FoundContact) -> Unused | None:
        pattern = found.pattern
        if pattern.contacts > 1:
            return Unused.SEVERAL_CONTACTS
        if touches_edge(pattern.mask):
            return Unused.AT_EDGE
        return Unused.TOO_SMALL if pattern.sizes[0] < self.least_taxels else self._why_unclear(found)

    def _why_unclear(self, found: FoundContact) -> Unused | None:
        if found.pattern.hidden[found.pattern.mask].mean() > MOST_HIDDEN_SHARE:
            return Unused.HIDDEN
        return Unused.SHAPELESS if is_shapeless(found.pattern) else None

    def _choose(self, frames: list[TouchFrame]) -> Touch:
        return choose_frames(frames, TOUCH_FRAMES)


def choose_frames(frames: Sequence[TouchFrame], most: int) -> Touch:
    """Return up to ``most`` of ``frames``, at equal steps."""
    which = np.unique(np.linspace(0, len(frames) - 1, most).round().astype(int))
    return Touch(tuple(frames[k] for k in which))


class AnyTouchFinder(TouchFinder):
    """Finds every touch that a recogniser answers, however unclear, but leaves out those that the pad's edge cuts."""

    def _why_unusable(self, found: FoundContact) -> Unused | None:
        return Unused.AT_EDGE if touches_edge(found.pattern.mask) else None
