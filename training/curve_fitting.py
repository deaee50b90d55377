"""Fit the curves of the paper's planes to synthetic patterns in general position."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from tactile_node.helmholtz.features import Group, compute_features
from tactile_node.shape.volf import (
    ANSWERS,
    SMALLEST,
    TAXEL_BANDS,
    Plane,
    VolfClassifier,
    axes,
    band_of,
    by_curves,
    plane_feature,
)
from tactile_node.simulator.world import CLASSES
from training.ground_truth.seeds import random_pattern

AREAS = (13.0, 300.0)  #: Range of areas of the training patterns, log-uniform [taxels].
COLUMNS = (('value', 'N'), ('dif', 'alpha9'), ('min', 'P05'), ('min', 'info_norm5'),
           ('dif', 'P05'), ('dif', 'info_norm5'))
PASSES = 6
KNOTS = 9
LEVELS = 41   #: Number of heights tried at each knot, first over the whole plane, then near the best heights found.

#: Penalty for a kink in a curve. A kink must gain this many patterns per unit of the second difference of its heights.
STIFF = 5.0
#: The two interpretations of the third plane's horizontal axis in the paper.
READINGS = {'caption': ('min', 'P05'), 'text': ('dif', 'P05')}


class Samples(NamedTuple):
    """Features and labels of n patterns."""

    columns: Mapping[tuple[str, str], np.ndarray]
    labels: np.ndarray  #: index into volf.ANSWERS

    def of(self, name: tuple[str, str]) -> np.ndarray:
        return self.columns[name]


def draw_samples(rng: np.random.Generator, patterns: int, areas: tuple[float, float] = AREAS,
                 progress: Callable[[int], None] = lambda done: None) -> Samples:
    """Draw patterns of all classes in turn, with log-uniform areas. A pattern below SMALLEST taxels is drawn again."""
    rows: list[list[float]] = []
    labels: list[int] = []
    names = [shape.value for shape in ANSWERS]
    while len(rows) < patterns:
        shape = CLASSES[len(rows) % len(CLASSES)]
        mask = random_pattern(rng, shape, float(np.exp(rng.uniform(*np.log(areas)))))
        if mask.sum() < SMALLEST:
            continue
        features = compute_features(mask, Group.CLASSIFIER)
        rows.append([plane_feature(features, column) for column in COLUMNS])
        labels.append(names.index(shape))
        progress(len(rows))
    return Samples(dict(zip(COLUMNS, np.array(rows, float).T)), np.array(labels))


def fit_planes(samples: Samples, third: tuple[str, str]) -> dict[str, Plane]:
    """Fit the four curves so that they recognise as many patterns as possible, as in the published method.

    The function optimises one curve at a time while the other curves are fixed, from the last curve to the first. The
    function stops when the number of recognised patterns no longer rises. A pattern counts for a curve if it passes the
    earlier curves and if this curve decides whether the answer is right or wrong.
    """
    names = [COLUMNS[:2], COLUMNS[:2], COLUMNS[2:4], (third, COLUMNS[5])]
    features = [(samples.of(horizontal), samples.of(vertical)) for horizontal, vertical in names]
    curves: dict[int, Plane] = {}
    # At the start, each pattern passes exactly the curves that precede the curve of its own class.
    heights = np.where(samples.labels == np.arange(len(names))[:, None], 1.0, -1.0)
    most = -1
    for _ in range(PASSES):
        for index in reversed(range(len(names))):
            knots, levels = fit_curve(*axes(*features[index]), _gain(heights, samples.labels, index))
            curves[index] = Plane(*names[index], tuple(knots.tolist()), tuple(levels.tolist()))
            heights[index] = curves[index].height(*features[index])
        right = int((by_curves(heights) == samples.labels).sum())
        if right <= most:
            break
        most, best = right, dict(curves)
    return {ANSWERS[index].value: best[index] for index in range(len(names))}


def _gain(heights: np.ndarray, labels: np.ndarray, index: int) -> np.ndarray:
    """Return, for each pattern, the gain if it lies above curve ``index``: 1, -1, or 0 if the side makes no
    difference."""
    gets_there = ~(heights[:index] > 0).any(0)
    otherwise = index + 1 + by_curves(heights[index + 1:])
    gain: np.ndarray = gets_there * ((labels == index).astype(float) - (labels == otherwise))
    return gain


def answers(planes: Mapping[str, Plane], samples: Samples) -> np.ndarray:
    """Return the answer of the curves for each pattern, as an index into volf.ANSWERS, (n,)."""
    return by_curves(np.array([plane.height(samples.of(plane.horizontal), samples.of(plane.vertical))
                               for plane in planes.values()]))


def count_shares(answer: np.ndarray, samples: Samples) -> np.ndarray:
    """Return the share of each true class, by TAXEL_BANDS and by the answer of the curves, (bands, 5, 5)."""
    # a small count for every class, because no class is ever completely impossible
    counts = np.full((len(TAXEL_BANDS), len(ANSWERS), len(ANSWERS)), 0.1)
    counts += np.eye(len(ANSWERS))  # an answer that never occurred in training counts as its own class
    np.add.at(counts, (band_of(samples.of(COLUMNS[0])), answer, samples.labels), 1)
    shares: np.ndarray = counts / counts.sum(2, keepdims=True)
    return shares


def recognised(classifier: VolfClassifier, samples: Samples) -> dict[str, np.ndarray]:
    """Return the correctly recognised patterns, bool (n,): those recognised by the curves alone, and those by the
    probabilities."""
    answer = answers(classifier.planes, samples)
    probable = classifier.shares[band_of(samples.of(COLUMNS[0])), answer].argmax(1)
    return {'by_curves': answer == samples.labels, 'most_probable': probable == samples.labels}


def fit_classifier(samples: Samples, third: tuple[str, str]) -> VolfClassifier:
    """Fit the curves, and count how often each answer of the curves is right."""
    planes = fit_planes(samples, third)
    return VolfClassifier(planes, count_shares(answers(planes, samples), samples))


def fit_curve(u: np.ndarray, v: np.ndarray, gain: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the knots and heights of the chain of lines for which the points above it have the greatest total
    ``gain``.

    ``gain``, (n,), is the number of additional patterns recognised if a point lies above the curve instead of below it.
    The gain is negative for a loss. The heights at the knots are found by dynamic programming, so no other chain on the
    grid is better. A second, finer grid is then placed around the result on the first grid.
    """
    some = gain != 0
    u, v, gain = u[some], v[some], gain[some]
    knots = np.linspace(u.min(), u.max(), KNOTS)
    low, high = np.quantile(v, (0.001, 0.999))
    grid = np.tile(np.linspace(low, high, LEVELS), (KNOTS, 1))
    coarse = _best_chain(u, v, gain, knots=knots, grid=grid)
    step = grid[0, 1] - grid[0, 0]
    finer = coarse[:, None] + np.linspace(-1.5, 1.5, LEVELS) * step
    return knots, _best_chain(u, v, gain, knots=knots, grid=finer)


