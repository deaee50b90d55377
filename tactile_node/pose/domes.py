"""Whether what presses may be round, seen from a fit as a flat punch: a fit as a dome takes three times as long."""

import numpy as np

from tactile_node.pose.candidate import Candidate, loading_of
from tactile_node.pose.evidence import Evidence
from tactile_node.pose.least_squares import Solution
from tactile_node.pose.profiles import DOMES
from tactile_node.shape.recognition import Shape

#: Thresholds: few punches of training seeds and even pressures pass them.
CIRCLE_PEAK, BALL_PEAK, DOME_CURVATURE = 0.3, -0.05, -0.005
BAD_FIT, DEEP = 2.0, 0.5  #: sum of squares a taxel; depth [pitches]: a dome looks like an even pressure, deep below
NO_PUNCH_PEAK = -0.3  #: no punch, sharp or rounded, is so much higher in its middle


def may_be_dome(evidence: Evidence, shape: Shape, punch: Candidate) -> bool:
    """Return whether a fit as a ``punch`` asks for one as a ball, a cone or a lying cylinder.

    Its residuals then fall outwards; a ball may show as a negative peak.
    """
    loading = loading_of(punch)
    if loading is None or shape not in DOMES or shape is Shape.CIRCLE and loading.peak > CIRCLE_PEAK:
        return False
    if shape is Shape.CIRCLE and (
            loading.peak < BALL_PEAK or loading.depth > DEEP and _is_bad(punch.solution, evidence)):
        return True
    return _curvature(evidence, shape, punch.solution) < DOME_CURVATURE


def is_no_punch(shape: Shape, punch: Candidate) -> bool:
    """Return whether a fit as a ``punch`` has found a pressure that is none of a punch's."""
    loading = loading_of(punch)
    return loading is not None and shape is Shape.CIRCLE and loading.peak < NO_PUNCH_PEAK


def _is_bad(solution: Solution, evidence: Evidence) -> bool:
    return bool(solution.misfit > BAD_FIT * np.count_nonzero(evidence.used))


def _curvature(evidence: Evidence, shape: Shape, solution: Solution) -> float:
    """Slope of the residuals against the squared distance from the middle, or from a rectangle's long axis."""
    row, col = np.divmod(np.arange(evidence.used.size), evidence.window.cols)
    x, y = col + evidence.window.col - solution.parameters[0], row + evidence.window.row - solution.parameters[1]
    if shape is Shape.CIRCLE:
        outwards, along = np.hypot(x, y) / solution.parameters[2], 0.0
    else:
        angle, long, short = solution.parameters[2:5]
        outwards = np.abs(y * np.cos(angle) - x * np.sin(angle)) / (short / 2)
        along = np.abs(x * np.cos(angle) + y * np.sin(angle)) / (long / 2)
    inside = evidence.used & (outwards < 1) & (along < 1)
    square = outwards[inside] ** 2
    square -= square.mean() if inside.any() else 0.0
    residual = (evidence.values - solution.prediction.values)[inside]
    return float(residual @ square / max(square @ square, 1e-9))
