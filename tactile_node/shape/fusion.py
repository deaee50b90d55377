"""Recognitions of successive frames as one: more certain than any of them, and slow to change.

Each frame adds its log-probabilities, as Bayes' rule has it, with two cautions. Frames a millisecond apart
err together: a frame counts only for the share of ``correlation_time`` that has passed since the one before.
And the object may change: evidence fades with ``memory``, no frame counts for more than ``floor`` allows, and no
class leads by more than ``lead``. So a change is followed after at most
`FusionSettings.frames_to_follow` frames that agree; a contact that begins or ends starts again at once.

What is hidden stays hidden: however many frames agree, they do not show it. So each way in which the hidden taxels may
be read (`Recognition.alternatives`) is fused apart, and the result is the mean of these. The same holds of a name that
the taxels do not support, because the next frame has no more taxels. A frame in which nothing is seen is no evidence:
it is reported as not seen, and the evidence of the frames before waits for the next that is.

The classes are those of the frames: the shapes, and those that were taught.
"""

from dataclasses import dataclass
from math import exp, log
from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError, InputError
from tactile_node.shape.recognition import Alternative, Recognition, Shape, ShapeClass, UnknownReason

TOUCHING_CLASSES: tuple[ShapeClass, ...] = tuple(shape for shape in Shape if shape is not Shape.NONE)


@dataclass(frozen=True)
class FusionSettings:
    """How fast evidence counts, fades and is overturned."""

    correlation_time: float = 0.05  #: frames this far apart err independently [s]
    memory: float = 0.5             #: time constant of forgetting [s]
    floor: float = 0.001            #: smallest probability that a frame may give a class
    lead: float = 8.0               #: most that the leading class may be ahead [log of odds]
    switch: float = 1.0             #: how far another class must lead to be reported instead [log of odds]
    max_gap: float = 0.5            #: after a longer silence, start again [s]

    def __post_init__(self) -> None:
        values = (self.correlation_time, self.memory, self.floor, self.lead, self.max_gap)
        if not (all(0 < value < float('inf') for value in values) and self.floor < 1 / len(TOUCHING_CLASSES)
                and 0 <= self.switch < min(self.lead, self.memory / self.correlation_time)):
            raise ConfigurationError(
                'fusion settings', expected=f'times > 0, floor below 1/{len(TOUCHING_CLASSES)}, 0 <= switch < lead '
                'and < memory / correlation_time',
                got=str(self), remedy='Leave them out for the defaults.')

    def gain(self, period: float) -> float:
        """Return what a frame counts, ``period`` [s] after the one before."""
        return min(1.0, period / self.correlation_time)

    def frames_to_follow(self, period: float, odds: float = 10.0) -> int:
        """Return the most frames, ``period`` [s] apart, until a new shape is reported.

        When each gives it at least ``odds`` (3...100) against every other shape, however long another
        was held.
        """
        ahead, frames = -self.lead, 0
        while ahead < self.switch:
            ahead = ahead * exp(-period / self.memory) + self.gain(period) * log(odds)
            frames += 1
        return frames


class FusedRecognition(NamedTuple):
    """The result of all frames since the contact began."""

    recognition: Recognition
    since: float  #: stamp of the first frame reported as this shape without a break [s]
    held: float   #: time since then [s]; 0 in a frame that is not seen
    frames: int   #: frames reported so; 0 in a frame that is not seen


