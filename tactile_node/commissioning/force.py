"""Measure forces: the map from effort to force, the force that remains, and the overshoot of a close."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from tactile_node.commissioning.measurement import NOT_MEASURED, Estimate, line_through

EXCEEDED = 0.01        #: Share of the stalls that may exceed the force limit.
LEAST_LOAD = 0.5       #: Smallest force of a stall from which the map is computed [N].


class EffortMap(NamedTuple):
    """Force of a pad as a straight line over the effort of a command."""

    slope: Estimate   #: [N per unit of the effort]
    offset: Estimate  #: force at an effort of 0 [N], usually below 0

    @property
    def is_known(self) -> bool:
        return self.slope.is_known and self.slope.value > 0

    def effort(self, force: float) -> float:
        """Return the effort for a force [N]."""
        return (force - self.offset.value) / self.slope.value


def map_effort(efforts: Sequence[float], forces: Sequence[float]) -> EffortMap:
    """Return the map through the stalls with at least LEAST_LOAD."""
    x, y = np.array(efforts, float), np.array(forces, float)
    used = y >= LEAST_LOAD
    return EffortMap(*line_through(x[used], y[used]))


def safe_force(efforts: Sequence[float], forces: Sequence[float], limit: float) -> float:
    """Return the largest force to aim at by `map_effort`, so that a stall exceeds ``limit`` in 1 of 100 cases [N].

    The scatter of a stall is assumed to be proportional to its force. The result is NaN without a map.

    Parameters
    ----------
    efforts, forces : sequence of float
        Stalls from which the map is computed.
    limit : float
        Largest allowed force [N].
    """
    known = map_effort(efforts, forces)
    x, y = np.array(efforts, float), np.array(forces, float)
    x, y = x[y >= LEAST_LOAD], y[y >= LEAST_LOAD]
    if not known.is_known:
        return math.nan
    freedom = len(x) - 2
    relative = 1 - (known.offset.value + known.slope.value * x) / y
    centred = x - x.mean()
    influence = 1 / len(x) + (known.effort(limit) - x.mean()) * centred / (centred @ centred)
    spread = math.sqrt(float(relative @ relative) / freedom * (1 + float(influence ** 2 @ y ** 2) / limit ** 2))
    return limit / (1 + float(stdtrit(freedom, 1 - EXCEEDED)) * spread)


def remaining_share(times: np.ndarray, forces: np.ndarray, ended: float, drift: float) -> Estimate:
    """Return the share of the force that is left at the end of a recording.

    Parameters
    ----------
    times : np.ndarray
        Times of the frames, (K,) [s].
    forces : np.ndarray
        Force on a pad, (K,) [N].
    ended : float
        Time at which the commands ended [s].
    drift : float
        Change of the reading of an untouched pad during the recording [N].
    """
    before, after = forces[times < ended], forces[times >= ended]
    tail = after[len(after) * 3 // 4:]
    if len(before) < 5 or len(tail) < 5:
        return NOT_MEASURED
    error = np.hypot(tail.std() / np.sqrt(len(tail)), before.std() / np.sqrt(len(before)))
    level = float(before.mean())
    return Estimate(float(tail.mean()) / level, float(np.hypot(error, drift)) / level)


class Close(NamedTuple):
    """One close until the pads read a force."""

    overshoot: float  #: largest force after the stop, minus the force at which the stop was due [N]
    seconds: float    #: time from this force until the largest force [s]
    forces: tuple[float, float]  #: force on both pads at rest [N]


def predict_overshoot(latency: float, speed: float, stiffness: float, step: float) -> float:
    """Return the largest force that builds up from the due stop until the gripper is at rest [N].

    Parameters
    ----------
    latency : float
        Upper bound of the time from the force on the pads until the gripper moves no further [s].
    speed : float
        Closing speed [m/s].
    stiffness : float
        Force per change of the opening [N/m].
    step : float
        Distance by which the gripper may move further because it rounds the goal of a stop [m].
    """
    return stiffness * (latency * speed + step)
