"""The shapes, and what a recogniser reports for a contact."""

from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType
from typing import Any, NamedTuple


class Shape(str, Enum):
    """The classes; the values are the names used in files, on topics and on the command line."""

    CIRCLE = 'circle'
    SQUARE = 'square'
    RECTANGLE = 'rectangle'
    RIGHT_TRIANGLE = 'right_triangle'
    ISOSCELES_TRIANGLE = 'isosceles_triangle'
    NONE = 'none'        #: nothing touches the pad
    UNKNOWN = 'unknown'  #: something does, and its shape cannot be determined


#: The shapes that a contact can have, in the package's one order. Files that keep another one name it at their loader.
SHAPES = (Shape.CIRCLE, Shape.SQUARE, Shape.RECTANGLE, Shape.RIGHT_TRIANGLE, Shape.ISOSCELES_TRIANGLE)


class Recognition(NamedTuple):
    """The most probable shape; ``probabilities`` holds all seven and sums to 1."""

    shape: Shape
    probabilities: Mapping[Shape, float]

    @property
    def confidence(self) -> float:
        """Probability of ``shape``."""
        return self.probabilities[self.shape]

    @classmethod
    def certain(cls, shape: Shape) -> 'Recognition':
        """Make a recognition that gives ``shape`` the probability 1."""
        return cls.of({shape: 1.0})

    @classmethod
    def of(cls, probabilities: Mapping[Shape, float]) -> 'Recognition':
        """Make a recognition of these probabilities; classes not named have none."""
        every = {shape: float(probabilities.get(shape, 0.0)) for shape in Shape}
        return cls(max(every, key=every.__getitem__), MappingProxyType(every))

    def as_json(self) -> dict[str, Any]:
        """Return what one line of `tactile classify` holds."""
        return {'shape': self.shape.value, 'confidence': self.confidence,
                'probabilities': {shape.value: p for shape, p in self.probabilities.items()}}
