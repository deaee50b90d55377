"""The shapes, and what a recogniser reports for a contact."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, IntEnum
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

#: The recognition methods by name; here, so that a command line knows them at once.
LEARNED, VOLF = 'learned', 'volf'
DEFAULT_METHOD = LEARNED
METHOD_FILES = {LEARNED: 'recogniser.npz', VOLF: 'volf_curves.yaml'}  #: what each reads by default, in config/


class Shape(str, Enum):
    """The classes; the values are the names used in files, on topics and on the command line."""

    CIRCLE = 'circle'
    SQUARE = 'square'
    RECTANGLE = 'rectangle'
    RIGHT_TRIANGLE = 'right_triangle'
    ISOSCELES_TRIANGLE = 'isosceles_triangle'
    NONE = 'none'        #: nothing touches the pad
    UNKNOWN = 'unknown'  #: something does, and its shape cannot be determined


@dataclass(frozen=True)
class TaughtShape:
    """A class that a user has taught (`tactile teach`); it has a name, and no outline that could be fitted."""

    value: str  #: its name, as that of a Shape


ShapeClass: TypeAlias = Shape | TaughtShape


class UnknownReason(IntEnum):
    """Why a shape is UNKNOWN (ContactShape.msg mirrors these numbers)."""

    NOT_KNOWN = 0
    NOT_UNKNOWN = 1  #: the shape is another one
    NOT_SEEN = 2     #: hidden taxels: whether something touches the pad, or the outline of what does
    UNFAMILIAR = 3   #: seen, and its outline is that of none of the shapes known
    TOO_SMALL = 4    #: seen, and of too few taxels
    CUT_BY_EDGE = 5    #: seen, and the pad's edge cuts it
    HOLLOW = 6         #: seen, and it encloses taxels that are not pressed
    SEVERAL_PARTS = 7  #: seen, and it is of several parts
    COVERS_PAD = 8     #: something covers most of the pad, so that its outline is not seen
    UNSTABLE = 9       #: seen, and its name depends on the pressure at which the outline is drawn


#: The shapes that a contact can have, in the package's one order. Files that keep another one name it at their loader.
SHAPES = (Shape.CIRCLE, Shape.SQUARE, Shape.RECTANGLE, Shape.RIGHT_TRIANGLE, Shape.ISOSCELES_TRIANGLE)


class Alternative(NamedTuple):
    """What a contact is when its hidden taxels are read in one way."""

    weight: float  #: weight of this way; all sum to 1
    probabilities: Mapping[ShapeClass, float]


class Recognition(NamedTuple):
    """The most probable shape; ``probabilities`` holds every Shape, then those taught, and sums to 1.

    Where hidden taxels may change the answer, ``alternatives`` holds that for each way in which they may be read. Where
    the taxels do not support the name, one of the alternatives is UNKNOWN. ``probabilities`` are the weighted mean of
    the alternatives. No number of frames makes such an answer sure.
    """

    shape: ShapeClass
    probabilities: Mapping[ShapeClass, float]
    reason: UnknownReason = UnknownReason.NOT_UNKNOWN  #: why ``shape`` is UNKNOWN
    alternatives: tuple[Alternative, ...] = ()
    doubt: UnknownReason = UnknownReason.NOT_UNKNOWN   #: what speaks against a name that is not sure
    joined: bool = False  #: of the largest contact together with pieces close to it, `patch.join_pieces`

    @property
    def confidence(self) -> float:
        """Probability of ``shape``."""
        return self.probabilities[self.shape]

    @property
    def is_evidence(self) -> bool:
        """Whether it says anything of what touches the pad; it does not where that was not seen."""
        return self.reason not in (UnknownReason.NOT_SEEN, UnknownReason.COVERS_PAD) or bool(self.alternatives)

    @classmethod
    def certain(cls, shape: ShapeClass) -> 'Recognition':
        """Make a recognition that gives ``shape`` the probability 1."""
        return cls.of({shape: 1.0})

    @classmethod
    def unknown(cls, reason: UnknownReason) -> 'Recognition':
        """Make a recognition that is certainly UNKNOWN."""
        return cls.of({Shape.UNKNOWN: 1.0}, reason)

    @classmethod
    def of(cls, probabilities: Mapping[ShapeClass, float],
           reason: UnknownReason = UnknownReason.UNFAMILIAR) -> 'Recognition':
        """Make a recognition of these probabilities; classes not named have none.

        ``reason`` counts where UNKNOWN is the most probable.
        """
        every: dict[ShapeClass, float] = {shape: float(probabilities.get(shape, 0.0)) for shape in Shape}
        every.update((shape, float(p)) for shape, p in probabilities.items() if isinstance(shape, TaughtShape))
        return cls._of(max(every, key=every.__getitem__), every, reason)

    @classmethod
    def of_alternatives(cls, weights: Sequence[float], alternatives: Sequence['Recognition']) -> 'Recognition':
        """Make a recognition of one contact, parts of which are hidden, from those of its ``alternatives``.

        An UNKNOWN has their reason where they agree in it, else NOT_SEEN.
        """
        readings = [Alternative(weight * part, probabilities) for weight, each in zip(weights, alternatives)
                    for part, probabilities in each.alternatives or (Alternative(1.0, each.probabilities),)]
        mean = {shape: sum(weight * probabilities.get(shape, 0.0) for weight, probabilities in readings)
                for shape in dict.fromkeys(shape for _, probabilities in readings for shape in probabilities)}
        reasons = {each.reason for each in alternatives}
        reason = reasons.pop() if len(reasons) == 1 else UnknownReason.NOT_SEEN
        return cls.of(mean, reason)._replace(joined=alternatives[0].joined, alternatives=tuple(readings))

    def no_surer_than(self, most: float, doubt: UnknownReason) -> 'Recognition':
        """Return it as a sure answer that is UNKNOWN with a probability of 1 - ``most``, which is less than a half.

        ``doubt``: what speaks against the name.
        """
        unknown = Recognition.certain(Shape.UNKNOWN).over(tuple(self.probabilities))
        return Recognition.of_alternatives((most, 1 - most), (self, unknown))._replace(doubt=doubt)

    def exchanged(self, one: Shape, other: Shape) -> 'Recognition':
        """Return it with the probabilities of two shapes exchanged; it is of the ``other`` where it was of ``one``."""
        probabilities = {**self.probabilities, one: self.probabilities[other], other: self.probabilities[one]}
        return self._replace(shape=other if self.shape is one else self.shape,
                             probabilities=MappingProxyType(probabilities))

    def over(self, classes: Sequence[ShapeClass]) -> 'Recognition':
        """Return it with a probability of each of ``classes``, in their order; 0 where it has none."""
        if len(self.probabilities) == len(classes):
            return self

        def all_of(probabilities: Mapping[ShapeClass, float]) -> Mapping[ShapeClass, float]:
            return MappingProxyType({shape: probabilities.get(shape, 0.0) for shape in classes})
        return self._replace(probabilities=all_of(self.probabilities), alternatives=tuple(
            Alternative(weight, all_of(each)) for weight, each in self.alternatives))

    def reported_as(self, shape: ShapeClass, reason: UnknownReason) -> 'Recognition':
        """Return it with another ``shape`` as the answer; ``reason`` counts where that is UNKNOWN."""
        return self._of(shape, self.probabilities, reason)._replace(alternatives=self.alternatives)

    @classmethod
    def _of(cls, shape: ShapeClass, probabilities: Mapping[ShapeClass, float], reason: UnknownReason) -> 'Recognition':
        return cls(shape, MappingProxyType(dict(probabilities)),
                   reason if shape is Shape.UNKNOWN else UnknownReason.NOT_UNKNOWN)

    def as_json(self) -> dict[str, Any]:
        """Return what one line of `tactile classify` holds; `reason` only of an unknown shape, `doubt` of a name."""
        reason = {'reason': self.reason.name.lower()} if self.shape is Shape.UNKNOWN else {}
        if self.doubt is not UnknownReason.NOT_UNKNOWN:
            reason['doubt'] = self.doubt.name.lower()
        return {'shape': self.shape.value, **reason, 'confidence': self.confidence,
                'probabilities': {shape.value: p for shape, p in self.probabilities.items()}}
