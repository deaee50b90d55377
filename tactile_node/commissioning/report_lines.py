"""State what a commissioning has found, line by line, each with a verdict."""

import math
from enum import Enum
from typing import NamedTuple

import numpy as np

from tactile_node.commissioning.evaluation import KEPT_SHARE, Evaluation
from tactile_node.commissioning.measurement import NOT_MEASURED, Estimate
from tactile_node.commissioning.movement import StopWay
from tactile_node.commissioning.opening_law import LEAST_BLOCKS
from tactile_node.commissioning.taxel_survey import TaxelFinding

HELD_SHARE = 0.8        #: Share of the force that must remain without commands.
MOST_NOISE = 0.01       #: Largest noise of a taxel [N].
MOST_DRIFT = 0.01       #: Largest allowed drift of a taxel in five minutes [N].
MOST_LOST = 0.05        #: Largest share of lost frames.
MOST_LATENCY = 0.5      #: Largest time from a stop to standstill [s].
DRIFT_TIME = 300.0      #: Time over which the drift is given [s].
NOT_DONE = 'the step was skipped or not finished'
#: Remedy that repeats the rest. The proof depends on the age of the frames, which the rest measures.
REPEAT_REST = 'Then delete the steps rest and proof from record.json, and start the command again'
#: Factor and unit in which a value is written for a person. The JSON file keeps the units of the measurements.
SHOWN_AS = {'m': (1e3, 'mm'), 'm/s': (1e3, 'mm/s'), 'rad': (180 / math.pi, 'degrees'), 's': (1e3, 'ms'),
            'm/percent': (1e3, 'mm/percent'), 'm/rad': (1e3, 'mm/rad'), 'N/m': (1e-3, 'N/mm')}


class Verdict(Enum):
    """Decision about a measured quantity."""

    PASS = 'pass'
    FAIL = 'fail'
    UNKNOWN = 'unknown'  #: the quantity was not measured


class ReportLine(NamedTuple):
    """One line of the report."""

    name: str
    value: str  #: the value as text; 'unknown' if it was not found out
    verdict: Verdict
    reason: str  #: limit that the value meets or misses, or the reason why the value is not known
    estimate: Estimate = NOT_MEASURED
    unit: str = ''  #: unit of the estimate; '' for a finding without a number


def fact_lines(found: Evaluation) -> list[ReportLine]:
    """Return the findings without a number."""
    lines = [ReportLine('left pad', f'topic {found.names[0]}/taxels', Verdict.PASS, '') if found.names else
             _unknown('left pad')]
    for number, name in enumerate(('left', 'right')):
        if not found.mountings:
            lines.append(_unknown(f'{name} pad, mounting'))
            continue
        mounting = found.mountings[number]
        reason = 'mirrored_pads in the parameter file' if mounting.is_mirrored else ''
        lines.append(ReportLine(f'{name} pad, mounting', str(mounting), Verdict.PASS, reason))
        findings = found.taxels[number]
        faulty = [tuple(map(int, place)) for place in np.argwhere(findings == TaxelFinding.FAULTY)]
        unknown = int(np.count_nonzero(findings == TaxelFinding.UNKNOWN))
        lines.append(ReportLine(f'{name} pad, faulty taxels', str(faulty or 'none'), Verdict.PASS,
                                f'{unknown} taxels are unknown, because nothing pressed them'))
    for way in StopWay:
        tried, kept = found.tried(way), found.tried(way).kept
        if not tried.trials:
            lines.append(_unknown(f'stop by {way.value}'))
            continue
        text = f'; keeps {100 * kept.value:.0f} % of the force on foam, at least {100 * KEPT_SHARE:.0f} % needed' \
            if kept.is_known else ''
        sure = f'; at least {100 * tried.least_share:.0f} % with 95 % confidence' if tried.is_reliable else ''
        fits = tried.is_reliable and not (kept.is_known and kept.value < KEPT_SHARE)
        lines.append(ReportLine(f'stop by {way.value}', f'{tried.stopped} of {len(tried.trials)} stopped',
                                Verdict.PASS if fits else Verdict.FAIL, f'all must stop{sure}{text}'))
    return [*lines, fits_closing(found)]


def fits_closing(found: Evaluation) -> ReportLine:
    """Return whether the gripper is fit for closing by touch, with the numbers."""
    name, limit = 'fit for closing by touch', found.plan.force_limit
    cancel, goal = (found.tried(way) for way in (StopWay.CANCEL, StopWay.GOAL))
    counts = f'cancel {cancel.stopped} of {len(cancel.trials)}, goal {goal.stopped} of {len(goal.trials)}'
    if not cancel.trials or not cancel.kept.is_known:
        return _unknown(name)
    if found.stop_by is None:
        return ReportLine(name, 'no', Verdict.FAIL, f'no way to stop is reliable and keeps the force: {counts}')
    step, stiffness = found.step, found.stiffness
    if not (step.is_known and stiffness.is_known):
        missing = [each for each, value in (('step', step), ('stiffness', stiffness)) if not value.is_known]
        return _unknown(name, f'not known: {", ".join(missing)}')
    force = step.value * stiffness.value
    spread = 2 * math.hypot(step.deviation * stiffness.value, step.value * stiffness.deviation)
    numbers = f'step {1e3 * step.value:.3f} mm x stiffness {stiffness.value / 1e3:.2f} N/mm = {force:.2f} N'
    if force > limit + spread:
        return ReportLine(name, 'no', Verdict.FAIL, f'{numbers}, more than the force limit of {limit:g} N')
    if force > limit - spread:
        return _unknown(name, f'{numbers}, too close to the force limit of {limit:g} N')
    return ReportLine(name, 'yes', Verdict.PASS, f'{numbers}; stops: {counts}')


