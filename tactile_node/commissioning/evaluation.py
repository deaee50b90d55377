"""Turn the record of a commissioning into measured values and facts, each with a verdict.

A value that was not measured is unknown. It is never replaced by a default.
"""

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tactile_node.commissioning.block_grip import BlockGrip
from tactile_node.commissioning.commissioning_record import (
    CommissioningRecord,
    faces_from,
    grip_from,
    hung_from,
    rest_from,
)
from tactile_node.commissioning.force import Close, EffortMap, map_effort, predict_overshoot
from tactile_node.commissioning.jig import PadPlace, place_left_pad
from tactile_node.commissioning.lateral_shift import shift_of, shift_per_load
from tactile_node.commissioning.measurement import NOT_MEASURED, Estimate, Measurement, Verdict
from tactile_node.commissioning.movement import StopCount, StopTrial, StopWay, stop_latency, upper_bound
from tactile_node.commissioning.opening_law import LEAST_BLOCKS, OpeningLaw, chord_error, find_law, speed_at
from tactile_node.commissioning.pad_alignment import PadAlignment, find_alignment
from tactile_node.commissioning.pad_mounting import PadMounting
from tactile_node.commissioning.pad_rest import PadRest
from tactile_node.commissioning.plan import CommissioningPlan
from tactile_node.commissioning.taxel_survey import TaxelFinding

KEPT_SHARE = 0.7        #: Share of the force on foam that must remain after a stop.
HELD_SHARE = 0.8        #: Share of the force that must remain without commands.
MOST_NOISE = 0.01       #: Largest noise of a taxel [N].
MOST_DRIFT = 0.01       #: Largest allowed drift of a taxel in five minutes [N].
MOST_LOST = 0.05        #: Largest share of lost frames.
MOST_LATENCY = 0.5      #: Largest time from a stop to standstill [s].
MOST_CHORD_ERROR = 2e-4  #: Largest error of a linear law that stands for a knuckle [m].
LEAST_FORCE_ERROR = 0.005  #: Relative error of the force that both pads may share.
DRIFT_TIME = 300.0      #: Time over which the drift is given [s].
NOT_DONE = 'the step was skipped or not finished'
#: Remedy that repeats the rest. The proof depends on the age of the frames, which the rest measures.
REPEAT_REST = 'Then delete the steps rest and proof from record.json, and start the command again'


class Fact(NamedTuple):
    """A finding without a number."""

    name: str
    value: str  #: 'unknown' if it was not found out
    verdict: Verdict
    reason: str


class DriverPad(NamedTuple):
    """A pad of the driver after the steps `rest` and `pads`."""

    rest: PadRest
    mounting: PadMounting
    taxels: np.ndarray  #: TaxelFinding of each taxel, (rows, cols)
    serial_number: str  #: '' if it is not known


