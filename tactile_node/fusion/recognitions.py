"""Recognitions of successive frames as one: more certain than any of them, and slow to change.

Each frame adds its log-probabilities, as Bayes' rule has it, with two cautions. Frames a millisecond apart
err together: a frame counts only for the share of ``correlation_time`` that has passed since the one before.
And the object may change: evidence fades with ``memory``, no frame counts for more than ``floor`` allows, and no
class leads by more than ``lead``. So a change is followed after at most
`FusionSettings.frames_to_follow` frames that agree; a contact that begins or ends starts again at once.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, log
from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError, InputError
from tactile_node.shape.recognition import Recognition, Shape

TOUCHING = tuple(shape for shape in Shape if shape is not Shape.NONE)


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
        if not (all(0 < value < float('inf') for value in values) and self.floor < 1 / len(TOUCHING)
                and 0 <= self.switch < min(self.lead, self.memory / self.correlation_time)):
            raise ConfigurationError(
                'fusion settings', expected=f'times > 0, floor below 1/{len(TOUCHING)}, 0 <= switch < lead '
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
    held: float   #: time since then [s]
    frames: int   #: frames reported so


class RecognitionFusion:
    """Fuses the recognitions of one pad's frames, in the order of their stamps."""

    def __init__(self, settings: FusionSettings = FusionSettings()):
        self._settings = settings
        self.reset()

    def reset(self) -> None:
        """Forget everything, as when another object is known to be touched."""
        self._stamp: float | None = None
        self._shape: Shape | None = None
        self._since = 0.0
        self._frames = 0
        self._evidence = np.zeros(len(TOUCHING))

    def update(self, stamp: float, probabilities: Mapping[Shape, float]) -> FusedRecognition:
        """Take the frame of ``stamp`` [s] and return the fused result.

        A frame whose likeliest class is NONE ends the contact: it is reported at once. A stamp that goes
        back or comes after ``max_gap`` starts again. Raises InputError for NaN or infinite numbers, which would
        stay in the evidence.
        """
        if not np.isfinite((stamp, *probabilities.values())).all():
            raise InputError('frame to fuse', expected='a finite stamp and finite probabilities',
                             got=f'{stamp}, {dict(probabilities)}', remedy='Leave this frame out.')
        frame = Recognition.of(probabilities)
        passed = float('inf') if self._stamp is None else stamp - self._stamp
        if not 0 <= passed <= self._settings.max_gap or Shape.NONE in (frame.shape, self._shape):
            self.reset()
            passed = float('inf')
        self._stamp = stamp
        if frame.shape is Shape.NONE:
            return self._report(stamp, frame.shape, frame)
        self._add(frame, passed)
        return self._report(stamp, self._chosen(), self._belief())

    def _add(self, frame: Recognition, passed: float) -> None:
        seen = np.array([frame.probabilities[shape] for shape in TOUCHING])
        fading = exp(-passed / self._settings.memory)
        evidence = self._evidence * fading
        evidence += self._settings.gain(passed) * np.log(np.maximum(seen, self._settings.floor))
        # Every class stays within `lead` of the one ahead, so that a change is followed in bounded time.
        self._evidence = np.maximum(evidence - evidence.max(), -self._settings.lead)

    def _chosen(self) -> Shape:
        """The class ahead, unless the one reported so far is close behind."""
        ahead = TOUCHING[int(self._evidence.argmax())]
        if self._shape in (None, Shape.NONE, ahead):
            return ahead
        behind = -self._evidence[TOUCHING.index(self._shape)]
        return ahead if behind >= self._settings.switch else self._shape

    def _belief(self) -> Recognition:
        weights = np.exp(self._evidence)
        return Recognition.of(dict(zip(TOUCHING, (weights / weights.sum()).tolist())))

    def _report(self, stamp: float, shape: Shape, belief: Recognition) -> FusedRecognition:
        if shape is not self._shape:
            self._shape = shape
            self._since = stamp
            self._frames = 0
        self._frames += 1
        return FusedRecognition(belief._replace(shape=shape), self._since, stamp - self._since, self._frames)
