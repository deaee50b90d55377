"""Classify shapes as in section 7 of the paper, with three planes of two features each.

The features have the names of `tactile features`. ``min`` and ``dif`` are the minimum of a feature over all rotations,
and the difference between its maximum and its minimum.

1. In the plane (N, dif alpha9), two curves separate rectangles, right triangles and the other shapes.
2. In the plane (min P05, min I5), one curve separates isosceles triangles from circles and squares.
3. In the plane (dif P05 or min P05, dif I5), one curve separates squares from circles.

The curves are stored in config/volf_curves.yaml and were fitted by `training.fit_curves`. The paper gives no
probabilities. The probabilities in the file are frequencies among the training patterns. Each frequency is the share of
a true class among the patterns with the same result of the curves and the same band of N.
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
    """One curve in a plane of two features, which separates the classes above the curve from those below.

    Features have the names that `tactile features` prints.
    """

    horizontal: tuple[str, str]  #: kind ('value', 'min', 'max' or 'dif') and name of the feature
    vertical: tuple[str, str]
    knots: tuple[float, ...]   #: u coordinates of the curve's corners, in rising order
    levels: tuple[float, ...]  #: v coordinates of the curve's corners

    def height(self, horizontal: ArrayLike, vertical: ArrayLike) -> np.ndarray:
        """Return the height of points above the curve along v, which is negative below the curve."""
        u, v = axes(horizontal, vertical)
        return v - self._curve(u)

    def curve_at(self, horizontal: np.ndarray) -> np.ndarray:
        """Return the curve in the unit of the vertical feature, for plotting."""
        return np.exp(self._curve(axes(horizontal, 0.0)[0])) - 0.01

    def _curve(self, u: np.ndarray) -> np.ndarray:
        inner = np.interp(u, self.knots, self.levels)
        before, after = (np.diff(self.levels) / np.diff(self.knots))[[0, -1]]
        return (inner + before * np.minimum(u - self.knots[0], 0)
                + after * np.maximum(u - self.knots[-1], 0))


def axes(horizontal: ArrayLike, vertical: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return the logarithmic axes (u, v) of two features."""
    return np.log(1 + np.asarray(horizontal, float)), np.log(0.01 + np.asarray(vertical, float))


SMALLEST = 15  #: A pattern with fewer taxels is UNKNOWN.
PLANES = ('rectangle', 'right_triangle', 'isosceles_triangle', 'square')
TAXEL_BANDS = (15, 20, 25, 35, 50, 75, 100, 150)  #: Bands of N, each given by its smallest number of taxels.

#: The shapes that the planes can report, in the order of decision. The labels of the reproduction and each list of
#: probabilities in the file use the same order.
ANSWERS = (*(Shape(name) for name in PLANES), Shape.CIRCLE)


def plane_feature(features: Features, name: tuple[str, str]) -> float:
    """Return the value of a plane's feature, such as ('value', 'N') or ('dif', 'alpha9')."""
    kind, feature = name
    return features.values[feature] if kind == 'value' else getattr(features.rotated[feature], kind)


class VolfClassifier:
    """Recognises shapes with the planes of the paper. ``classes`` lists all classes that the classifier can report.

    Parameters
    ----------
    planes : mapping of str to Plane
        Curve below each shape of PLANES, in the order of decision.
    shares : np.ndarray
        Probability of each of ANSWERS, by band of N and by result of the curves, (bands, 5, 5).
    """

    classes: tuple[ShapeClass, ...] = tuple(Shape)

    def __init__(self, planes: Mapping[str, Plane], shares: np.ndarray):
        self.planes, self.shares = dict(planes), shares

    @classmethod
    def from_file(cls, path: str | Path) -> 'VolfClassifier':
        """Load the classifier with the curves from a file that `training.fit_curves` has written.

        Raises
        ------
        ConfigurationError
            Raised if the file contains no usable curves.
        """
        top = load_mapping(Path(path), 'curves of the classifier')
        planes = top.take('planes')
        try:
            return cls({name: _plane(planes[name]) for name in PLANES}, _shares(top.take('shares')))
        except KeyError as error:
            raise _unusable(path, f'no key {error}') from None
        except (TypeError, ValueError) as error:
            raise _unusable(path, str(error)) from None

    def recognise_all(self, patterns: Sequence[ContactPattern]) -> list[Recognition]:
        """Return the recognition of each of ``patterns``."""
        return [self.classify(compute_features(pattern.mask, Group.CLASSIFIER)) for pattern in patterns]

    def classify(self, features: Features) -> Recognition:
        """Recognise a pattern from its features.

        An empty pattern is recognised as NONE. A pattern with fewer than SMALLEST taxels, or with an undefined feature
        of a plane, is recognised as UNKNOWN.

        Parameters
        ----------
        features : Features
            Features of the pattern, at least those of Group.CLASSIFIER.
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
    """Return the index into TAXEL_BANDS for a number of taxels."""
    return np.searchsorted(TAXEL_BANDS[1:], count, 'right')


def by_curves(heights: np.ndarray) -> np.ndarray:
    """Return the index in ANSWERS: that of the first curve below the pattern, or the last index if no curve is below.

    ``heights`` has the shape (curves, ...).
    """
    above = np.concatenate((heights > 0, np.ones((1, *heights.shape[1:]), bool)))
    return above.argmax(0)


def _plane(data: Mapping[str, Any]) -> Plane:
    """Return one plane of the file, or raise KeyError, TypeError or ValueError if its data are invalid."""
    horizontal, vertical = (tuple(map(str, data[key])) for key in ('horizontal', 'vertical'))
    knots, levels = (tuple(float(value) for value in data[key]) for key in ('knots', 'levels'))
    if len(horizontal) != 2 or len(vertical) != 2 or not 2 <= len(knots) == len(levels):
        raise ValueError('a plane without two names per axis, or without two or more knots and as many levels')
    if not np.isfinite(knots + levels).all() or not (np.diff(knots) > 0).all():
        raise ValueError('a curve that is not finite or whose knots do not rise')
    return Plane(horizontal, vertical, knots, levels)


def _shares(data: Mapping[str, Any]) -> np.ndarray:
    """Return the probabilities by band and result, or raise KeyError, TypeError or ValueError for invalid data."""
    shares = np.array([data[shape.value] for shape in ANSWERS], float).swapaxes(0, 1)
    if shares.shape != (len(TAXEL_BANDS), len(ANSWERS), len(ANSWERS)) or not (shares >= 0).all() \
            or not ((sums := shares.sum(2)) > 0).all() or not np.isfinite(sums).all():
        raise ValueError(f'shares that are not {len(TAXEL_BANDS)} rows of {len(ANSWERS)} probabilities per answer')
    return shares / sums[..., np.newaxis]


def _unusable(path: str | Path, got: str) -> ConfigurationError:
    return ConfigurationError(f'curves of the classifier, {path}', expected='a file written by training/fit_curves.py',
                              got=got, remedy='Use config/volf_curves.yaml, or fit the curves again.')
