"""All features of a pattern (sections 3 to 6) by the names `tactile features` prints.

N, P05, P09; for k = 5, 9: lambda{k}, info_sum{k}, info_sq{k}, info_norm{k}, x{k}, y{k}, V{k}, alpha{k}
(degrees); the same of the reduced matrices with the suffix _border5, _border9; and of each of them the
minimum, maximum and difference over the 46 rotations.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from tactile_node.errors import InputError
from tactile_node.helmholtz.eigenvalues import Problem, smallest_eigenvalues
from tactile_node.helmholtz.feature_groups import Group as Group
from tactile_node.helmholtz.operators import WEIGHTS, Stencil
from tactile_node.helmholtz.rotation import ANGLES, with_rotated
from tactile_node.helmholtz.taxel_list import TaxelList, Weights, ringed_taxel_list, taxel_list


class Gravity(NamedTuple):
    """The centre of gravity T in both coordinate systems, each of shape (K,).

    NaN where no two active taxels are neighbours by the stencil: there is nothing to weigh.
    """

    x: np.ndarray
    y: np.ndarray
    V: np.ndarray      #: distance from the origin, sqrt(x² + y²)
    alpha: np.ndarray  #: arctan2(x, y) [degrees]


def gravity(taxels: TaxelList, stencil: Stencil) -> Gravity:
    """Return the centre of gravity of each of the K patterns of ``taxels``.

    A pair of neighbours i > j weighs A(i,j) at (i-1)/(N-1), (j-1)/(N-1); summed over i the weights are
    those of the neighbours before each taxel, summed over j those of the neighbours after it.
    """
    weights = WEIGHTS[stencil]
    before = _weigh(taxels.earlier_edge, taxels.earlier_corner, weights)
    after = _weigh(taxels.later_edge, taxels.later_corner, weights)
    with np.errstate(invalid='ignore', divide='ignore'):
        scale = taxels.per_pattern(before) * (taxels.counts - 1)
        x = taxels.per_pattern(before * taxels.number) / scale
        y = taxels.per_pattern(after * taxels.number) / scale
    return Gravity(x, y, np.sqrt(x * x + y * y), np.degrees(np.arctan2(x, y)))


def _weigh(edge: np.ndarray, corner: np.ndarray, weights: Weights) -> np.ndarray:
    weighed: np.ndarray = edge * np.int32(-weights.edge)
    return weighed + corner * np.int32(-weights.corner) if weights.corner else weighed


class Information(NamedTuple):
    """The paper's three measures, each of shape (K,)."""

    sum: np.ndarray   #: Σ s_i, >= 0
    sq: np.ndarray    #: Σ s_i², vertices and edges accented
    norm: np.ndarray  #: Σ s_i² / N, the classifier's I; NaN for an empty pattern


def information(taxels: TaxelList, stencil: Stencil) -> Information:
    """Return the information measures of each of the K patterns of ``taxels``."""
    weights = WEIGHTS[stencil]
    sums = taxels.row_sums(weights)
    squared = taxels.per_pattern(sums * sums) / weights.denominator ** 2
    with np.errstate(invalid='ignore'):
        return Information(taxels.per_pattern(sums) / weights.denominator, squared, squared / taxels.counts)


TOGETHER = 400_000  #: taxels of rotated patterns described at a time: bounds the memory of large contacts


INFORMATION = {Stencil.FIVE: Group.INFORMATION5, Stencil.NINE: Group.INFORMATION9}
GRAVITY = {Stencil.FIVE: Group.GRAVITY5, Stencil.NINE: Group.GRAVITY9}


class Extremes(NamedTuple):
    """A feature over the 46 angles; NaN (angle None) where it is undefined at every angle."""

    min: float
    max: float
    dif: float  #: max - min
    min_angle: int | None  #: [degrees], the first angle at which it is least
    max_angle: int | None  #: [degrees], the first angle at which it is greatest


UNDEFINED = Extremes(min=np.nan, max=np.nan, dif=np.nan, min_angle=None, max_angle=None)


class Features(NamedTuple):
    """Features by name; NaN where one is undefined."""

    values: Mapping[str, float]     #: of the pattern as it is
    rotated: Mapping[str, Extremes]  #: over its rotations; empty unless computed

    def as_json(self) -> dict[str, Any]:
        """Return what one line of `tactile features` holds: null where undefined, counts as whole numbers."""
        rotated = {name: {key: _number(value) for key, value in over._asdict().items()}
                  for name, over in self.rotated.items()}
        return {**{name: _number(value) for name, value in self.values.items()}, 'rotated': rotated}


