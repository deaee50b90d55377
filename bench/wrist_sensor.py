"""Simulate a force sensor in the wrist of an arm that lowers an object onto a table, for bench_put_down.py.

The sensor measures the force along the approach, so the force of the table appears as a missing weight. The sensor has
white noise and drifts. The force of the moving hand, for example its vibration, is not simulated. The planner tares the
sensor at the beginning of the descent, and detects the table once a moving average exceeds a threshold.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from put_down_world import Descent
from scipy.signal import lfilter

from tactile_node.gripper.rules.put_down import BASELINE_TIME
from training.ground_truth.seeds import Purpose, generator

HIGHEST = 0.03       #: Largest error of the expected height of the table [m].
LOWEST = -0.035      #: Height at which each arm stops, from the expected height of the table [m].
AHEAD = 2.5          #: Time from the beginning of the descent to the highest possible table [s].
WRIST_RATE = 100     #: Readings per second.
NOISES = (1.0, 2.0, 4.0)  #: Standard deviations of the white noise [N].
#: Largest drift [N/s]. The sensor of a UR arm at rest drifted by 4 N in about five minutes after its start
#: (UniversalRobots/Universal_Robots_ROS_Driver#633). A warm sensor drifts less.
DRIFT = 4.0 / 300
TARE_TIME = BASELINE_TIME  #: Time over which the tare is taken [s], the same as for the pads.
WINDOWS = (0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5)  #: Windows of the moving average [s].
THRESHOLD_STEP = 0.1    #: Thresholds are multiples of this force [N].
TUNING_MINUTES = 600.0  #: Time in the air in which a tuned threshold is never exceeded [min].
TUNING_TOUCHES = 1000   #: Number of touches from which the window is chosen.
TUNING_SEED = 92_000_000


class WristRule(NamedTuple):
    """A moving average and a threshold."""

    window: float     #: duration of the moving average [s]
    threshold: float  #: force of the table [N]

    def exceeded(self, readings: np.ndarray) -> np.ndarray:
        """Return True for each reading at which the moving average exceeds the threshold. The tare comes before."""
        return after_tare(smoothed(readings, self.window)) > self.threshold


def duration(speed: float) -> float:
    """Return the duration of a descent to the lowest height [s]."""
    return AHEAD + (HIGHEST - LOWEST) / speed


def reading_times(speed: float) -> np.ndarray:
    """Return the times of the readings in a descent [s]."""
    return np.arange(round(duration(speed) * WRIST_RATE)) / WRIST_RATE


def errors(rng: np.random.Generator, count: int, speed: float, noise: float) -> np.ndarray:
    """Return the error of the sensor in ``count`` descents after the tare [N]. Shape: (count, number of readings)."""
    times = reading_times(speed)
    values = rng.uniform(-DRIFT, DRIFT, (count, 1)) * times + noise * rng.standard_normal((count, len(times)))
    tare = values[:, :round(TARE_TIME * WRIST_RATE)].mean(axis=1, keepdims=True)
    offset: np.ndarray = values - tare
    return offset


def smoothed(readings: np.ndarray, window: float) -> np.ndarray:
    """Return the mean of the readings within the last ``window`` [s]."""
    count = round(window * WRIST_RATE)
    mean: np.ndarray = lfilter(np.full(count, 1 / count), 1, readings)
    return mean


def after_tare(values: np.ndarray) -> np.ndarray:
    """Set the values before the end of the tare to -inf."""
    return np.where(np.arange(values.shape[-1]) < TARE_TIME * WRIST_RATE, -np.inf, values)


@cache
def tuned(speed: float, stopping: float, weights: tuple[float, ...], noise: float) -> WristRule:
    """Return the best rule for the tuning seeds.

    For each window, the threshold is the smallest one that no descent through the air exceeds in TUNING_MINUTES. The
    best window gives the smallest mean force on the table when the arm stands still.

    Parameters
    ----------
    speed : float
        Speed of the hand [m/s].
    stopping : float
        Time from the detection until the arm stands still [s].
    weights : tuple of float
        Weights of the objects on each pad [normal force].
    noise : float
        Standard deviation of the white noise [N].
    """
    rng, times = generator(Purpose.VALIDATION, TUNING_SEED), reading_times(speed)
    air = errors(rng, int(np.ceil(60 * TUNING_MINUTES / (times[-1] - TARE_TIME))), speed, noise)
    heights = rng.uniform(-HIGHEST, HIGHEST, TUNING_TOUCHES)
    descents = [Descent(weights[number % len(weights)], speed, met_at(height, speed), pushes=True)
                for number, height in enumerate(heights)]
    touches = errors(rng, TUNING_TOUCHES, speed, noise) + [each.pressed(times) for each in descents]

    def candidate(window: float) -> tuple[float, WristRule]:
        highest = after_tare(smoothed(air, window)).max()
        rule = WristRule(window, float(np.ceil(highest / THRESHOLD_STEP)) * THRESHOLD_STEP)
        is_above = rule.exceeded(touches)
        found = np.where(is_above.any(axis=1), times[is_above.argmax(axis=1)], np.inf)
        return float(np.mean([each.pressed(time + stopping) for each, time in zip(descents, found)])), rule
    return min(map(candidate, WINDOWS))[1]


def met_at(height: float, speed: float) -> float:
    """Return the time at which the object meets a table at ``height`` above its expected height [s]."""
    return AHEAD + (HIGHEST - height) / speed


def false_touches(rule: WristRule, rng: np.random.Generator, minutes: float, speed: float, noise: float) -> int:
    """Return the number of descents through the air in ``minutes`` in which the rule detects a table."""
    watched = reading_times(speed)[-1] - TARE_TIME
    return int(rule.exceeded(errors(rng, int(np.ceil(60 * minutes / watched)), speed, noise)).any(axis=1).sum())
