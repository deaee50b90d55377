"""Find touches in taxel frames.

A touch consists of the frames of a pad from the first contact with an object until the object is lifted.

Only a few evenly spaced frames of a touch are kept, because more frames of the same touch add no information. The
recognition of shapes is not part of this module.
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
from tactile_node.shape.shapeless import is_cut, is_shapeless

CENTRE_MOVED = 1.0       #: If the centre moves by more than this in one frame, another touch begins [pitches].
MOST_HIDDEN_SHARE = 0.1  #: Largest share of the contact's taxels that may lack a value.


class Unused(IntEnum):
    """Reason why a frame with a contact is not used."""

    NOT_KNOWN = 0
    SEVERAL_CONTACTS = 1
    AT_EDGE = 2    #: an edge of the pad may cut the contact
    TOO_SMALL = 3
    HIDDEN = 4     #: too many taxels of the contact are dead, missing or stuck
    SHAPELESS = 5  #: the contact is ragged, is a line, or reaches across the pad, so that its shape is always UNKNOWN
    SATURATED = 6  #: readings are at the end of their range
    NO_CIRCLE = 7  #: the contact is recognised as another shape or as none


class TouchFrame(NamedTuple):
    """One frame of a touch."""

    mask: np.ndarray         #: bool (rows, cols), the contact together with the pieces near it
    pattern: ContactPattern  #: the contact without the pieces near it, as the input of a recogniser
    reading: np.ndarray      #: (rows, cols), the unchanged frame

    @classmethod
    def of(cls, values: np.ndarray, mask: np.ndarray) -> 'TouchFrame':
        """Return a frame of ``values`` in which only the taxels of ``mask`` are pressed."""
        return cls(mask, ContactPattern.of(mask, values), values)

    @property
    def values(self) -> np.ndarray:
        """Values of the taxels, (rows, cols), with NaN for a taxel without a valid value."""
        return self.pattern.values

    @property
    def strength(self) -> float:
        """Sum of the contact's values."""
        return float(np.nansum(self.values[self.mask]))

    @property
    def centre(self) -> np.ndarray:
        """Mean row and column of the contact's taxels."""
        return np.argwhere(self.mask).mean(0)


class Touch(NamedTuple):
    """One touch of an object on the pad."""

    frames: tuple[TouchFrame, ...]  #: one or more frames, evenly spaced through the touch

    @property
    def middle(self) -> TouchFrame:
        """Frame in the middle of the touch."""
        return self.frames[len(self.frames) // 2]


class Touches(NamedTuple):
    """The touches in a sequence of frames."""

    touches: list[Touch]
    unused: dict[Unused, int]  #: number of unused frames, by reason

    def __str__(self) -> str:
        counts = ', '.join(f'{count} {reason.name.lower()}' for reason, count in sorted(self.unused.items()))
        return f'{len(self.touches)} touches' + (f'; frames not used: {counts}' if counts else '')


class TouchFinder:
    """Finds touches in the successive frames of one pad.

    Parameters
    ----------
    unit : str or None
        Unit of the values, as in `find_contact`.

    Attributes
    ----------
    unused : dict[Unused, int]
        Number of unused frames, by reason.
    reason : Unused or None
        Reason why the latest frame was not used, or None if the frame was used or had no contact.
    """

    #: Smallest strength of a used frame, as a share of the strongest frame of the touch. In weaker frames, the object
    #: is still being set down or lifted.
    lightest = 0.5
    least_taxels = 12  #: Smallest number of taxels with which a contact shows a shape.
    most_frames = 5    #: Largest number of frames kept from a touch.

    def __init__(self, unit: str | None):
        self._pipeline, self._taxels = ContactPipeline(), Taxels(unit=unit)
        self._held: list[TouchFrame] = []
        self.unused: dict[Unused, int] = {}
        self.reason: Unused | None = None

    def feed(self, values: np.ndarray, saturated: np.ndarray | None = None) -> list[Touch]:
        """Process a frame, and return the touches that end with this frame, usually none or one.

        A frame in which the pad is not seen does not end a touch, because it does not show that the object was lifted.

        Parameters
        ----------
        values : np.ndarray
            Taxel values, (rows, cols).
        saturated : np.ndarray or None
            Saturated taxels, bool (rows, cols), or None if no taxel is saturated.
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
        """Return True if the last ``frames`` frames show one object at rest."""
        last = self._held[-frames:]
        if len(last) < frames or self.reason is not None:
            return False
        centres, strengths = np.array([each.centre for each in last]), np.array([each.strength for each in last])
        return bool(np.ptp(centres, axis=0).max() < CENTRE_MOVED / 2 and np.ptp(strengths) < 0.15 * strengths.max())

    def end(self) -> list[Touch]:
        """End the current touch and return it, as several touches if the contact jumped without a lift."""
        held, self._held = self._held, []
        if not held:
            return []
        least = self.lightest * max(frame.strength for frame in held)
        firm = [frame for frame in held if frame.strength >= least]
        centres = np.array([frame.centre for frame in firm])
        jumps = np.flatnonzero(np.hypot(*np.diff(centres, axis=0).T) > CENTRE_MOVED) + 1
        return [self._choose(firm[first:last]) for first, last in zip((0, *jumps), (*jumps, len(firm)))]

    def find(self, frames: Iterable[np.ndarray], saturated: Iterable[np.ndarray | None] = repeat(None)) -> Touches:
        """Return the touches in a whole sequence of frames.

        Parameters
        ----------
        frames : Iterable[np.ndarray]
            Taxel values of each frame, (rows, cols).
        saturated : Iterable[np.ndarray or None]
            Saturated taxels of each frame, bool (rows, cols), or None if no taxel is saturated.
        """
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

    def _choose(self, frames: Sequence[TouchFrame]) -> Touch:
        """Return a touch with some of the frames, evenly spaced."""
        which = np.unique(np.linspace(0, len(frames) - 1, self.most_frames).round().astype(int))
        return Touch(tuple(frames[k] for k in which))


class AnyTouchFinder(TouchFinder):
    """Finds all touches that no edge of the pad cuts, including unclear ones."""

    def _why_unusable(self, found: FoundContact) -> Unused | None:
        return Unused.AT_EDGE if is_cut(found.pattern.mask) else None
