"""Fuse the recognitions of successive frames into a result that is more certain and more stable than a single frame.

Each frame adds its log-probabilities, following Bayes' rule, with two limits:

- Frames in quick succession have the same errors. The weight of a frame is therefore the share of ``correlation_time``
  that has passed since the previous frame.
- The object may change. Evidence therefore fades with the time constant ``memory``. In addition, ``floor`` limits the
  evidence from a single frame, and ``lead`` limits the lead of the leading class. The result follows a change after at
  most `FusionSettings.frames_to_follow` frames that agree. When a contact begins or ends, the fusion starts again
  immediately.

Hidden taxels stay hidden, no matter how many frames agree. The fusion therefore keeps separate evidence for each
assumption about the hidden taxels (`Recognition.alternatives`), by its name. The two networks of a contact with
pressures are alternatives, too, because all frames come from the same skin. A shape that the taxels do not support is
treated in the same way, because later frames of the contact have no more taxels. The result is the weighted mean over
the alternatives. An alternative that the previous frame did not have begins with the fused evidence.

A frame in which the contact is not seen adds no evidence. Such a frame is reported as not seen, and the evidence of
earlier frames is kept for the next frame.

Fused results have the same classes as the frames: the five shapes and the taught shapes.
"""

from dataclasses import dataclass
from math import exp, log
from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError, InputError
from tactile_node.shape.recognition import Recognition, Shape, ShapeClass, UnknownReason

TOUCHING_CLASSES: tuple[ShapeClass, ...] = tuple(shape for shape in Shape if shape is not Shape.NONE)


@dataclass(frozen=True)
class FusionSettings:
    """Settings that control how fast evidence builds up, fades and is overturned.

    Raises
    ------
    ConfigurationError
        Raised if a value is out of range.
    """

    correlation_time: float = 0.05  #: time after which the errors of two frames are independent [s]
    memory: float = 0.5             #: time constant with which evidence fades [s]
    floor: float = 0.001            #: smallest probability that a frame can give to a class
    lead: float = 8.0               #: largest lead of the leading class [log-odds]
    switch: float = 1.0             #: lead that another class needs before it is reported instead [log-odds]
    max_gap: float = 0.5            #: silence after which the fusion starts again [s]

    def __post_init__(self) -> None:
        values = (self.correlation_time, self.memory, self.floor, self.lead, self.max_gap)
        if not (all(0 < value < float('inf') for value in values) and self.floor < 1 / len(TOUCHING_CLASSES)
                and 0 <= self.switch < min(self.lead, self.memory / self.correlation_time)):
            raise ConfigurationError(
                'fusion settings', expected=f'times > 0, floor below 1/{len(TOUCHING_CLASSES)}, 0 <= switch < lead '
                'and < memory / correlation_time',
                got=str(self), remedy='Omit these settings to use the defaults.')

    def gain(self, period: float) -> float:
        """Return the weight of a frame that follows the previous frame after ``period`` [s]."""
        return min(1.0, period / self.correlation_time)

    def frames_to_follow(self, period: float, odds: float = 10.0) -> int:
        """Return the largest number of frames until a new shape is reported, however long the old shape was held.

        Parameters
        ----------
        period : float
            Time between frames [s].
        odds : float
            Smallest odds, 3 to 100, that each frame gives to the new shape against every other shape.
        """
        ahead, frames = -self.lead, 0
        while ahead < self.switch:
            ahead = ahead * exp(-period / self.memory) + self.gain(period) * log(odds)
            frames += 1
        return frames


class FusedRecognition(NamedTuple):
    """The result of all frames since the contact began."""

    recognition: Recognition
    since: float  #: stamp of the first frame of the unbroken run in which this shape is reported [s]
    held: float   #: time since ``since`` [s]; 0 if the contact is not seen
    frames: int   #: number of frames since ``since``; 0 if the contact is not seen


class RecognitionFusion:
    """Fuses the recognitions of one pad, frame by frame in the order of their stamps."""

    def __init__(self, settings: FusionSettings = FusionSettings()):
        self._settings = settings
        self.reset()

    def reset(self) -> None:
        """Forget all evidence.

        Call this method when you know that the pad touches another object.
        """
        self._stamp: float | None = None
        self._shape: ShapeClass | None = None
        self._since = 0.0
        self._frames = 0
        self._reason = UnknownReason.UNFAMILIAR
        self._is_over = True
        self._start(TOUCHING_CLASSES)

    def update(self, stamp: float, frame: Recognition) -> FusedRecognition:
        """Add the recognition of one frame, and return the fused result.

        If the most probable class of a frame is NONE, the frame ends the contact and is reported immediately. A frame
        with too few taxels for a shape also ends the contact. A frame without evidence is reported as not seen, and
        ``held`` starts again with the next frame.

        The fusion starts again if the stamp goes backwards or jumps by more than ``max_gap``, or if the frame has
        different classes.

        Parameters
        ----------
        stamp : float
            Stamp of the frame [s].
        frame : Recognition
            Recognition of the frame.

        Raises
        ------
        InputError
            Raised if a number is NaN or infinite, because it would stay in the evidence.
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
            self._start(touching)
        self._stamp = stamp
        self._is_over = ends
        if frame.shape is Shape.NONE:
            return self._report(stamp, frame.shape, frame)
        self._add(frame, passed)
        if frame.shape is Shape.UNKNOWN:
            self._reason = frame.reason
        shares = self._shares()
        return self._report(stamp, self._chosen(), Recognition.of(dict(zip(self._touching, shares.tolist()))))

    def _start(self, touching: tuple[ShapeClass, ...]) -> None:
        self._touching = touching
        self._evidence = {'': np.zeros(len(touching))}  # by the name of the alternative
        self._weights = {'': 1.0}

    def _add(self, frame: Recognition, passed: float) -> None:
        fading, gain = exp(-passed / self._settings.memory), self._settings.gain(passed)
        before, together = self._evidence, self._together()
        self._evidence, self._weights = {}, {}
        for name, weight, probabilities in frame.alternatives or (frame.alone,):
            seen = np.array([probabilities.get(shape, 0.0) for shape in self._touching])
            evidence = fading * before.get(name, together) + gain * np.log(np.maximum(seen, self._settings.floor))
            # Every class stays within `lead` of the leading class, so that a change is followed in bounded time.
            self._evidence[name] = np.maximum(evidence - evidence.max(), -self._settings.lead)
            self._weights[name] = weight

    def _together(self) -> np.ndarray:
        """Combine the evidence of all alternatives into one array, with 0 for the leading class."""
        if len(self._evidence) == 1:
            return next(iter(self._evidence.values()))
        evidence = np.log(self._shares())
        return np.maximum(evidence - evidence.max(), -self._settings.lead)

    def _shares(self) -> np.ndarray:
        """Return the probability of each class, as the weighted mean over the alternatives."""
        odds = np.exp(list(self._evidence.values()))
        return np.array(list(self._weights.values())) @ (odds / odds.sum(1, keepdims=True))

    def _chosen(self) -> ShapeClass:
        """Return the leading class, or the class that was reported last if it is close behind."""
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
    for each in frame.alternatives:
        numbers += each.probabilities.values()
    if not np.isfinite(numbers).all():
        raise InputError('frame to fuse', expected='a finite stamp and finite probabilities',
                         got=f'{stamp}, {dict(frame.probabilities)}', remedy='Do not fuse this frame.')
