"""Measure movements of the joint: when they begin and end, how fast they are, and in which steps they end."""

import math
from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np

from tactile_node.commissioning.measurement import NOT_MEASURED, Estimate, line_through, mean_of
from tactile_node.commissioning.recording import JointStates

NOISES = 4.0           #: A change by this many standard deviations of the joint's noise is a movement.
CLEAR_NOISES = 20.0    #: A change by this many deviations shows a movement even among thousands of samples.
CONFIDENCE = 0.95      #: Confidence of an upper bound of a latency.
#: Distance of a latency's bound above the largest time. The distance is this factor times the spread of the times,
#: times the root of the chance that one trial misses the bound.
BOUND_FACTOR = 1.1
#: Distance from standstill at which a sample may already look still [deviations]: NOISES, and the noise of the sample.
UNSEEN_NOISES = 6.0
BRAKING = 0.05         #: Time within which a gripper is assumed to brake from its speed to rest [s].
TURNING_SHARE = 0.7     #: Share of the lost part that lies before a turn, because the way back shows the turn.
BLOCKED = 0.05         #: Share of the way to the target within which a movement has reached its target.
END_SHARE = 0.25       #: Share at each end of a movement that is not used for the speed.


class StopWay(Enum):
    """Way to stop the gripper."""

    CANCEL = 'cancel'   #: cancel the gripper's action
    GOAL = 'goal'       #: send a goal at the present position
    REVERSE = 'reverse'  #: send a goal to open


class StopTrial(NamedTuple):
    """One attempt to stop a movement."""

    is_stopped: bool
    started: float   #: last time after the command at which the gripper was still at rest [s]
    stopped: float   #: last time after the stop at which the gripper still moved on [s]
    returns: bool    #: True if the gripper moved back after it had stopped


class TriedStop(NamedTuple):
    """Results of a commissioning for one way to stop."""

    trials: tuple[StopTrial, ...]
    kept: Estimate  #: share of the force on foam that remains after a stop

    @property
    def stopped(self) -> int:
        """Number of trials in which the gripper stopped."""
        return sum(trial.is_stopped for trial in self.trials)

    @property
    def is_reliable(self) -> bool:
        return bool(self.trials) and self.stopped == len(self.trials)

    @property
    def least_share(self) -> float:
        """Lower bound of the share of successful stops, with CONFIDENCE, if every trial succeeded; otherwise 0."""
        return (1 - CONFIDENCE) ** (1 / len(self.trials)) if self.is_reliable else 0.0


def measure_stop(joint: JointStates, commanded: float, stopped: float, target: float, noise: float) -> StopTrial:
    """Return how a movement began and whether a stop ended it.

    Parameters
    ----------
    joint : JointStates
        Positions from before the command until the gripper is at rest.
    commanded, stopped : float
        Times of the command and of the stop [s].
    target : float
        Commanded position.
    noise : float
        Standard deviation of the joint's noise.
    """
    before = joint.times <= commanded
    start = float(joint.positions[before].mean())
    sign = math.copysign(1.0, target - start)
    progress = sign * (joint.positions - start)
    moved = np.flatnonzero(~before & (progress > CLEAR_NOISES * noise))
    clear = int(moved[0]) if moved.size else len(progress)
    at_rest = np.flatnonzero(progress[:clear] <= NOISES * noise)
    started = float(joint.times[at_rest[-1] if at_rest.size else 0] - commanded)
    is_stopped = bool(progress.max() < (1 - BLOCKED) * abs(target - start))
    extreme = int(np.argmax(progress))
    returns = bool(progress.max() - progress[-1] > 2 * NOISES * noise)
    rest = progress[-5:].mean()
    arrived = np.flatnonzero((joint.times > stopped) & (progress >= rest - NOISES * noise))
    last = extreme if returns or not arrived.size else int(arrived[0]) - 1
    return StopTrial(is_stopped, started, float(joint.times[last] - stopped), returns)


def upper_bound(last_before: Sequence[float], period: float) -> float:
    """Return an upper bound of the time of an event, from the last sample before the event in each of several trials.

    The phase of the samples is random, and the latency itself may vary. The sum of two such errors rarely comes close
    to its largest value, so the bound lies above the largest of these times by a share of their spread. The share holds
    with CONFIDENCE if the latency varies by up to 0.6 periods.
    """
    spread = max(period, float(np.ptp(last_before)))
    missed = 1 - (1 - CONFIDENCE) ** (1 / len(last_before))
    return float(max(last_before)) + BOUND_FACTOR * spread * math.sqrt(missed)


def stop_latency(trials: Sequence[StopTrial], period: float, noise: float, speed: float) -> float:
    """Return an upper bound of the time from a stop until the gripper moves no further [s].

    The time is NaN without trials, and for a way to stop that failed once.

    The end of a braked movement is lost in the noise. For a gripper that brakes within BRAKING, the lost part of the
    movement takes the time that is added.
    """
    if not trials or not all(trial.is_stopped for trial in trials):
        return math.nan
    unseen = math.sqrt(2 * UNSEEN_NOISES * noise * BRAKING / speed)
    times = [trial.stopped for trial in trials]
    if any(trial.returns for trial in trials):
        return max(times) + period / 4 + TURNING_SHARE * unseen  # the turn lies between two samples
    return upper_bound(times, period) + unseen


def measure_speed(movements: Sequence[JointStates], noise: float) -> Estimate:
    """Return the mean speed in the middle of several movements [reading/s]."""
    speeds = []
    for joint in movements:
        progress = np.abs(joint.positions - joint.positions[0])
        share = progress / max(progress.max(), 1e-12)
        used = (share > END_SHARE) & (share < 1 - END_SHARE)
        if np.count_nonzero(used) >= 3 and progress.max() > 10 * noise:
            speeds.append(abs(float(np.polyfit(joint.times[used], joint.positions[used], 1)[0])))
    return mean_of(speeds)


def measure_step(commanded: np.ndarray, reached: np.ndarray, noise: float) -> Estimate:
    """Return the smallest change of the reading that the gripper makes.

    The commands rise in small increments. The gripper stays at one level until a command reaches the next level.

    Parameters
    ----------
    commanded, reached : np.ndarray
        Commanded positions, and mean positions at rest after each command, (K,).
    noise : float
        Standard deviation of one mean position.
    """
    increment = float(np.median(np.abs(np.diff(commanded))))
    order = np.sort(reached)
    jumps = np.diff(order)
    limit = max(2 * NOISES * noise, increment / 2)
    levels = np.split(order, np.flatnonzero(jumps > limit) + 1)
    centres = np.array([level.mean() for level in levels])
    if len(centres) < 5:
        return NOT_MEASURED
    inner = centres[1:-1]  # the levels at both ends may be cut off
    return line_through(np.arange(len(inner)), inner)[0]