def measurement_lines(found: Evaluation) -> list[ReportLine]:
    """Return the measured quantities."""
    lines = []
    for pad, rest in zip(found.plan.pads, found.rests):
        name = f'{pad}/taxels'
        lines += [_limited(f'{name}, noise', rest.noise, 'N', MOST_NOISE),
                  _limited(f'{name}, drift in {DRIFT_TIME:g} s', rest.drift.scaled(DRIFT_TIME), 'N', MOST_DRIFT,
                           f'Wait until the pads are warm, and touch nothing. {REPEAT_REST}'),
                  _line(f'{name}, frame rate', Estimate(rest.rate, 0.0), 'Hz'),
                  _limited(f'{name}, lost frames', Estimate(rest.lost, 0.0), '1', MOST_LOST, 'Reduce the load of '
                           f'the machine, or give the driver a longer sync_period. {REPEAT_REST}')]
    law, no_law = found.law, _no_law(found)
    no_foam = '' if 'foam' in found.record else NOT_DONE
    lines += [_line('opening in the middle of the blocks', law.opening(law.middle) if law else NOT_MEASURED, 'm',
                    no_law),
              _line('change of the opening per unit of the joint',
                    law.slope(law.middle) if law else NOT_MEASURED, f'm/{found.plan.unit}', no_law),
              _line('speed', found.speed, 'm/s', NOT_DONE if law else no_law),
              _line('step', found.step, 'm', no_law if 'step' in found.record else NOT_DONE),
              _line('stiffness with a hard block', found.stiffness, 'N/m',
                    'too few stalls with a large force' if law else no_law),
              _line('force per effort', found.effort_map.slope, 'N',
                    no_foam or 'too few efforts pressed with a force')]
    bounds = [('time from a command to the movement', found.start_latency, NOT_DONE),
              *((f'time from a stop by {way.value} to standstill', found.stop_latency(way),
                 'a stop failed' if found.tried(way).trials else NOT_DONE) for way in (StopWay.CANCEL, StopWay.GOAL)),
              ('latency: time from a force on a pad to standstill', found.latency, NOT_DONE)]
    lines += [_line(name, Estimate(bound, 0.0), 's', unknown, f'upper bound; at most {1e3 * MOST_LATENCY:g} ms',
                    fits=bound <= MOST_LATENCY) for name, bound, unknown in bounds]
    names = 'right pad, offset along x', 'right pad, offset along y', 'right pad, turn', 'tilt along x', \
        'tilt along y'
    lines += [_line(name, each, unit, no_law) for name, each, unit in zip(
        names, found.alignment or [NOT_MEASURED] * 5, ('m', 'm', 'rad', 'rad', 'rad'))]
    no_place = no_law if 'jig' in found.record else NOT_DONE if found.plan.jig else 'relative only, without a jig'
    names_in_jig = *(f'{axis} in the frame of the gripper' for axis in 'xyz'), 'turn against the jig', \
        'tilt along x against the jig', 'tilt along y against the jig'
    lines += [_line(f'left pad, {name}', each, unit, no_place) for name, each, unit in zip(
        names_in_jig, found.left_place or [NOT_MEASURED] * 6, ('m',) * 3 + ('rad',) * 3)]
    shift, no_shift = found.shift_per_load
    predicted, overs = found.predicted_overshoot, [close.overshoot for close in found.closes]
    return [*lines,
            _line('share of the force without commands', found.held, '1', no_foam or 'too few frames',
                  f'at least {HELD_SHARE:g}', fits=found.held.value >= HELD_SHARE),
            _line('shift per load', shift, 'm', no_shift),
            _line('largest overshoot of the closes', Estimate(max(overs, default=math.nan), 0.0), 'N',
                  found.record['proof'].get('reason', NOT_DONE), f'predicted at most {predicted:.2f} N',
                  fits=max(overs, default=math.nan) <= predicted)]


def _no_law(found: Evaluation) -> str:
    """Reason why the opening law is not known."""
    if len(found.grips) < len(found.plan.blocks):
        return NOT_DONE
    if len(found.grips) < LEAST_BLOCKS:
        return f'the law needs {LEAST_BLOCKS} blocks'
    return 'the widths of the blocks do not fit one law, so a block has another width than stated'


def _unknown(name: str, reason: str = NOT_DONE) -> ReportLine:
    return ReportLine(name, 'unknown', Verdict.UNKNOWN, reason)


def _line(name: str, estimate: Estimate, unit: str, unknown: str = NOT_DONE, limit: str = '', *,
          fits: bool = True) -> ReportLine:
    """Return a line of the report.

    Parameters
    ----------
    name, estimate, unit
        The quantity.
    unknown : str
        Reason if the value is not known.
    limit : str
        Limit of the value, or '' if there is none.
    fits : bool
        True if a known value meets its limit.
    """
    if not estimate.is_known:
        return _unknown(name, unknown)._replace(unit=unit)
    factor, shown = SHOWN_AS.get(unit, (1.0, unit))
    value, deviation = estimate.scaled(factor)
    text = f'{value:.4g} +- {deviation:.2g}' if deviation else f'{value:.4g}'
    verdict = Verdict.PASS if fits else Verdict.FAIL
    return ReportLine(name, text if unit == '1' else f'{text} {shown}', verdict, limit, estimate, unit)


def _limited(name: str, estimate: Estimate, unit: str, limit: float, remedy: str = '') -> ReportLine:
    """Return a line whose magnitude has an upper limit. A value above the limit gets the remedy."""
    fits = abs(estimate.value) <= limit
    reason = f'at most {limit:g} {unit}'.removesuffix(' 1')
    return _line(name, estimate, unit, limit=reason if fits or not remedy else f'{reason}. {remedy}', fits=fits)
