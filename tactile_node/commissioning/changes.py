"""Compare a check with the first commissioning, and name the changes of the pads and of the gripper."""

import math
from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from tactile_node.commissioning.commissioning_record import CommissioningRecord
from tactile_node.commissioning.evaluation import DriverPad, Evaluation
from tactile_node.commissioning.guarded_gripper import MOST_DRIFT
from tactile_node.commissioning.movement import StopWay
from tactile_node.commissioning.plan import CommissioningPlan
from tactile_node.commissioning.taxel_survey import TaxelFinding

COMPARED = 'rest', 'pads', 'first movement', 'stops'  #: Steps that both records need.
OTHER_PAD = 0.3       #: Correlation of two zeros below which they belong to different pads.
CLEAR_PATTERN = 10.0  #: Spread of a zero over the taxels that identifies a pad [standard deviations of its mean].
RATE_CHANGE = 0.05    #: Change of a rate or a speed that is reported.
SPEED_SIGMAS = 3.0    #: Change of the speed that is reported [standard deviations].
PHASE = 1.2           #: Change of a time that the phase of the samples may cause [periods].
FALSE_ALARM = 0.01    #: Largest probability that an unchanged gripper exceeds a limit.


class Change(Enum):
    """Kind of a change."""

    PADS_SWAPPED = 'the pads are swapped'
    PAD_TURNED = 'the pad is mounted in another way'
    PAD_EXCHANGED = 'the pad was exchanged (or, without a new serial number, each of its taxels has drifted)'
    ZERO_DRIFTED = 'the zero has drifted'
    TAXEL_LOST = 'a taxel is gone'
    FRAME_RATE = 'the frame rate is different'
    DIRECTION = 'the gripper opens in the other direction'
    STARTS_LATER = 'the gripper starts to move later after a command'
    STOPS_LATER = 'the gripper stops later'
    STOP_FAILS = 'a stop has failed'
    SPEED = 'the gripper moves at another speed'


class FoundChange(NamedTuple):
    """One change since the first commissioning."""

    change: Change
    where: str
    before: str
    now: str

    def __str__(self) -> str:
        return f'{self.where}: {self.change.value}: {self.now}, was {self.before}'


def find_changes(first: CommissioningRecord, check: CommissioningRecord, plan: CommissioningPlan) -> list[FoundChange]:
    """Return the changes between two records that contain the steps COMPARED.

    The function identifies a pad by its serial number and by the pattern of its zero over the taxels. After a tare, the
    zero has no pattern, so only a different serial number then shows an exchanged pad.

    Parameters
    ----------
    first, check : CommissioningRecord
        Results of the first commissioning and of the check.
    plan : CommissioningPlan
        Plan of the first commissioning.
    """
    before, now = Evaluation(first, plan), Evaluation(check, plan)
    found = [] if before.is_swapped == now.is_swapped else [FoundChange(
        Change.PADS_SWAPPED, 'pads', *(f'the left pad is pad {2 if each.is_swapped else 1} of the driver'
                                       for each in (before, now)))]
    for number, (old, new) in enumerate(zip(_partners(before, now), now.driver_pads), 1):
        found += _changes_of_pad(f'pad {number} of the driver', old, new)
    return found + _changes_of_gripper(before, now, plan.unit)


def _partners(before: Evaluation, now: Evaluation) -> list[DriverPad]:
    """Return each pad of the driver as it was in the first record. The pads of the driver may be renamed."""
    old, new = before.driver_pads, now.driver_pads
    serials = [[pad.serial_number for pad in pads] for pads in (old, new)]
    if all(serials[0] + serials[1]) and serials[0][0] != serials[0][1]:
        is_crossed = serials[1] == serials[0][::-1]
    else:
        straight, crossed = (sum(map(_correlation, pads, new)) for pads in (old, old[::-1]))
        is_crossed = crossed > straight
    return old[::-1] if before.is_swapped != now.is_swapped and is_crossed else old


def _zeros(old: DriverPad, new: DriverPad) -> tuple[np.ndarray, np.ndarray]:
    """Return both zeros of the taxels that work in both records, (N,) [N]."""
    before, now = (np.where(pad.taxels == TaxelFinding.FAULTY, np.nan, pad.rest.zero) for pad in (old, new))
    used = np.isfinite(before) & np.isfinite(now)
    return before[used], now[used]


def _correlation(old: DriverPad, new: DriverPad) -> float:
    """Return the correlation of two zeros; NaN if a zero shows no pattern."""
    zeros = _zeros(old, new)
    for pad, zero in zip((old, new), zeros):
        # upper bound of the standard error of a taxel's zero, which is a mean over at least one second [N]
        error = pad.rest.noise.value / np.sqrt(pad.rest.rate)
        if zero.size < 2 or not zero.std() > CLEAR_PATTERN * error:
            return float('nan')
    return float(np.corrcoef(*zeros)[0, 1])


