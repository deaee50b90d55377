"""Find the law from the gripper's reading to its opening, from gauge blocks."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tactile_node.commissioning.measurement import NOT_MEASURED, Estimate
from tactile_node.grasp.opening import LinearGap

BLOCK_TOLERANCE = 2e-5   #: Standard deviation of the width of a gauge block [m].
LINEAR_SIGMAS = 3.0      #: Largest misfit of a linear law [standard deviations].
LEAST_MISFIT = 5e-5      #: A misfit below this length does not contradict a linear law [m].
LEAST_BLOCKS = 3         #: Two blocks cannot show the arc of a knuckle.


@dataclass(frozen=True)
class KnuckleGap:
    """Converts the angle of a knuckle joint to an opening: gap = offset + sine * sin(angle) + cosine * cos(angle)."""

    offset: float  #: [m]
    sine: float    #: [m]
    cosine: float  #: [m]

    def gap(self, reading: float) -> float:
        return self.offset + self.sine * math.sin(reading) + self.cosine * math.cos(reading)


@dataclass(frozen=True)
class OpeningLaw:
    """A law with its uncertainty, valid between the narrowest and the widest block."""

    law: LinearGap | KnuckleGap
    covariance: np.ndarray   #: covariance of the coefficients: offset and scale, or offset, sine and cosine
    readings: tuple[float, float]  #: smallest and largest reading at a block

    def opening(self, reading: float) -> Estimate:
        """Return the opening at a reading [m]."""
        terms = _terms(reading, isinstance(self.law, KnuckleGap))
        return Estimate(self.law.gap(reading), math.sqrt(float(terms @ self.covariance @ terms)))

    def slope(self, reading: float) -> Estimate:
        """Return the change of the opening per unit of the reading [m/reading]."""
        if isinstance(self.law, LinearGap):
            return Estimate(self.law.scale, math.sqrt(float(self.covariance[1, 1])))
        terms = np.array((0.0, math.cos(reading), -math.sin(reading)))
        value = float(terms @ (self.law.offset, self.law.sine, self.law.cosine))
        return Estimate(value, math.sqrt(float(terms @ self.covariance @ terms)))

    @property
    def middle(self) -> float:
        """Reading in the middle of the range."""
        return sum(self.readings) / 2


def find_law(onsets: Sequence[Estimate], widths: Sequence[float], *, is_angle: bool) -> OpeningLaw | None:
    """Return the law through the readings at which the pads touch blocks of known width.

    Parameters
    ----------
    onsets : sequence of Estimate
        Reading at which the pads touch each block.
    widths : sequence of float
        Width of each block [m].
    is_angle : bool
        True if the reading is an angle [rad]. The law is then that of a knuckle, because the error of a linear law
        between three blocks is too small to show. `chord_error` gives this error.

    Returns
    -------
    OpeningLaw or None
        None for fewer than LEAST_BLOCKS blocks, or if the law misses the blocks, so that a block has another width.
    """
    if len(widths) < LEAST_BLOCKS or not all(onset.is_known for onset in onsets):
        return None
    readings = np.array([onset.value for onset in onsets])
    rough = abs(float(np.polyfit(readings, widths, 1)[0]))
    deviations = np.hypot(BLOCK_TOLERANCE, rough * np.array([onset.deviation for onset in onsets]))
    terms = np.array([_terms(reading, is_angle) for reading in readings])
    weighted = terms / deviations[:, np.newaxis]
    coefficients, *_ = np.linalg.lstsq(weighted, widths / deviations, rcond=None)
    if (np.abs(terms @ coefficients - widths) > np.maximum(LEAST_MISFIT, LINEAR_SIGMAS * deviations)).any():
        return None
    law = KnuckleGap(*map(float, coefficients)) if is_angle else LinearGap(*map(float, coefficients))
    return OpeningLaw(law, np.linalg.inv(weighted.T @ weighted), (float(readings.min()), float(readings.max())))


def chord_error(found: OpeningLaw) -> tuple[LinearGap, float]:
    """Return the linear law with the same opening at both ends of the range, and its largest error between them [m]."""
    if isinstance(found.law, LinearGap):
        return found.law, 0.0
    low, high = found.readings
    scale = (found.law.gap(high) - found.law.gap(low)) / (high - low)
    chord = LinearGap(found.law.gap(low) - scale * low, scale)
    between = np.linspace(low, high, 101)
    return chord, max(abs(chord.gap(reading) - found.law.gap(reading)) for reading in between)


def speed_at(found: OpeningLaw, reading: float, speed: Estimate) -> Estimate:
    """Return the speed of the pads [m/s] for a speed of the reading."""
    slope = found.slope(reading)
    if not speed.is_known:
        return NOT_MEASURED
    value = abs(slope.value * speed.value)
    return Estimate(value, math.hypot(slope.deviation * speed.value, slope.value * speed.deviation))


def _terms(reading: float, is_knuckle: bool) -> np.ndarray:
    """Return the factors of the coefficients of a law."""
    return np.array((1.0, math.sin(reading), math.cos(reading)) if is_knuckle else (1.0, reading))