def _best_chain(u: np.ndarray, v: np.ndarray, gain: np.ndarray, knots: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Return the best heights at ``knots``, one from each row of ``grid``, (knots, levels)."""
    segment = np.clip(np.searchsorted(knots, u, 'right') - 1, 0, len(knots) - 2)
    won = []
    for k, (left, right) in enumerate(zip(knots, knots[1:])):
        inside = segment == k
        share = (u[inside] - left) / (right - left)
        won.append(_gain_of_lines(share, v[inside], gain[inside], left=grid[k], right=grid[k + 1]))
    best, choices = won[0], []  # best[a, b] is the best sum of all chains that end with the heights a, b
    for k in range(1, len(won)):
        kink = np.abs(grid[k - 1][:, None, None] - 2 * grid[k][:, None] + grid[k + 1])
        total = best[:, :, None] - STIFF * kink
        choices.append(total.argmax(0))
        best = total.max(0) + won[k]
    path = [int(place) for place in np.unravel_index(best.argmax(), best.shape)]
    for choice in reversed(choices):
        path.insert(0, int(choice[path[0], path[1]]))
    return grid[np.arange(len(knots)), path]


def _gain_of_lines(share: np.ndarray, v: np.ndarray, gain: np.ndarray, left: np.ndarray,
                   right: np.ndarray) -> np.ndarray:
    """Return the sum of gains above each line from a height ``left`` to a height ``right``, (left, right)."""
    rising = right * share[:, None]
    return np.array([gain @ (v[:, None] > rising + (height * (1 - share))[:, None]) for height in left])
