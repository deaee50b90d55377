"""Fuse the recognitions of successive frames into a result that is more stable than a single frame.

The fused probability of a class is the weighted mean over the frames. The weight of a frame falls with its age. The
mean evens out the noise of single frames, but no number of frames makes a result surer than the surest frame. All
frames of a contact come from the same skin, the same outline and the same hidden taxels, so most of their errors are
the same. A product over the frames, following Bayes' rule for independent errors, was sure of twice as many contacts
with none of the five shapes (docs/pose.md).

The object may change. The result follows a change after at most `FusionSettings.frames_to_follow` frames that agree.
When a contact begins or ends, the fusion starts again immediately.

A frame in which the contact is not seen adds no evidence. Such a frame is reported as not seen, and the evidence of
earlier frames is kept for the next frame.

Fused results have the same classes as the frames: the five shapes and the taught shapes.
"""

from dataclasses import dataclass
from math import ceil, exp, isfinite, log
from typing import NamedTuple

from tactile_node.errors import ConfigurationError, InputError
from tactile_node.shape.recognition import Recognition, Shape, ShapeClass, UnknownReason

#: Smallest weight of a frame relative to the next frame. On a slow skin, several frames are therefore fused, too.
LEAST_KEPT = 0.7

TOUCHING_CLASSES: tuple[ShapeClass, ...] = tuple(shape for shape in Shape if shape is not Shape.NONE)


@dataclass(frozen=True)
class FusionSettings:
    """Settings that control how fast the weights of earlier frames fall, and how a change of the shape is followed.

    Raises
    ------
    ConfigurationError
        Raised if a value is out of range.
    """

    memory: float = 0.1   #: time constant with which the weight of a frame falls [s]
    switch: float = 1.5   #: factor by which another shape must be more probable before it is reported instead
    max_gap: float = 0.5  #: silence after which the fusion starts again [s]

    def __post_init__(self) -> None:
        if not (all(0 < value < float('inf') for value in (self.memory, self.max_gap)) and 1 <= self.switch < 3):
            raise ConfigurationError('fusion settings', expected='times > 0, 1 <= switch < 3', got=str(self),
                                     remedy='Omit these settings to use the defaults.')

    def kept(self, period: float) -> float:
        """Return the weight of a frame relative to a frame that follows it after ``period`` [s]."""
        return max(exp(-period / self.memory), LEAST_KEPT)

    def frames_to_follow(self, period: float, odds: float = 10.0) -> int:
        """Return the largest number of recognised frames until a new shape is reported.

        Parameters
        ----------
        period : float
            Time between frames [s].
        odds : float
            Smallest odds, 3 to 100, that each frame gives to the new shape against all other classes together.
        """
        # After n frames, the old frames keep the share kept ** n of the weight, and give the old shape at most 1.
        share = (odds - self.switch) / (odds - self.switch + (1 + odds) * self.switch)
        return max(1, ceil(log(share) / log(self.kept(period))))


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

    def update(self, stamp: float, alone: Recognition) -> FusedRecognition:
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
        alone : Recognition
            Recognition of the frame.

        Raises
        ------
        InputError
            Raised if a number is NaN or infinite, because it would stay in the evidence.
        """
        _check(stamp, alone)
        if not alone.is_evidence:
            self._frames = 0
            return FusedRecognition(alone, stamp, held=0.0, frames=0)
        passed = float('inf') if self._stamp is None else stamp - self._stamp
        touching = tuple(shape for shape in alone.probabilities if shape is not Shape.NONE)
        ends = alone.shape is Shape.NONE or alone.reason is UnknownReason.TOO_SMALL
        begins_empty = alone.shape is Shape.NONE and self._shape is not Shape.NONE
        if (ends is not self._is_over or begins_empty or touching != self._touching
                or not 0 <= passed <= self._settings.max_gap):
            self.reset()
            passed = float('inf')
            self._start(touching)
        self._stamp = stamp
        self._is_over = ends
        if alone.shape is Shape.NONE:
            return self._report(stamp, alone.shape, alone)
        self._add(alone, passed)
        if alone.shape is Shape.UNKNOWN:
            self._reason = alone.reason
        total = sum(self._evidence)
        mean = {shape: evidence / total for shape, evidence in zip(self._touching, self._evidence)}
        return self._report(stamp, self._chosen(), Recognition.of(mean))

    def _start(self, touching: tuple[ShapeClass, ...]) -> None:
        self._touching = touching
        self._evidence = [0.0] * len(touching)  # weighted sum of the probabilities

    def _add(self, alone: Recognition, passed: float) -> None:
        kept = self._settings.kept(passed)
        self._evidence = [kept * before + alone.probabilities[shape]
                          for before, shape in zip(self._evidence, self._touching)]

    def _chosen(self) -> ShapeClass:
        """Return the leading class, or the class that was reported last if another shape is close ahead."""
        ahead = self._evidence.index(max(self._evidence))
        leading = self._touching[ahead]
        if self._shape is None or self._shape is Shape.NONE or leading is Shape.UNKNOWN:
            return leading
        reported = self._touching.index(self._shape)
        is_clear = self._evidence[ahead] > self._settings.switch * self._evidence[reported]
        return leading if is_clear else self._shape

    def _report(self, stamp: float, shape: ShapeClass, belief: Recognition) -> FusedRecognition:
        if shape is not self._shape or not self._frames:
            self._shape = shape
            self._since = stamp
            self._frames = 0
        self._frames += 1
        return FusedRecognition(belief.reported_as(shape, self._reason), self._since, stamp - self._since,
                                self._frames)


def _check(stamp: float, alone: Recognition) -> None:
    if not all(map(isfinite, (stamp, *alone.probabilities.values()))):
        raise InputError('frame to fuse', expected='a finite stamp and finite probabilities',
                         got=f'{stamp}, {dict(alone.probabilities)}', remedy='Do not fuse this frame.')