def _changes_of_pad(where: str, old: DriverPad, new: DriverPad) -> list[FoundChange]:
    found = []
    if old.mounting != new.mounting:
        found.append(FoundChange(Change.PAD_TURNED, where, str(old.mounting), str(new.mounting)))
    likeness = _correlation(old, new)
    serials = old.serial_number, new.serial_number
    if all(serials) and serials[0] != serials[1]:
        found.append(FoundChange(Change.PAD_EXCHANGED, where, *(f'serial number {each}' for each in serials)))
    elif likeness < OTHER_PAD:
        found.append(FoundChange(Change.PAD_EXCHANGED, where, 'at least 0.7 for the same pad',
                                 f'correlation of the zeros {likeness:.2f}'))
    else:
        before, now = _zeros(old, new)
        change = np.abs(now - before)
        if (change > MOST_DRIFT).any():
            found.append(FoundChange(Change.ZERO_DRIFTED, where, '0 N', f'up to {change.max():.3f} N on '
                                     f'{np.count_nonzero(change > MOST_DRIFT)} taxels'))
    lost = (old.taxels == TaxelFinding.WORKS) & (new.taxels == TaxelFinding.FAULTY)
    found += [FoundChange(Change.TAXEL_LOST, f'{where}, taxel ({row}, {col})', 'working',
                          'still while its neighbours move') for row, col in np.argwhere(lost)]
    rates = old.rest.rate, new.rest.rate
    if abs(rates[1] - rates[0]) > RATE_CHANGE * rates[0]:
        found.append(FoundChange(Change.FRAME_RATE, where, f'{rates[0]:.4g} Hz', f'{rates[1]:.4g} Hz'))
    return found


def _changes_of_gripper(before: Evaluation, now: Evaluation, unit: str) -> list[FoundChange]:
    found = []
    if before.opens_rising != now.opens_rising:
        words = ['opens as the reading rises' if each.opens_rising else 'opens as the reading falls'
                 for each in (before, now)]
        found.append(FoundChange(Change.DIRECTION, 'gripper', *words))
    period = max(before.period, now.period)
    started, starts = ([trial.started for way in StopWay for trial in each.tried(way).trials] for each in (now, before))
    if max(started) > (limit := largest_expected(starts, [starts], period, len(started))):
        found.append(_later(Change.STARTS_LATER, 'gripper', limit, max(started)))
    stops = {way: [trial.stopped for trial in before.tried(way).trials] for way in StopWay
             if before.tried(way).is_reliable}
    for way, times in stops.items():
        where, tried = f'stop by {way.value}', now.tried(way)
        latest = max(trial.stopped for trial in tried.trials)
        if not tried.is_reliable:
            found.append(FoundChange(Change.STOP_FAILS, where, 'no failed stop',
                                     f'{tried.stopped} of {len(tried.trials)} stopped'))
        elif latest > (limit := largest_expected(times, list(stops.values()), period, len(tried.trials))):
            found.append(_later(Change.STOPS_LATER, where, limit, latest))
    speeds = before.joint_speed, now.joint_speed
    change = abs(speeds[1].value - speeds[0].value)
    if change > max(RATE_CHANGE * speeds[0].value, SPEED_SIGMAS * np.hypot(speeds[0].deviation, speeds[1].deviation)):
        found.append(FoundChange(Change.SPEED, 'gripper', *(f'{each.value:.4g} {unit}/s' for each in speeds)))
    return found


def largest_expected(before: Sequence[float], groups: Sequence[Sequence[float]], period: float, count: int) -> float:
    """Return the limit for the largest of ``count`` new times.

    An unchanged gripper exceeds the limit with a probability of at most FALSE_ALARM. The limit takes into account the
    number of trials before and now, so a few trials may be compared with many.

    Parameters
    ----------
    before : sequence of float
        Times in the first commissioning [s], two or more.
    groups : sequence of sequence of float
        Groups of times with the same spread, among them ``before``. The groups may have different means.
    period : float
        Period of the joint states [s]. A time may change by a whole period, because the phase of the samples changes.
    count : int
        Number of new times.
    """
    residuals = np.concatenate([np.array(each) - np.mean(each) for each in groups])
    freedom = len(residuals) - len(groups)
    deviation = math.sqrt(float(residuals @ residuals) / freedom * (1 + 1 / len(before)))
    spread = float(stdtrit(freedom, 1 - FALSE_ALARM / count)) * deviation
    return float(np.mean(before)) + max(spread, PHASE * period)


def _later(change: Change, where: str, before: float, now: float) -> FoundChange:
    """Return the change that the time ``now`` [s] exceeds the limit ``before`` [s]."""
    return FoundChange(change, where, f'at most {1e3 * before:.0f} ms', f'at least {1e3 * now:.0f} ms')
