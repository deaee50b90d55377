"""Frames -> contact patterns by the library's rule, and at thresholds spread about those that it uses."""

import numpy as np

from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.contact.press import PressThresholds

ON_OFF = 0.5
SPREAD = 0.4              #: of the pressure frames, the fraction whose threshold is not the library's
FRACTIONS = (0.35, 0.65)  #: of the contact's own level
SEEN = 0.3                #: of the highest readings: what a first guess of the level is taken from


def pattern_at(frame: np.ndarray, press: float) -> ContactPattern:
    """The pattern at an absolute threshold."""
    return PatternExtractor(PressThresholds(press, 0.8 * press)).extract(frame)


def pattern_beside(rng: np.random.Generator, frame: np.ndarray, on_off: bool) -> ContactPattern:
    """The pattern by the library's rule or, a part of the pressure frames, at a fraction of the contact's own level."""
    if on_off or rng.random() >= SPREAD:
        return as_shipped(frame, on_off)
    return pattern_at(frame, rng.uniform(*FRACTIONS) * own_level(frame))


def as_shipped(frame: np.ndarray, on_off: bool) -> ContactPattern:
    """The pattern by the library's rule."""
    return pattern_at(frame, ON_OFF) if on_off else PatternExtractor().extract(frame)


def own_level(frame: np.ndarray) -> float:
    """What a taxel of the contact reads in the mean, weighted with its reading: the level of a patch."""
    known = np.nan_to_num(frame)
    high = np.sort(known, axis=None)[-max(3, known.size // 200):].mean()
    inside = known[known >= SEEN * high]
    return float(np.square(inside).sum() / inside.sum())
