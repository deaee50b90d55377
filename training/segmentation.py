"""Extract contact patterns from frames by the library's rule, or at thresholds spread around those of the library."""

import numpy as np

from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.contact.press import PressThresholds

ON_OFF = 0.5
SPREAD = 0.4              #: Fraction of the pressure frames whose threshold differs from that of the library.

#: Range of the thresholds that differ from the library's, as a fraction of the contact's level.
FRACTIONS = (0.35, 0.65)
#: Share of the highest readings. Readings of at least this share determine the level of the contact.
SEEN = 0.3


def pattern_at(frame: np.ndarray, press: float) -> ContactPattern:
    """Return the pattern at an absolute threshold."""
    return PatternExtractor(PressThresholds(press, 0.8 * press)).extract(frame)


def pattern_beside(rng: np.random.Generator, frame: np.ndarray, on_off: bool) -> ContactPattern:
    """Return the pattern by the library's rule, or at a fraction of the contact's level.

    The fraction is used for some of the pressure frames.
    """
    if on_off or rng.random() >= SPREAD:
        return as_shipped(frame, on_off)
    return pattern_at(frame, rng.uniform(*FRACTIONS) * own_level(frame))


def as_shipped(frame: np.ndarray, on_off: bool) -> ContactPattern:
    """Return the pattern by the library's rule."""
    return pattern_at(frame, ON_OFF) if on_off else PatternExtractor().extract(frame)


def own_level(frame: np.ndarray) -> float:
    """Return the level of a patch: the mean reading of the contact's taxels, weighted with the readings themselves."""
    known = np.nan_to_num(frame)
    high = np.sort(known, axis=None)[-max(3, known.size // 200):].mean()
    inside = known[known >= SEEN * high]
    return float(np.square(inside).sum() / inside.sum())
