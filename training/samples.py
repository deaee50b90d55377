"""Draw labelled contacts under nominal and field conditions, as training data for the recogniser and the anchors."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tactile_node.contact.pattern import ContactPattern
from tactile_node.shape.invariants import describe_all
from tactile_node.shape.patch import HIGHEST_LEVEL, joined, make_patch
from tactile_node.shape.recogniser import OUTPUTS
from training.field import Conditions, field_frame
from training.outliers import TRAINED
from training.segmentation import ON_OFF, pattern_at, pattern_beside

LABELS = tuple(shape.value for shape in OUTPUTS)  #: Names of the labels. A label is an index into these names.
UNKNOWN = LABELS.index('unknown')
SMALLEST = 5           #: Smallest number of taxels in a pattern that becomes a sample.
ABSOLUTE = 0.4         #: Fraction of the pressure frames with an absolute threshold.
LEVEL_STEPS = 255 / HIGHEST_LEVEL  #: Levels are stored as whole multiples of 1 / LEVEL_STEPS.

FAULTS: dict[str, Callable[[np.random.Generator], dict]] = {
    'dead': lambda rng: {'dead': rng.uniform(0.03, 0.15)},
    'stuck': lambda rng: {'stuck': rng.uniform(0.0, 0.05)},
    'silent lines': lambda rng: {'silent_lines': int(rng.integers(1, 4))},
    'blur': lambda rng: {'blur': rng.uniform(0.5, 1.2)},
    'noise': lambda rng: {'noise': rng.uniform(0.01, 0.08)},
    'tilt': lambda rng: {'tilt': rng.uniform(0.2, 0.8)},
    'threshold': lambda rng: {'threshold': rng.uniform(0.2, 0.85)},
    'cut': lambda rng: {'cut': rng.uniform(0.05, 1 / 3)},
    'second': lambda rng: {'second': rng.uniform(0.15, 0.6), 'gap': rng.uniform(3.5, 9)},
    'hollow': lambda rng: {'wall': rng.uniform(0.2, 0.7)},
    'hollow and torn': lambda rng: {'wall': rng.uniform(0.1, 0.5), 'stuck': rng.uniform(0.0, 0.03),
                                    'silent_lines': int(rng.integers(0, 3)), 'silent_places': int(rng.integers(1, 4)),
                                    'rounding': rng.uniform(0, 0.3)},
    'poor lines': lambda rng: {'poor_lines': rng.uniform(0.02, 0.25)},
    'hollow with poor lines': lambda rng: {'wall': rng.uniform(0.1, 0.5), 'poor_lines': rng.uniform(0.02, 0.25),
                                           'stuck': rng.uniform(0.0, 0.02), 'rounding': rng.uniform(0, 0.3)},
    'rounded': lambda rng: {'rounding': rng.uniform(0.1, 0.6)},
}


class Samples(NamedTuple):
    """K labelled patches.

    The arrays ``levels`` and ``unseen`` are uint8 (K, SIDE, SIDE), and ``geometry`` is float32 (K, COUNT).
    """

    levels: np.ndarray
    unseen: np.ndarray
    geometry: np.ndarray
    labels: np.ndarray

    def inputs(self, chosen) -> tuple[np.ndarray, np.ndarray]:
        """Return the images, float32 (K, 2, SIDE, SIDE), and the geometry of the ``chosen`` samples."""
        images = np.stack((self.levels[chosen] / np.float32(LEVEL_STEPS),
                           self.unseen[chosen] / np.float32(255)), 1)
        return images.astype(np.float32), self.geometry[chosen]


def joined_samples(several) -> Samples:
    return Samples(*map(np.concatenate, zip(*several)))


def random_area(rng: np.random.Generator, hollow: bool) -> float:
    """Draw an area [taxels].

    Small contacts are more frequent, because they are harder to recognise. Hollow contacts are large.
    """
    low, high = (7, 60) if rng.random() < 0.8 and not hollow else (40, 300)
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def random_conditions(rng: np.random.Generator, on_off: bool, faulty: float = 0.45) -> Conditions:
    """Draw nominal conditions. In a fraction ``faulty`` of the draws, add one or two faults."""
    known = {'on_off': True} if on_off else {
        'pressure': rng.uniform(0.35, 0.8), 'tilt': rng.uniform(0, 0.4), 'blur': rng.uniform(0.3, 0.7),
        'noise': rng.uniform(0, 0.02), 'dead': rng.uniform(0, 0.06), 'threshold': rng.uniform(0.35, 0.7)}
    if rng.random() < faulty:
        for name in rng.choice(list(FAULTS), rng.integers(1, 3), replace=False):
            known |= FAULTS[name](rng)
    # after further losses, the first contact might no longer be the larger one, or might be split
    if known.get('second'):
        known |= {'silent_lines': 0, 'poor_lines': 0.0}
    return Conditions(**known)


def pattern_of(rng: np.random.Generator, frame: np.ndarray, conditions: Conditions) -> ContactPattern:
    """Return the contact pattern of a frame, using an absolute threshold or a threshold relative to the contact."""
    if conditions.on_off or rng.random() < ABSOLUTE:
        return pattern_at(frame, ON_OFF if conditions.on_off else conditions.threshold * conditions.pressure)
    return pattern_beside(rng, frame, conditions.on_off)


def random_sample(rng: np.random.Generator, on_off: bool, faulty: float = 0.45,
                  outliers: float = 0.18) -> tuple[ContactPattern, np.ndarray, int]:
    """Draw a pattern, and return it with the mask of its contact and its label."""
    while True:
        label = UNKNOWN if rng.random() < outliers else int(rng.integers(UNKNOWN))
        kind = TRAINED[rng.integers(len(TRAINED))] if label == UNKNOWN else LABELS[label]
        conditions = random_conditions(rng, on_off, faulty)
        area = random_area(rng, conditions.wall > 0 and rng.random() < 0.7)
        if label == UNKNOWN:
            area = max(area, 12.0)
        pattern = pattern_of(rng, field_frame(rng, kind, area, conditions, least_side=12), conditions)
        if pattern.mask.sum() < SMALLEST:
            continue
        mask = joined(pattern)
        if conditions.second and mask.sum() > 1.15 * pattern.mask.sum():
            if rng.random() < 0.5:
                return pattern, mask, UNKNOWN  # the two contacts were joined into one
            mask = pattern.mask
        return pattern, mask, label


def draw(rng: np.random.Generator, count: int, on_off: bool, **options) -> Samples:
    """Draw ``count`` samples. The options are those of `random_sample`."""
    return samples_from(random_sample(rng, on_off, **options) for _ in range(count))


def samples_from(contacts) -> Samples:
    """Return the samples for tuples of pattern, mask of the contact, and label."""
    patches, labels = [], []
    for pattern, mask, label in contacts:
        patches.append(make_patch(pattern.values, mask))
        labels.append(label)
    levels, unseen = (np.array([getattr(patch, name) for patch in patches]) for name in ('level', 'unseen'))
    return packed(levels, unseen, np.array([patch.scale for patch in patches]), np.array(labels))


def packed(levels: np.ndarray, unseen: np.ndarray, scales: np.ndarray, labels: np.ndarray) -> Samples:
    """Return the samples for K patches, (K, SIDE, SIDE) each."""
    # describe_all needs a lot of memory
    at_a_time = [slice(first, first + 256) for first in range(0, len(labels), 256)]
    geometry = [describe_all(levels[part], unseen[part], scales[part]) for part in at_a_time]
    return Samples(np.clip(levels * LEVEL_STEPS + 0.5, 0, 255).astype(np.uint8),
                   (unseen * 255 + 0.5).astype(np.uint8), np.concatenate(geometry), labels)