class Evaluation:
    """Everything that the record of a commissioning shows.

    Parameters
    ----------
    record : CommissioningRecord
        Results of the steps.
    plan : CommissioningPlan
        Properties of the gripper from its data sheet.
    """

    def __init__(self, record: CommissioningRecord, plan: CommissioningPlan):
        self._record, self._plan = record, plan

    # ---- pads ----

    @property
    def is_swapped(self) -> bool | None:
        """True if the driver's first pad is the right one; None if unknown."""
        order = self._record.get('pads').get('order')
        return None if order is None else order == [1, 0]

    @property
    def names(self) -> list[str]:
        """Names of the left and the right pad in the driver; empty if unknown."""
        return [self._plan.pads[pad] for pad in self._record.get('pads').get('order', [])]

    def of_skin(self, step: str) -> dict[str, str]:
        """Return the file and the text of the step `response` or `assessment`, or an empty dict."""
        return self._record.get(step)

    @property
    def mountings(self) -> list[PadMounting]:
        """How the left and the right pad are mounted; empty if unknown."""
        return [PadMounting(*each) for each in self._record.get('pads').get('mountings', [])]

    @property
    def taxels(self) -> list[np.ndarray]:
        """TaxelFinding of each taxel of the left and the right pad; empty if unknown."""
        return [np.array(each) for each in self._record.get('pads').get('taxels', [])]

    @cached_property
    def rests(self) -> list[PadRest]:
        """Properties of the untouched pads, in the order of the driver; empty if unknown."""
        return [rest_from(each) for each in self._record.get('rest').get('pads', [])]

    @property
    def driver_pads(self) -> list[DriverPad]:
        """The pads in the order of the driver. The record needs the steps `rest` and `pads`."""
        order = self._record['pads']['order']
        return [DriverPad(rest, self.mountings[order.index(pad)], self.taxels[order.index(pad)], serial_number)
                for pad, (rest, serial_number) in enumerate(zip(self.rests, self._record.serial_numbers))]

    # ---- gripper ----

    @property
    def opens_rising(self) -> bool:
        """True if the reading of the joint rises as the gripper opens. The record needs the step `first movement`."""
        return bool(self._record['first movement']['opens_rising'])

    @cached_property
    def grips(self) -> list[BlockGrip]:
        return [grip_from(content) for name, content in self._record.steps.items() if name.startswith('block ')]

    @cached_property
    def law(self) -> OpeningLaw | None:
        return find_law([grip.onset for grip in self.grips], [grip.width for grip in self.grips],
                        is_angle=self._plan.unit == 'rad')

    @property
    def _no_law(self) -> str:
        """Reason why the opening law is not known."""
        if len(self.grips) < len(self._plan.blocks):
            return NOT_DONE
        if len(self.grips) < LEAST_BLOCKS:
            return f'the law needs {LEAST_BLOCKS} blocks'
        return 'the widths of the blocks do not fit one law, so a block has another width than stated'

    def trials(self, way: StopWay) -> list[StopTrial]:
        return [StopTrial(*each) for each in self._record.get('stops').get('trials', {}).get(way.value, [])]

    def stop_count(self, way: StopWay) -> StopCount:
        trials = self.trials(way)
        return StopCount(len(trials), sum(trial.is_stopped for trial in trials))

    @property
    def stop_by(self) -> StopWay | None:
        """The way to stop for touch_gripper: it never failed, and does not let go. None if there is none."""
        return next((way for way in (StopWay.CANCEL, StopWay.GOAL) if self.stop_count(way).is_reliable
                     and self.kept(way).value >= KEPT_SHARE), None)

    def kept(self, way: StopWay) -> Estimate:
        """Return the share of the force on foam that remains after a stop."""
        return Estimate(*self._record.get('foam').get('kept', {}).get(way.value, NOT_MEASURED))

    @property
    def held(self) -> Estimate:
        """Share of the force on foam that remains without commands."""
        return Estimate(*self._record.get('foam').get('held', NOT_MEASURED))

    @property
    def period(self) -> float:
        """Period of the joint states [s]; NaN if unknown."""
        return float(self._record.get('stops').get('period', math.nan))

    @property
    def joint_speed(self) -> Estimate:
        """Speed of the joint in a free movement [reading/s]."""
        return Estimate(*self._record.get('stops').get('speed', NOT_MEASURED))

    @property
    def start_latency(self) -> float:
        """Upper bound of the time from a command to the movement [s]."""
        started = [trial.started for way in StopWay for trial in self.trials(way)]
        return upper_bound(started, self.period) if started else math.nan

    def stop_latency(self, way: StopWay) -> float:
        """Return the upper bound of the time from a stop to standstill [s]."""
        if not self.trials(way):
            return math.nan
        return stop_latency(self.trials(way), self.period, self._record['first movement']['noise'],
                            self.joint_speed.value)

    @property
    def latency(self) -> float:
        """Upper bound of the time from a force on a pad to standstill, for the way to stop [s]."""
        if self.stop_by is None or 'rest' not in self._record:
            return math.nan
        return float(self._record['rest']['age']) + self.stop_latency(self.stop_by)

    @property
    def speed(self) -> Estimate:
        """Speed of the pads in a free movement [m/s]."""
        return speed_at(self.law, self.law.middle, self.joint_speed) if self.law else NOT_MEASURED

    @property
    def step(self) -> Estimate:
        """Smallest change of the opening [m]."""
        if not self.law or 'step' not in self._record:
            return NOT_MEASURED
        return speed_at(self.law, self._record['step']['at'], Estimate(*self._record['step']['step']))

    def stiffness_at(self, grip: BlockGrip) -> Estimate:
        """Return the force per change of the opening in a grip [N/m]."""
        if not self.law:
            return NOT_MEASURED
        stiffness = grip.stiffness.scaled(1 / abs(self.law.slope(grip.onset.value).value))
        return stiffness.with_error(stiffness.value * self.force_error)

    @property
    def stiffness(self) -> Estimate:
        """Stiffness of the pads with the block of the longest face, which is the stiffest [N/m]."""
        longest = max(self._plan.blocks, key=lambda block: block.length)
        return next((self.stiffness_at(grip) for grip in self.grips if grip.width == longest.width), NOT_MEASURED)

    @property
    def force_error(self) -> float:
        """Relative deviation of the mean force of both pads, from the largest difference between the two pads.

        The forces on both pads of a free block are equal, so a difference shows how well the pads are calibrated.
        """
        return max((abs(grip.imbalance) for grip in self.grips), default=0.0) + LEAST_FORCE_ERROR

    @property
    def effort_map(self) -> EffortMap:
        """Map from effort to force, on foam and blocks."""
        foam = self._record.get('foam')
        efforts = [*foam.get('efforts', []), *(each for grip in self.grips for each in grip.efforts)]
        forces = [*foam.get('forces', []), *(each for grip in self.grips for each in grip.forces)]
        slope, offset = map_effort(efforts, forces)
        return EffortMap(slope.with_error(slope.value * self.force_error), offset)

    @cached_property
    def alignment(self) -> PadAlignment | None:
        """How the pads lie to each other; None if unknown."""
        if not self.law or len(self.grips) < 2:
            return None
        return find_alignment(self.grips, [self.law.slope(grip.onset.value).value for grip in self.grips])

    @cached_property
    def left_place(self) -> PadPlace | None:
        """Pose of the left skin in the frame of the gripper; None if unknown."""
        if self.law is None or self.alignment is None or not (self._plan.jig and 'jig' in self._record):
            return None
        reading = next(grip.onset.value for grip in self.grips if grip.width == self._plan.jig_block.width)
        return place_left_pad(faces_from(self._record['jig']), self.law.slope(reading).value, self.alignment,
                              self._plan.jig)

    @property
    def shift_per_load(self) -> tuple[Estimate, str]:
        """Shift of a contact per load, and the reason if it is not known [m]."""
        hung = [hung_from(each) for each in self._record.get('weight').get('grips', [])]
        return shift_per_load([shift_of(each, self._plan.weight, self._plan.down) for each in hung])

    @property
    def closes(self) -> list[Close]:
        return [Close(*each) for each in self._record.get('proof').get('closes', [])]

    @property
    def predicted_overshoot(self) -> float:
        """Largest overshoot that was predicted for the closes [N]; NaN without closes."""
        return float(self._record.get('proof').get('predicted', math.nan))

    @property
    def widest_opening(self) -> float:
        """Opening at the open end of the joint, by the law [m]; NaN if unknown."""
        return max(map(self.law.law.gap, (self._plan.low, self._plan.high))) if self.law else math.nan

    def fits_closing(self) -> Fact:
        """Return whether the gripper is fit for closing by touch, with the numbers."""
        name, limit = 'fit for closing by touch', self._plan.force_limit
        counts = ', '.join(f'{way.value} {count.stopped} of {count.trials}' for way in (StopWay.CANCEL, StopWay.GOAL)
                           for count in [self.stop_count(way)])
        if not self.trials(StopWay.CANCEL) or not self.kept(StopWay.CANCEL).is_known:
            return Fact(name, 'unknown', Verdict.UNKNOWN, NOT_DONE)
        if self.stop_by is None:
            return Fact(name, 'no', Verdict.FAIL, f'no way to stop is reliable and keeps the force: {counts}')
        step, stiffness = self.step, self.stiffness
        if not (step.is_known and stiffness.is_known):
            missing = [each for each, found in (('step', step), ('stiffness', stiffness)) if not found.is_known]
            return Fact(name, 'unknown', Verdict.UNKNOWN, f'not known: {", ".join(missing)}')
        force = step.value * stiffness.value
        spread = 2 * math.hypot(step.deviation * stiffness.value, step.value * stiffness.deviation)
        numbers = f'step {1e3 * step.value:.3f} mm x stiffness {stiffness.value / 1e3:.2f} N/mm = {force:.2f} N'
        if force > limit + spread:
            return Fact(name, 'no', Verdict.FAIL, f'{numbers}, more than the force limit of {limit:g} N')
        if force > limit - spread:
            return Fact(name, 'unknown', Verdict.UNKNOWN, f'{numbers}, too close to the force limit of {limit:g} N')
        return Fact(name, 'yes', Verdict.PASS, f'{numbers}; stops: {counts}')

    # ---- the lines of the report ----

    @property
    def facts(self) -> list[Fact]:
        lines = []
        swapped = self.is_swapped
        lines.append(Fact('left pad', 'unknown', Verdict.UNKNOWN, NOT_DONE) if swapped is None else
                     Fact('left pad', f'topic {self.names[0]}/taxels', Verdict.PASS, ''))
        for number, name in enumerate(('left', 'right')):
            if not self.mountings:
                lines.append(Fact(f'{name} pad, mounting', 'unknown', Verdict.UNKNOWN, NOT_DONE))
                continue
            mounting = self.mountings[number]
            reason = 'mirrored_pads in the parameter file' if mounting.is_mirrored else ''
            lines.append(Fact(f'{name} pad, mounting', str(mounting), Verdict.PASS, reason))
            findings = self.taxels[number]
            faulty = [tuple(map(int, place)) for place in np.argwhere(findings == TaxelFinding.FAULTY)]
            unknown = int(np.count_nonzero(findings == TaxelFinding.UNKNOWN))
            lines.append(Fact(f'{name} pad, faulty taxels', str(faulty or 'none'), Verdict.PASS,
                              f'{unknown} taxels are unknown, because nothing pressed them'))
        for way in StopWay:
            count = self.stop_count(way)
            if not count.trials:
                lines.append(Fact(f'stop by {way.value}', 'unknown', Verdict.UNKNOWN, NOT_DONE))
                continue
            kept = self.kept(way)
            text = f'; keeps {100 * kept.value:.0f} % of the force on foam, at least {100 * KEPT_SHARE:.0f} % needed' \
                if kept.is_known else ''
            sure = f'; at least {100 * count.least_share:.0f} % with 95 % confidence' if count.is_reliable else ''
            fits = count.is_reliable and not (kept.is_known and kept.value < KEPT_SHARE)
            lines.append(Fact(f'stop by {way.value}', f'{count.stopped} of {count.trials} stopped',
                              Verdict.PASS if fits else Verdict.FAIL, f'all must stop{sure}{text}'))
        return [*lines, self.fits_closing()]

    @property
    def measurements(self) -> list[Measurement]:
        lines = []
        for pad, rest in zip(self._plan.pads, self.rests):
            name = f'{pad}/taxels'
            lines += [_limited(f'{name}, noise', rest.noise, 'N', MOST_NOISE),
                      _limited(f'{name}, drift in {DRIFT_TIME:g} s', rest.drift.scaled(DRIFT_TIME), 'N', MOST_DRIFT,
                               f'Wait until the pads are warm, and touch nothing. {REPEAT_REST}'),
                      _line(f'{name}, frame rate', Estimate(rest.rate, 0.0), 'Hz'),
                      _limited(f'{name}, lost frames', Estimate(rest.lost, 0.0), '1', MOST_LOST, 'Reduce the load of '
                               f'the machine, or give the driver a longer sync_period. {REPEAT_REST}')]
        law, no_law = self.law, self._no_law
        no_foam = '' if 'foam' in self._record else NOT_DONE
        lines += [_line('opening in the middle of the blocks', law.opening(law.middle) if law else NOT_MEASURED, 'm',
                        no_law),
                  _line('change of the opening per unit of the joint',
                        law.slope(law.middle) if law else NOT_MEASURED, f'm/{self._plan.unit}', no_law),
                  _line('speed', self.speed, 'm/s', NOT_DONE if law else no_law),
                  _line('step', self.step, 'm', no_law if 'step' in self._record else NOT_DONE),
                  _line('stiffness with a hard block', self.stiffness, 'N/m',
                        'too few stalls with a large force' if law else no_law),
                  _line('force per effort', self.effort_map.slope, 'N',
                        no_foam or 'too few efforts pressed with a force')]
        bounds = [('time from a command to the movement', self.start_latency, NOT_DONE),
                  *((f'time from a stop by {way.value} to standstill', self.stop_latency(way),
                     'a stop failed' if self.trials(way) else NOT_DONE) for way in (StopWay.CANCEL, StopWay.GOAL)),
                  ('latency: time from a force on a pad to standstill', self.latency, NOT_DONE)]
        lines += [_line(name, Estimate(bound, 0.0), 's', unknown, f'upper bound; at most {1e3 * MOST_LATENCY:g} ms',
                        fits=bound <= MOST_LATENCY) for name, bound, unknown in bounds]
        names = 'right pad, offset along x', 'right pad, offset along y', 'right pad, turn', 'tilt along x', \
            'tilt along y'
        lines += [_line(name, each, unit, no_law) for name, each, unit in zip(
            names, self.alignment or [NOT_MEASURED] * 5, ('m', 'm', 'rad', 'rad', 'rad'))]
        no_place = no_law if 'jig' in self._record else NOT_DONE if self._plan.jig else 'relative only, without a jig'
        names_in_jig = *(f'{axis} in the frame of the gripper' for axis in 'xyz'), 'turn against the jig', \
            'tilt along x against the jig', 'tilt along y against the jig'
        lines += [_line(f'left pad, {name}', each, unit, no_place) for name, each, unit in zip(
            names_in_jig, self.left_place or [NOT_MEASURED] * 6, ('m',) * 3 + ('rad',) * 3)]
        shift, no_shift = self.shift_per_load
        predicted, overs = self.predicted_overshoot, [close.overshoot for close in self.closes]
        return [*lines,
                _line('share of the force without commands', self.held, '1', no_foam or 'too few frames',
                      f'at least {HELD_SHARE:g}', fits=self.held.value >= HELD_SHARE),
                _line('shift per load', shift, 'm', no_shift),
                _line('largest overshoot of the closes', Estimate(max(overs, default=math.nan), 0.0), 'N',
                      self._record.get('proof').get('reason', NOT_DONE), f'predicted at most {predicted:.2f} N',
                      fits=max(overs, default=math.nan) <= predicted)]

    def allowed_speed(self, force: float) -> float:
        """Return the speed at which the predicted overshoot is ``force`` [m/s].

        The speed is NaN if it is not known, and 0 if the rounding of a stop alone may exceed ``force``.
        """
        if math.isnan(self.latency) or not self.stiffness.is_known:
            return math.nan
        rounding = self.rounding
        if math.isnan(rounding) or predict_overshoot(0.0, 0.0, self.stiffness.upper, rounding) > force:
            return math.nan if math.isnan(rounding) else 0.0
        return force / (self.stiffness.upper * self.latency)

    @property
    def rounding(self) -> float:
        """Distance by which a stop may round its goal [m]; 0 for a stop by cancel, NaN if unknown."""
        return 0.0 if self.stop_by is StopWay.CANCEL else self.step.value / 2

    @property
    def launched_law(self) -> tuple[float, float, str]:
        """Offset and scale of a linear law for the launch file, or NaN with the reason."""
        if not self.law:
            return math.nan, math.nan, 'the opening law is not known'
        chord, error = chord_error(self.law)
        if error > MOST_CHORD_ERROR:
            return math.nan, math.nan, (f'a linear law is wrong by {1e3 * error:.2f} mm between the blocks; '
                                        'use gap_source tf')
        return chord.offset, chord.scale, ''


def _line(name: str, estimate: Estimate, unit: str, unknown: str = NOT_DONE, limit: str = '', *,
          fits: bool = True) -> Measurement:
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
        return Measurement(name, NOT_MEASURED, unit, Verdict.UNKNOWN, unknown)
    return Measurement(name, estimate, unit, Verdict.PASS if fits else Verdict.FAIL, limit)


def _limited(name: str, estimate: Estimate, unit: str, limit: float, remedy: str = '') -> Measurement:
    """Return a line whose magnitude has an upper limit. A value above the limit gets the remedy."""
    fits = abs(estimate.value) <= limit
    reason = f'at most {limit:g} {unit}'.removesuffix(' 1')
    return _line(name, estimate, unit, limit=reason if fits or not remedy else f'{reason}. {remedy}', fits=fits)
