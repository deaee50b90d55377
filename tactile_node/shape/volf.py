"""Section 7: the paper's classifier, three planes of two features each.

1. (N, dif alpha9): two curves, rectangle | right triangle | the rest;
2. (min P05, min I5): isosceles triangle | circle and square;
3. (dif P05 or min P05, dif I5): square | circle.

The curves are data (config/volf_curves.yaml), fitted by `tactile fit`.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import yaml
from scipy.special import expit

from tactile_node.errors import ConfigurationError
from tactile_node.helmholtz.features import Features, Group
from tactile_node.shape.plane import Plane
from tactile_node.shape.recognition import Recognition, Shape

GROUPS = Group.CLASSIFIER  #: the features the classifier reads
SMALLEST = 15  #: a pattern of fewer taxels is UNKNOWN
PLANES = ('rectangle', 'right_triangle', 'isosceles_triangle', 'square')
SHAPES = (Shape.RECTANGLE, Shape.RIGHT_TRIANGLE, Shape.ISOSCELES_TRIANGLE, Shape.SQUARE, Shape.CIRCLE)


def plane_feature(features: Features, name: tuple[str, str]) -> float:
    """Return a plane's feature: ('value', 'N') or ('dif', 'alpha9') and the like."""
    kind, feature = name
    return features.values[feature] if kind == 'value' else getattr(features.turned[feature], kind)


class VolfClassifier:
    """Recognises shapes by ``planes``: the curve below each shape of PLANES, in this order of decision."""

    def __init__(self, planes: Mapping[str, Plane]):
        self.planes = dict(planes)

    @classmethod
    def from_file(cls, path: str | Path) -> 'VolfClassifier':
        """Read the curves that `tactile fit` wrote; ConfigurationError where they are not."""
        try:
            data = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
            return cls({name: _plane(data['planes'][name]) for name in PLANES})
        except OSError as error:
            raise _unusable(path, error.strerror or str(error)) from None
        except (yaml.YAMLError, UnicodeDecodeError) as error:
            raise _unusable(path, ' '.join(str(error).split())) from None
        except KeyError as error:
            raise _unusable(path, f'no key {error}') from None
        except (TypeError, ValueError) as error:
            raise _unusable(path, str(error)) from None

    def recognise(self, features: Features) -> Recognition:
        """Return the most probable shape; NONE for an empty pattern, UNKNOWN below SMALLEST taxels.

        ``features`` need the groups of GROUPS. UNKNOWN also where a plane's feature is undefined.
        """
        count = features.values['N']
        if count == 0:
            return Recognition.certain(Shape.NONE)
        if count < SMALLEST:
            return Recognition.certain(Shape.UNKNOWN)
        points = [[plane_feature(features, axis) for axis in (plane.horizontal, plane.vertical)]
                  for plane in self.planes.values()]
        logits = np.array([plane.height(*point) for plane, point in zip(self.planes.values(), points)])
        if np.isnan(logits).any():
            return Recognition.certain(Shape.UNKNOWN)
        return Recognition.of(dict(zip(SHAPES, down_the_tree(logits))))


def down_the_tree(logits: np.ndarray) -> np.ndarray:
    """Probabilities of SHAPES, shape (5, ...), from the planes' logits, shape (4, ...).

    Each plane passes on to the next what its curve leaves below.
    """
    one = np.ones((1, *logits.shape[1:]))
    reached = np.cumprod(np.concatenate((one, expit(-logits))), axis=0)
    return reached * np.concatenate((expit(logits), one))


def by_curves(logits: np.ndarray) -> np.ndarray:
    """Index into SHAPES by the curves alone, as published: the first curve the pattern lies above."""
    above = np.concatenate((logits > 0, np.ones((1, *logits.shape[1:]), bool)))
    return above.argmax(0)


def _plane(data: Mapping) -> Plane:
    """One plane of the file; KeyError, TypeError, ValueError where it is not one."""
    names = [tuple(map(str, data[key])) for key in ('horizontal', 'vertical')]
    numbers = [tuple(float(value) for value in data[key]) for key in ('curve', 'steepness', 'fitted')]
    sizes = [len(values) for values in (*names, *numbers[1:])]
    if sizes != [2, 2, 2, 2] or not numbers[0] or not np.isfinite(np.concatenate(numbers)).all():
        raise ValueError('a plane without two names an axis, a curve, two finite numbers each for the rest')
    return Plane(*names, *numbers)


def _unusable(path: str | Path, got: str) -> ConfigurationError:
    return ConfigurationError(f'curves of the classifier, {path}', expected='a file written by `tactile fit`',
                              got=got, remedy='Use config/volf_curves.yaml, or run `tactile fit` again.')
