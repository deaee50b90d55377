"""Section 7: the paper's classifier, three planes of two features each.

1. (N, dif alpha9): two curves, rectangle | right triangle | the rest;
2. (min P05, min I5): isosceles triangle | circle and square;
3. (dif P05 or min P05, dif I5): square | circle.

The curves are data (config/volf_curves.yaml), fitted by `training.fit_curves`. The paper gives no probabilities:
ours are how often each class was the truth among the training patterns with the same answer of the curves,
in the same band of N.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tactile_node.contact.pattern import ContactPattern
from tactile_node.errors import ConfigurationError
from tactile_node.helmholtz.features import Features, Group, compute_features
from tactile_node.shape.recognition import Recognition, Shape, ShapeClass, UnknownReason
from tactile_node.yaml_section import load_mapping


@dataclass(frozen=True)
class Plane:
    """One curve and the classes above and below it; features by name as in `tactile features`."""

    horizontal: tuple[str, str]      #: kind ('value', 'min', 'max' or 'dif') and feature name
    vertical: tuple[str, str]
    knots: tuple[float, ...]         #: u of the curve's corners, rising
    levels: tuple[float, ...]        #: v of the curve's corners

    def height(self, horizontal: ArrayLike, vertical: ArrayLike) -> np.ndarray:
        """Return how far points lie above the curve, along v; the sign is the side."""
        u, v = axes(horizontal, vertical)
        return v - self._curve(u)

    def curve_at(self, horizontal: np.ndarray) -> np.ndarray:
        """Return the curve itself, in the vertical feature's own unit, for drawing it."""
        return np.exp(self._curve(axes(horizontal, 0.0)[0])) - 0.01

    def _curve(self, u: np.ndarray) -> np.ndarray:
        inner = np.interp(u, self.knots, self.levels)
        before, after = (np.diff(self.levels) / np.diff(self.knots))[[0, -1]]
        return (inner + before * np.minimum(u - self.knots[0], 0)
                + after * np.maximum(u - self.knots[-1], 0))


def axes(horizontal: ArrayLike, vertical: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return the doubly logarithmic axes (u, v)."""
    return np.log(1 + np.asarray(horizontal, float)), np.log(0.01 + np.asarray(vertical, float))


SMALLEST = 15  #: a pattern of fewer taxels is UNKNOWN
PLANES = ('rectangle', 'right_triangle', 'isosceles_triangle', 'square')
TAXEL_BANDS = (15, 20, 25, 35, 50, 75, 100, 150)  #: bands of N, by their least taxel
#: what the planes answer, in their order of decision: that of the labels of the reproduction, and of each list of
#: probabilities in the file
ANSWERS = (*(Shape(name) for name in PLANES), Shape.CIRCLE)


def plane_feature(features: Features, name: tuple[str, str]) -> float:
    """Return a plane's feature: ('value', 'N') or ('dif', 'alpha9') and the like."""
    kind, feature = name
    return features.values[feature] if kind == 'value' else getattr(features.rotated[feature], kind)


class VolfClassifier:
    """Recognises shapes by ``planes``: the curve below each shape of PLANES, in this order of decision.

    ``classes``: all that it can answer. ``shares``, shape (bands, 5, 5): by band of N and the curves' answer, the
    probability of each of ANSWERS.
    """

    classes: tuple[ShapeClass, ...] = tuple(Shape)

    def __init__(self, planes: Mapping[str, Plane], shares: np.ndarray):
        self.planes, self.shares = dict(planes), shares

    @classmethod
    def from_file(cls, path: str | Path) -> 'VolfClassifier':
        """Read the curves that `training.fit_curves` wrote; ConfigurationError where they are not."""
        top = load_mapping(Path(path), 'curves of the classifier')
        planes = top.take('planes')
        try:
            return cls({name: _plane(planes[name]) for name in PLANES}, _shares(top.take('shares')))
        except KeyError as error:
            raise _unusable(path, f'no key {error}') from None
        except (TypeError, ValueError) as error:
            raise _unusable(path, str(error)) from None

    def recognise_all(self, patterns: Sequence[ContactPattern]) -> list[Recognition]:
        """Recognise each of ``patterns``."""
        return [self.classify(compute_features(pattern.mask, Group.CLASSIFIER)) for pattern in patterns]

    def classify(self, features: Features) -> Recognition:
        """Return the most probable shape; NONE for an empty pattern, UNKNOWN below SMALLEST taxels.

        ``features`` need those of Group.CLASSIFIER. UNKNOWN also where a plane's feature is undefined.
        """
        count = features.values['N']
        if count == 0:
            return Recognition.certain(Shape.NONE)
        if count < SMALLEST:
            return Recognition.unknown(UnknownReason.TOO_SMALL)
        heights = np.array([plane.height(plane_feature(features, plane.horizontal),
                                         plane_feature(features, plane.vertical)) for plane in self.planes.values()])
        if np.isnan(heights).any():
            return Recognition.unknown(UnknownReason.UNFAMILIAR)
        shares = self.shares[band_of(count), by_curves(heights)]
        return Recognition.of(dict(zip(ANSWERS, shares.tolist())))


def band_of(count: ArrayLike) -> np.ndarray | np.intp:
    """Index into TAXEL_BANDS of a number of taxels."""
    return np.searchsorted(TAXEL_BANDS[1:], count, 'right')


def by_curves(heights: np.ndarray) -> np.ndarray:
    """Index into the shapes that remain: the first curve a pattern lies above; ``heights``: (curves, ...)."""
    above = np.concatenate((heights > 0, np.ones((1, *heights.shape[1:]), bool)))
    return above.argmax(0)


def _plane(data: Mapping[str, Any]) -> Plane:
    """One plane of the file; KeyError, TypeError, ValueError where it is not one."""
    horizontal, vertical = (tuple(map(str, data[key])) for key in ('horizontal', 'vertical'))
    knots, levels = (tuple(float(value) for value in data[key]) for key in ('knots', 'levels'))
    if len(horizontal) != 2 or len(vertical) != 2 or not 2 <= len(knots) == len(levels):
        raise ValueError('a plane without two names an axis and as many levels as knots, at least two')
    if not np.isfinite(knots + levels).all() or not (np.diff(knots) > 0).all():
        raise ValueError('a curve that is not finite, or whose knots do not rise')
    return Plane(horizontal, vertical, knots, levels)


def _shares(data: Mapping[str, Any]) -> np.ndarray:
    """Probabilities by band and answer; KeyError, TypeError, ValueError where they are none."""
    shares = np.array([data[shape.value] for shape in ANSWERS], float).swapaxes(0, 1)
    if shares.shape != (len(TAXEL_BANDS), len(ANSWERS), len(ANSWERS)) or not (shares >= 0).all() \
            or not ((sums := shares.sum(2)) > 0).all() or not np.isfinite(sums).all():
        raise ValueError(f'shares that are not {len(TAXEL_BANDS)} rows of {len(ANSWERS)} probabilities an answer')
    return shares / sums[..., np.newaxis]


def _unusable(path: str | Path, got: str) -> ConfigurationError:
    return ConfigurationError(f'curves of the classifier, {path}', expected='a file written by training/fit_curves.py',
                              got=got, remedy='Use config/volf_curves.yaml, or one that it has written for you.')
