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
class OpeningLaw:
    """Opening as a function of the reading, with its uncertainty, valid between the narrowest and the widest block.

    A slide has the opening offset + scale * reading. A knuckle, whose reading is an angle, has the opening offset +
    sine * sin(reading) + cosine * cos(reading).
    """

    coefficients: np.ndarray  #: offset and scale of a slide, (2,), or offset, sine and cosine of a knuckle, (3,)
    covariance: np.ndarray    #: covariance of the coefficients
    readings: tuple[float, float]  #: smallest and largest reading at a block

    @property
    def is_of_knuckle(self) -> bool:
        return len(self.coefficients) == 3

    def opening(self, reading: float) -> Estimate:
        """Return the opening at a reading [m]."""
        return self._sum(_terms(reading, self.is_of_knuckle))

    def slope(self, reading: float) -> Estimate:
        """Return the change of the opening per unit of the reading [m/reading]."""
        return self._sum(np.array((0.0, math.cos(reading), -math.sin(reading)) if self.is_of_knuckle else (0.0, 1.0)))

    def speed(self, reading: float, speed: Estimate) -> Estimate:
        """Return the speed of the pads [m/s] at a reading, for a speed of the reading."""
        slope = self.slope(reading)
        if not speed.is_known:
            return NOT_MEASURED
        return Estimate(abs(slope.value * speed.value),
                        math.hypot(slope.deviation * speed.value, slope.value * speed.deviation))

    def _sum(self, factors: np.ndarray) -> Estimate:
        """Return the sum of the coefficients with these factors."""
        return Estimate(float(factors @ self.coefficients), math.sqrt(float(factors @ self.covariance @ factors)))

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
    covariance = np.linalg.inv(weighted.T @ weighted)
    return OpeningLaw(coefficients, covariance, (float(readings.min()), float(readings.max())))


def chord_error(law: OpeningLaw) -> tuple[LinearGap, float]:
    """Return the linear law with the same opening at both ends of the range, and its largest error between them [m]."""
    low, high = law.readings
    narrow, wide = law.opening(low).value, law.opening(high).value
    scale = (wide - narrow) / (high - low)
    chord = LinearGap(narrow - scale * low, scale)
    between = np.linspace(low, high, 101)
    return chord, max(abs(chord.gap(reading) - law.opening(reading).value) for reading in between)


def _terms(reading: float, is_knuckle: bool) -> np.ndarray:
    """Return the factors of the coefficients of a law."""
    return np.array((1.0, math.sin(reading), math.cos(reading)) if is_knuckle else (1.0, reading))