class RecognitionFusion:
    """Fuses the recognitions of one pad's frames, in the order of their stamps."""

    def __init__(self, settings: FusionSettings = FusionSettings()):
        self._settings = settings
        self.reset()

    def reset(self) -> None:
        """Forget everything, as when another object is known to be touched."""
        self._stamp: float | None = None
        self._shape: ShapeClass | None = None
        self._touching = TOUCHING_CLASSES
        self._since = 0.0
        self._frames = 0
        self._reason = UnknownReason.UNFAMILIAR
        self._is_over = True
        self._evidence = np.zeros((1, len(TOUCHING_CLASSES)))  # a row for each alternative
        self._weights = np.ones(1)

    def update(self, stamp: float, frame: Recognition) -> FusedRecognition:
        """Take the recognition of the frame of ``stamp`` [s] and return the fused result.

        A frame whose likeliest class is NONE ends the contact, as does one of too few taxels for a shape: it is
        reported at once. A frame that is no evidence is reported as not seen, and `held` starts again with the next. A
        stamp that goes back or comes after ``max_gap`` starts again, as does a frame of other classes. Raises
        InputError for NaN or infinite numbers, which would stay in the evidence.
        """
        _check(stamp, frame)
        if not frame.is_evidence:
            self._frames = 0
            return FusedRecognition(frame, stamp, held=0.0, frames=0)
        passed = float('inf') if self._stamp is None else stamp - self._stamp
        touching = tuple(shape for shape in frame.probabilities if shape is not Shape.NONE)
        ends = frame.shape is Shape.NONE or frame.reason is UnknownReason.TOO_SMALL
        if (ends is not self._is_over or frame.shape is Shape.NONE or touching != self._touching
                or not 0 <= passed <= self._settings.max_gap):
            self.reset()
            passed = float('inf')
            self._touching = touching
            self._evidence = np.zeros((1, len(touching)))
        self._stamp = stamp
        self._is_over = ends
        if frame.shape is Shape.NONE:
            return self._report(stamp, frame.shape, frame)
        self._add(frame, passed)
        if frame.shape is Shape.UNKNOWN:
            self._reason = frame.reason
        shares = self._shares()
        return self._report(stamp, self._chosen(), Recognition.of(dict(zip(self._touching, shares.tolist()))))

    def _add(self, frame: Recognition, passed: float) -> None:
        alternatives = frame.alternatives or (Alternative(1.0, frame.probabilities),)
        seen = np.array([[probabilities[shape] for shape in self._touching] for _, probabilities in alternatives])
        if len(self._evidence) != len(seen):
            self._evidence = np.tile(self._together(), (len(seen), 1))
        self._weights = np.array([weight for weight, _ in alternatives])
        fading = exp(-passed / self._settings.memory)
        evidence = self._evidence * fading
        evidence += self._settings.gain(passed) * np.log(np.maximum(seen, self._settings.floor))
        # Every class stays within `lead` of the one ahead, so that a change is followed in bounded time.
        self._evidence = np.maximum(evidence - evidence.max(1, keepdims=True), -self._settings.lead)

    def _together(self) -> np.ndarray:
        """The evidence of all alternatives as that of one, 0 for the class ahead."""
        if len(self._evidence) == 1:
            return self._evidence[0]
        evidence = np.log(self._shares())
        return np.maximum(evidence - evidence.max(), -self._settings.lead)

    def _shares(self) -> np.ndarray:
        """The probabilities that the evidence stands for: the weighted mean of the alternatives."""
        weights = np.exp(self._evidence)
        return self._weights @ (weights / weights.sum(1, keepdims=True))

    def _chosen(self) -> ShapeClass:
        """The class ahead, unless the one reported so far is close behind."""
        evidence = self._together()
        ahead = self._touching[int(evidence.argmax())]
        if self._shape is None or self._shape in (Shape.NONE, ahead):
            return ahead
        behind = -evidence[self._touching.index(self._shape)]
        return ahead if behind >= self._settings.switch else self._shape

    def _report(self, stamp: float, shape: ShapeClass, belief: Recognition) -> FusedRecognition:
        if shape is not self._shape or not self._frames:
            self._shape = shape
            self._since = stamp
            self._frames = 0
        self._frames += 1
        return FusedRecognition(belief.reported_as(shape, self._reason), self._since, stamp - self._since,
                                self._frames)


def _check(stamp: float, frame: Recognition) -> None:
    numbers = [stamp, *frame.probabilities.values()]
    for _, probabilities in frame.alternatives:
        numbers += probabilities.values()
    if not np.isfinite(numbers).all():
        raise InputError('frame to fuse', expected='a finite stamp and finite probabilities',
                         got=f'{stamp}, {dict(frame.probabilities)}', remedy='Leave this frame out.')
