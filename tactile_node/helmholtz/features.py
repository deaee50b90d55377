"""Compute all features of a pattern (sections 3 to 6 of the paper), under the names that `tactile features` prints.

- The basic features are N, P05 and P09.

- For k = 5 and k = 9, the features are lambda{k}, info_sum{k}, info_sq{k}, info_norm{k}, x{k}, y{k}, V{k} and alpha{k}
  (degrees).

- The features of the reduced matrices have the suffix _border5 or _border9.

- The minimum, maximum and difference of each feature are taken over the 46 rotations.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from tactile_node.errors import InputError
from tactile_node.helmholtz.eigenvalues import smallest_eigenvalues
from tactile_node.helmholtz.feature_groups import Group as Group
from tactile_node.helmholtz.rotation import ANGLES, with_rotated
from tactile_node.helmholtz.taxel_list import WEIGHTS, Stencil, TaxelList, Weights, ringed_taxel_list, taxel_list


def gravity(taxels: TaxelList, stencil: Stencil) -> dict[str, np.ndarray]:
    """Return the centre of gravity T of each pattern in both coordinate systems.

    Parameters
    ----------
    taxels : TaxelList
        K patterns.
    stencil : Stencil
        Stencil that determines which taxels are neighbours.

    Returns
    -------
    dict of str to np.ndarray, each (K,): x and y; V, the distance from the origin; alpha, arctan2(x, y) [degrees]. The
    values are NaN for a pattern without neighbouring taxels, because it has no pair of neighbours.

    Notes
    -----
    A pair of neighbours i > j has the weight A(i,j) at the point ((i-1)/(N-1), (j-1)/(N-1)). The sum over j contains
    the weights of the neighbours before taxel i. The sum over i contains the weights of the neighbours after taxel j.
    """
    weights = WEIGHTS[stencil]
    before = _weigh(taxels.earlier_edge, taxels.earlier_corner, weights)
    after = _weigh(taxels.later_edge, taxels.later_corner, weights)
    with np.errstate(invalid='ignore', divide='ignore'):
        scale = taxels.per_pattern(before) * (taxels.counts - 1)
        x = taxels.per_pattern(before * taxels.number) / scale
        y = taxels.per_pattern(after * taxels.number) / scale
    return {'x': x, 'y': y, 'V': np.sqrt(x * x + y * y), 'alpha': np.degrees(np.arctan2(x, y))}


def _weigh(edge: np.ndarray, corner: np.ndarray, weights: Weights) -> np.ndarray:
    weighed: np.ndarray = edge * np.int32(-weights.edge)
    return weighed + corner * np.int32(-weights.corner) if weights.corner else weighed


def information(taxels: TaxelList, stencil: Stencil) -> dict[str, np.ndarray]:
    """Return the three information measures of the paper for each pattern.

    Parameters
    ----------
    taxels : TaxelList
        K patterns.
    stencil : Stencil
        Stencil that determines which taxels are neighbours.

    Returns
    -------
    dict of str to np.ndarray
        (K,) each: info_sum, Σ s_i >= 0; info_sq, Σ s_i², which emphasises vertices and edges; info_norm, Σ s_i² / N,
        the I of the classifier, NaN for an empty pattern.
    """
    weights = WEIGHTS[stencil]
    sums = taxels.row_sums(weights)
    squared = taxels.per_pattern(sums * sums) / weights.denominator ** 2
    with np.errstate(invalid='ignore'):
        return {'info_sum': taxels.per_pattern(sums) / weights.denominator, 'info_sq': squared,
                'info_norm': squared / taxels.counts}


#: Number of taxels of rotated patterns that are processed together. The number limits the memory needed for large
#: contacts.
CHUNK_TAXELS = 400_000
#: Largest number of taxels for which eigenvalues are computed. No pad on a CAN bus has more taxels.
MOST_TAXELS = 8_000
INFORMATION = {Stencil.FIVE: Group.INFORMATION5, Stencil.NINE: Group.INFORMATION9}
GRAVITY = {Stencil.FIVE: Group.GRAVITY5, Stencil.NINE: Group.GRAVITY9}


class Extremes(NamedTuple):
    """Extremes of a feature over the 46 angles.

    The extremes are NaN, with the angle None, if the feature is undefined at every angle.
    """

    min: float
    max: float
    dif: float             #: max - min
    min_angle: int | None  #: first angle at which the minimum occurs [degrees]
    max_angle: int | None  #: first angle at which the maximum occurs [degrees]


UNDEFINED = Extremes(min=np.nan, max=np.nan, dif=np.nan, min_angle=None, max_angle=None)


class Features(NamedTuple):
    """Features by name. A feature is NaN if it is undefined.

    For a pattern with more than MOST_TAXELS taxels, the eigenvalues are not computed and are NaN.
    """

    values: Mapping[str, float]      #: features of the unrotated pattern
    rotated: Mapping[str, Extremes]  #: extremes over the rotations; empty if they were not computed

    def as_json(self) -> dict[str, Any]:
        """Return one line of the output of `tactile features` as a dictionary.

        An undefined value is null, and counts are whole numbers.
        """
        rotated = {name: {key: _number(value) for key, value in over._asdict().items()}
                  for name, over in self.rotated.items()}
        return {**{name: _number(value) for name, value in self.values.items()}, 'rotated': rotated}


def compute_features(mask: np.ndarray, groups: Group = Group.ALL) -> Features:
    """Return the features of a pattern.

    The result is bit-identical when the pattern is shifted by whole taxels.

    Parameters
    ----------
    mask : np.ndarray
        Active taxels, bool (rows, cols).
    groups : Group
        Features to compute.

    Raises
    ------
    InputError
        Raised if ``mask`` is not a bool array with two dimensions.

    Examples
    --------
    >>> features = compute_features(np.array([[True, False], [True, True]]))
    >>> features.values['P05'], round(features.values['lambda5'], 6)
    (3, 2.585786)
    """
    if not (isinstance(mask, np.ndarray) and mask.dtype == bool and mask.ndim == 2):
        got = f'{mask.dtype}, shape {mask.shape}' if isinstance(mask, np.ndarray) else type(mask).__name__
        raise InputError('pattern', expected='a bool array of shape (rows, cols)', got=got,
                         remedy='Extract the contact pattern first (tactile_node.contact).')
    is_rotated = groups & Group.ROTATED and mask.any()
    is_solved = int(np.count_nonzero(mask)) <= MOST_TAXELS
    stack = (_describe_rotated(mask, groups, is_solved) if is_rotated
             else describe(taxel_list(mask[np.newaxis]), groups, is_solved))
    values = {name: value[0].item() for name, value in stack.items()}
    rotated = _extremes(stack, 1 if is_rotated else 0) if groups & Group.ROTATED else {}
    return Features(MappingProxyType(values), MappingProxyType(rotated))


def _describe_rotated(mask: np.ndarray, groups: Group, is_solved: bool) -> dict[str, np.ndarray]:
    """Return the features of the pattern and of its rotations, (47,), computed in chunks of at most CHUNK_TAXELS."""
    patterns = with_rotated(mask)
    step = max(1, CHUNK_TAXELS // int(np.count_nonzero(mask)))
    parts = [describe(ringed_taxel_list(patterns[first:first + step]), groups, is_solved, extremes_from=1)
             for first in range(0, len(patterns), step)]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def describe(taxels: TaxelList, groups: Group, is_solved: bool,
             extremes_from: int | None = None) -> dict[str, np.ndarray]:
    """Return the features of each pattern, by name.

    Parameters
    ----------
    taxels : TaxelList
        K patterns.
    groups : Group
        Features to compute.
    is_solved : bool
        False to skip the eigenvalues, which are then NaN.
    extremes_from : int or None
        Index from which only the patterns with the smallest and the greatest eigenvalue are wanted; the eigenvalues of
        the others are NaN.

    Returns
    -------
    dict of str to np.ndarray
        (K,) each.
    """
    found = {'N': taxels.counts}
    for k in Stencil:
        found[f'P0{k}'] = taxels.per_pattern(taxels.row_sums(WEIGHTS[k]) != 0)
    lists = {'': taxels}
    if groups & Group.BORDER:
        lists |= {f'_border{k}': taxel_list(taxels.border(WEIGHTS[k])) for k in Stencil}
    problems = {(suffix, k): (chosen, k) for suffix, chosen in lists.items() for k in Stencil}
    eigenvalues = [np.full(len(taxels.counts), np.nan)] * len(problems)
    if groups & Group.EIGENVALUES and is_solved:
        eigenvalues = smallest_eigenvalues(list(problems.values()), extremes_from)
    for (suffix, k), smallest in zip(problems, eigenvalues):
        named = {'lambda': smallest} if groups & Group.EIGENVALUES else {}
        if groups & INFORMATION[k]:
            named |= information(lists[suffix], k)
        if groups & GRAVITY[k]:
            named |= gravity(lists[suffix], k)
        found |= {f'{name}{k}{suffix}': value for name, value in named.items()}
    return found


def _extremes(over: dict[str, np.ndarray], first: int) -> dict[str, Extremes]:
    """Return the minimum, maximum and difference of each feature over the patterns from index ``first`` onwards."""
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
    """Return a value for JSON: None if it is undefined, an int if it is a whole number, and otherwise a float."""
    if value is None or np.isnan(value):
        return None
    return int(value) if value == int(value) and abs(value) < 2 ** 53 else float(value)
