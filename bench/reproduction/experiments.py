"""Measure the published method of the paper, and the reasons why we do not reach its published rates."""

from typing import NamedTuple

import numpy as np

from bench.recognition.figures import rate_of
from bench.reproduction.matrices import features_at_angles
from bench.reproduction.methods import (
    SIZES,
    Method,
    NearestNeighbours,
    best_fit,
    confusion,
    lost_in_plane,
    measured,
)
from bench.reproduction.sampling import Drawn, Wanted, draw
from bench.reproduction.worlds import WORLDS, draw_pattern
from tactile_node.helmholtz.features import Group
from tactile_node.learning.teach import Rate
from tactile_node.shape.volf import ANSWERS, VolfClassifier
from training.curve_fitting import AREAS, READINGS, Samples, answers, fit_classifier
from training.ground_truth.seeds import Purpose, generator

VANISHING = 25  #: pattern area at which the loss of taxels by angle is measured [taxels]
FEWER = 3  #: the benchmark has this many times as many patterns as each other world


class Results(NamedTuple):
    """All results shown on the page."""

    methods: list[Method]                   #: all methods, beginning with the published method
    confusions: dict[int, np.ndarray]       #: confusion matrix of the published method, by size
    lost: dict[int, dict[int, float]]       #: share of patterns that each plane loses, by size and plane
    readings: dict[str, Rate]               #: rate on validation patterns, for each interpretation of the third plane
    clouds: Samples                         #: training patterns shown in the figures
    classifier: VolfClassifier              #: published method with the curves from config/
    long_clouds: Samples                    #: training patterns from the world of long rectangles
    long_classifier: VolfClassifier
    #: loss by plane for long rectangles at the largest size, without vanishing angles
    long_lost: dict[int, float]
    vanished: dict[int, float]              #: share of patterns that the vanishing angles change, by size
    remaining: np.ndarray                   #: share of taxels kept at each of ANGLES, for patterns of VANISHING taxels
    neighbours: int


def measure(classifier: VolfClassifier, patterns: int, training: int, seed: int, jobs: int) -> Results:
    """Run all experiments, with ``patterns`` benchmark patterns at each size."""
    drawn = draw(_wanted(patterns, training), seed, jobs)
    every = {size: drawn[f'benchmark {size}'].every for size in SIZES}
    answered = {size: answers(classifier.planes, samples) for size, samples in every.items()}
    methods = [measured('as published, the three planes', classifier, every)]
    fitted = {}
    for world in WORLDS:
        for kept in (False, True):
            if world == 'benchmark' and not kept:
                continue
            method, fitted[world, kept] = _refitted(drawn, world, kept)
            methods.append(method)
    learner = NearestNeighbours(drawn['benchmark training'].every, drawn['benchmark validation'].every)
    methods.append(Method('the same six features, nearest neighbours', {
        size: rate_of(learner.answers(samples) == samples.labels) for size, samples in every.items()}))
    return Results(
        methods=methods,
        confusions={size: confusion(answered[size], every[size].labels) for size in SIZES},
        lost={size: lost_in_plane(answered[size], every[size].labels) for size in SIZES},
        readings=_readings(drawn),
        clouds=drawn['benchmark training'].every,
        classifier=classifier,
        long_clouds=drawn['long rectangles training'].every,
        long_classifier=fitted['long rectangles', False],
        long_lost=_lost(drawn[f'long rectangles {SIZES[-1]}'].kept, fitted['long rectangles', True]),
        vanished={size: _vanished(drawn[f'benchmark {size}']) for size in SIZES},
        remaining=_remaining(seed),
        neighbours=learner.number)


def _wanted(patterns: int, training: int) -> dict[str, Wanted]:
    wanted = {}
    for world in WORLDS:
        fewer = 1 if world == 'benchmark' else FEWER
        wanted[f'{world} training'] = Wanted(world, Purpose.TRAINING, training // fewer, AREAS)
        wanted |= {f'{world} {size}': Wanted(world, Purpose.EVALUATION, patterns // fewer, (size, size))
                   for size in SIZES}
    return wanted | {'benchmark validation': Wanted('benchmark', Purpose.VALIDATION, training // 4, AREAS)}


def _refitted(drawn: dict[str, Drawn], world: str, kept: bool) -> tuple[Method, VolfClassifier]:
    """Fit the curves for ``world``, using the interpretation of the third plane that is better in training."""
    name = f'three planes, {world}' + (', vanishing angles left out' if kept else '')
    print('fitting curves:', name, flush=True)
    best = best_fit(drawn[f'{world} training'][kept])
    return measured(name, best, {size: drawn[f'{world} {size}'][kept] for size in SIZES}), best


def _lost(samples: Samples, classifier: VolfClassifier) -> dict[int, float]:
    return lost_in_plane(answers(classifier.planes, samples), samples.labels)


def _readings(drawn: dict[str, Drawn]) -> dict[str, Rate]:
    training, validation = drawn['benchmark training'].every, drawn['benchmark validation'].every
    return {name: rate_of(answers(fit_classifier(training, third).planes, validation) == validation.labels)
            for name, third in READINGS.items()}


def _vanished(drawn: Drawn) -> float:
    """Return the share of patterns in which some feature changes when the vanishing angles are excluded."""
    changed = [drawn.every.of(name) != drawn.kept.of(name) for name in drawn.every.columns]
    return float(np.mean(np.any(changed, axis=0)))


def _remaining(seed: int) -> np.ndarray:
    """Return the mean share of taxels that a pattern keeps at each of the 46 ANGLES."""
    rng = generator(Purpose.VALIDATION, seed)
    masks = [draw_pattern('benchmark', rng, shape.value, VANISHING) for _ in range(20) for shape in ANSWERS]
    return np.mean([features_at_angles(mask, Group.NONE)['N'] / mask.sum() for mask in masks], axis=0)
