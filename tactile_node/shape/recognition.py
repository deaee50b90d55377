"""The shape classes, and the result of recognising a contact."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, IntEnum
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

# The names of the recognition methods are defined here, so that a command can list the methods without importing them.
LEARNED = 'learned'
VOLF = 'volf'
DEFAULT_METHOD = LEARNED
METHOD_FILES = {LEARNED: 'recogniser.npz', VOLF: 'volf_curves.yaml'}  #: Default file of each method, in config/.


class Shape(str, Enum):
    """The shape classes. The value of a class is its name in files, on topics and on the command line."""

    CIRCLE = 'circle'
    SQUARE = 'square'
    RECTANGLE = 'rectangle'
    RIGHT_TRIANGLE = 'right_triangle'
    ISOSCELES_TRIANGLE = 'isosceles_triangle'
    NONE = 'none'        #: nothing touches the pad
    UNKNOWN = 'unknown'  #: something touches the pad, but its shape cannot be determined


@dataclass(frozen=True)
class TaughtShape:
    """A class that a user has taught with `tactile teach`. A taught class has a name, but no outline to fit."""

    value: str  #: name of the class, like the value of a Shape


ShapeClass: TypeAlias = Shape | TaughtShape


class UnknownReason(IntEnum):
    """Reason why a shape is UNKNOWN. ContactShape.msg uses the same numbers."""

    NOT_KNOWN = 0
    NOT_UNKNOWN = 1    #: the shape is not UNKNOWN
    NOT_SEEN = 2       #: hidden taxels may hide a contact, or the outline of a contact
    UNFAMILIAR = 3     #: the contact is seen, and its outline matches none of the known shapes
    TOO_SMALL = 4      #: the contact is seen and has too few taxels
    CUT_BY_EDGE = 5    #: the contact is seen, and the pad's edge cuts it off
    HOLLOW = 6         #: the contact is seen and encloses unpressed taxels
    SEVERAL_PARTS = 7  #: the contact is seen and consists of several parts
    COVERS_PAD = 8     #: an object covers most of the pad, so that its outline is not seen
    UNSTABLE = 9       #: the contact is seen, but its shape depends on the pressure at which the outline is drawn


#: The shapes that a contact can have, in the order used throughout the package. If a file uses another order, its
#: loader states that order.
SHAPES = (Shape.CIRCLE, Shape.SQUARE, Shape.RECTANGLE, Shape.RIGHT_TRIANGLE, Shape.ISOSCELES_TRIANGLE)


class Recognition(NamedTuple):
    """The most probable shape of a contact and the probability of each class.

    ``probabilities`` holds every Shape, then the taught shapes, and sums to 1.
    """

    shape: ShapeClass
    probabilities: Mapping[ShapeClass, float]
    reason: UnknownReason = UnknownReason.NOT_UNKNOWN  #: the reason if ``shape`` is UNKNOWN
    doubt: UnknownReason = UnknownReason.NOT_UNKNOWN  #: the reason why a named shape is uncertain

    #: True if the pieces close to the largest contact were recognised as part of it (`patch.join_pieces`)
    joined: bool = False

    @property
    def confidence(self) -> float:
        """Probability of ``shape``."""
        return self.probabilities[self.shape]

    @property
    def is_evidence(self) -> bool:
        """True if the result contains evidence about the object, and False if the contact was not seen.

        A contact that is partly hidden counts as seen unless UNKNOWN has the probability 1.
        """
        if self.reason is UnknownReason.NOT_SEEN:
            return self.confidence < 1 - 1e-9
        return self.reason is not UnknownReason.COVERS_PAD

    @classmethod
    def certain(cls, shape: ShapeClass) -> 'Recognition':
        """Return a recognition that gives ``shape`` the probability 1."""
        return cls.of({shape: 1.0})

    @classmethod
    def unknown(cls, reason: UnknownReason) -> 'Recognition':
        """Return a recognition that is certainly UNKNOWN."""
        return cls.of({Shape.UNKNOWN: 1.0}, reason)

    @classmethod
    def of(cls, probabilities: Mapping[ShapeClass, float],
           reason: UnknownReason = UnknownReason.UNFAMILIAR) -> 'Recognition':
        """Return a recognition with ``probabilities``, in which every missing class has the probability 0.

        ``reason`` is used only if UNKNOWN is the most probable class.
        """
        every: dict[ShapeClass, float] = {shape: float(probabilities.get(shape, 0.0)) for shape in Shape}
        every.update((shape, float(p)) for shape, p in probabilities.items() if isinstance(shape, TaughtShape))
        return cls._of(max(every, key=every.__getitem__), MappingProxyType(every), reason)

    @classmethod
    def mean_of(cls, weights: Sequence[float], readings: Sequence['Recognition']) -> 'Recognition':
        """Return the weighted mean of the recognitions of a contact, one for each reading of its hidden taxels.

        If the result is UNKNOWN, its reason is the reason common to all readings, or NOT_SEEN if the readings give
        different reasons.

        Parameters
        ----------
        weights : sequence of float
            Weight of each reading; the weights sum to 1.
        readings : sequence of Recognition
            Recognition of each reading.
        """
        mean = {shape: sum(weight * each.probabilities.get(shape, 0.0) for weight, each in zip(weights, readings))
                for shape in dict.fromkeys(shape for each in readings for shape in each.probabilities)}
        reasons = {each.reason for each in readings}
        reason = reasons.pop() if len(reasons) == 1 else UnknownReason.NOT_SEEN
        return cls.of(mean, reason)._replace(joined=readings[0].joined)

    def no_surer_than(self, most: float, doubt: UnknownReason) -> 'Recognition':
        """Return a copy in which the shape has at most the probability ``most``.

        Parameters
        ----------
        most : float
            Factor for all probabilities, above 0.5. UNKNOWN gets the rest.
        doubt : UnknownReason
            Reason why the shape is uncertain.
        """
        limited = {shape: most * p for shape, p in self.probabilities.items()}
        limited[Shape.UNKNOWN] = limited.get(Shape.UNKNOWN, 0.0) + 1 - most
        return self.of(limited)._replace(joined=self.joined, doubt=doubt)

    def exchanged(self, one: Shape, other: Shape) -> 'Recognition':
        """Return a copy in which two shapes swap their probabilities.

        If ``one`` is the reported shape, ``other`` is reported instead.
        """
        probabilities = {**self.probabilities, one: self.probabilities[other], other: self.probabilities[one]}
        return self._replace(shape=other if self.shape is one else self.shape,
                             probabilities=MappingProxyType(probabilities))

    def over(self, classes: Sequence[ShapeClass]) -> 'Recognition':
        """Return a copy with a probability for each of ``classes``, in order, and 0 for each missing class."""
        if len(self.probabilities) == len(classes):
            return self
        return self._replace(probabilities=MappingProxyType({shape: self.probabilities.get(shape, 0.0)
                                                             for shape in classes}))

    def reported_as(self, shape: ShapeClass, reason: UnknownReason) -> 'Recognition':
        """Return a copy that reports another ``shape``.

        ``reason`` is used only if ``shape`` is UNKNOWN.
        """
        return self._of(shape, self.probabilities, reason)

    @classmethod
    def _of(cls, shape: ShapeClass, probabilities: Mapping[ShapeClass, float], reason: UnknownReason) -> 'Recognition':
        return cls(shape, probabilities, reason if shape is Shape.UNKNOWN else UnknownReason.NOT_UNKNOWN)

    def as_json(self) -> dict[str, Any]:
        """Return one line of `tactile classify` as a dictionary.

        ``reason`` is present only for an unknown shape, and ``doubt`` only for an uncertain shape.
        """
        reason = {'reason': self.reason.name.lower()} if self.shape is Shape.UNKNOWN else {}
        if self.doubt is not UnknownReason.NOT_UNKNOWN:
            reason['doubt'] = self.doubt.name.lower()
        return {'shape': self.shape.value, **reason, 'confidence': self.confidence,
                'probabilities': {shape.value: p for shape, p in self.probabilities.items()}}