def compute_features(mask: np.ndarray, groups: Group = Group.ALL) -> Features:
    """Return the features of the active taxels of ``mask``, bool, shape (rows, cols).

    The result does not change, not by a bit, when the pattern is moved by whole taxels.
    Raises InputError where ``mask`` is something else.

    >>> features = compute_features(np.array([[True, False], [True, True]]))
    >>> features.values['P05'], round(features.values['lambda5'], 6)
    (3, 2.585786)
    """
    _check(mask)
    is_rotated = groups & Group.ROTATED and mask.any()
    stack = _of_rotated(mask, groups) if is_rotated else _described(taxel_list(mask[np.newaxis]), groups)
    values = {name: value[0].item() for name, value in stack.items()}
    rotated = _extremes(stack, 1 if is_rotated else 0) if groups & Group.ROTATED else {}
    return Features(MappingProxyType(values), MappingProxyType(rotated))


def _of_rotated(mask: np.ndarray, groups: Group) -> dict[str, np.ndarray]:
    """Features of the pattern and of its rotations, (47,); as many at a time as TOGETHER allows."""
    patterns = with_rotated(mask)
    step = max(1, TOGETHER // int(np.count_nonzero(mask)))
    parts = [_described(ringed_taxel_list(patterns[first:first + step]), groups, extremes_from=0 if first else 1)
             for first in range(0, len(patterns), step)]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def features_at_angles(mask: np.ndarray, groups: Group = Group.ALL) -> dict[str, np.ndarray]:
    """Return every feature at each of ANGLES, shape (46,); ``mask`` must have an active taxel."""
    _check(mask)
    return _described(ringed_taxel_list(with_rotated(mask)[1:]), groups)


def _check(mask: np.ndarray) -> None:
    if not (isinstance(mask, np.ndarray) and mask.dtype == bool and mask.ndim == 2):
        got = f'{mask.dtype}, shape {mask.shape}' if isinstance(mask, np.ndarray) else type(mask).__name__
        raise InputError('pattern', expected='a bool array of shape (rows, cols)', got=got,
                         remedy='Extract the contact pattern first (tactile_node.contact).')


def _described(taxels: TaxelList, groups: Group, extremes_from: int | None = None) -> dict[str, np.ndarray]:
    """Features of each of the K patterns of ``taxels``, as arrays of shape (K,).

    Eigenvalues from pattern ``extremes_from`` on are NaN where they are neither smallest nor greatest.
    """
    found = {'N': taxels.counts}
    for k in Stencil:
        found[f'P0{k}'] = taxels.per_pattern(taxels.row_sums(WEIGHTS[k]) != 0)
    whole, reduced = {'': taxels}, {}
    if groups & Group.BORDER:
        reduced = {f'_border{k}': taxel_list(taxels.border(WEIGHTS[k])) for k in Stencil}
    eigenvalues = {}
    if groups & Group.EIGENVALUES:
        eigenvalues = _eigenvalues(whole | reduced, extremes_from)
    for suffix, chosen in (whole | reduced).items():
        for k in Stencil:
            if groups & Group.EIGENVALUES:
                found[f'lambda{k}{suffix}'] = eigenvalues[suffix, k]
            if groups & INFORMATION[k]:
                found |= _named('info_{}{}{}', information(chosen, k), k, suffix)
            if groups & GRAVITY[k]:
                found |= _named('{}{}{}', gravity(chosen, k), k, suffix)
    return found


def _eigenvalues(lists: dict[str, TaxelList], extremes_from: int | None) -> dict[tuple[str, Stencil], np.ndarray]:
    problems = {(suffix, k): Problem(taxels, k) for suffix, taxels in lists.items() for k in Stencil}
    return dict(zip(problems, smallest_eigenvalues(list(problems.values()), extremes_from)))


def _named(pattern: str, found: Information | Gravity, k: Stencil, suffix: str) -> dict[str, np.ndarray]:
    return {pattern.format(name, int(k), suffix): value for name, value in zip(found._fields, found)}


def _extremes(over: dict[str, np.ndarray], first: int) -> dict[str, Extremes]:
    """Minimum, maximum and difference from pattern ``first`` of the stack on."""
    values = np.array(list(over.values()), float)[:, first:]
    undefined = np.isnan(values)
    lowest = np.where(undefined, np.inf, values).argmin(1)
    highest = np.where(undefined, -np.inf, values).argmax(1)
    row = np.arange(len(values))
    least, most = values[row, lowest], values[row, highest]
    angles = (ANGLES[lowest].tolist(), ANGLES[highest].tolist())
    columns = zip(least.tolist(), most.tolist(), (most - least).tolist(), *angles)
    return {name: Extremes(*column) if column[0] == column[0] else UNDEFINED
            for name, column in zip(over, columns)}


def _number(value: float | None) -> float | int | None:
    """null where undefined, a whole number where it is one."""
    if value is None or np.isnan(value):
        return None
    return int(value) if value == int(value) and abs(value) < 2 ** 53 else float(value)
