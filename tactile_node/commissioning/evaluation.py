"""Turn the record of a commissioning into measured values.

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
from tactile_node.commissioning.measurement import NOT_MEASURED, Estimate
from tactile_node.commissioning.movement import StopTrial, StopWay, TriedStop, stop_latency, upper_bound
from tactile_node.commissioning.opening_law import OpeningLaw, chord_error, find_law
from tactile_node.commissioning.pad_alignment import PadAlignment, find_alignment
from tactile_node.commissioning.pad_mounting import PadMounting
from tactile_node.commissioning.pad_rest import PadRest
from tactile_node.commissioning.plan import CommissioningPlan

KEPT_SHARE = 0.7        #: Share of the force on foam that must remain after a stop.
MOST_CHORD_ERROR = 2e-4  #: Largest error of a linear law that stands for a knuckle [m].
LEAST_FORCE_ERROR = 0.005  #: Relative error of the force that both pads may share.


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
        self.record, self.plan = record, plan

    # ---- pads ----

    @property
    def is_swapped(self) -> bool | None:
        """True if the driver's first pad is the right one; None if unknown."""
        order = self.record['pads'].get('order')
        return None if order is None else order == [1, 0]

    @property
    def names(self) -> list[str]:
        """Names of the left and the right pad in the driver; empty if unknown."""
        return [self.plan.pads[pad] for pad in self.record['pads'].get('order', [])]

    @property
    def mountings(self) -> list[PadMounting]:
        """How the left and the right pad are mounted; empty if unknown."""
        return [PadMounting(*each) for each in self.record['pads'].get('mountings', [])]

    @property
    def taxels(self) -> list[np.ndarray]:
        """TaxelFinding of each taxel of the left and the right pad; empty if unknown."""
        return [np.array(each) for each in self.record['pads'].get('taxels', [])]

    @cached_property
    def rests(self) -> list[PadRest]:
        """Properties of the untouched pads, in the order of the driver; empty if unknown."""
        return [rest_from(each) for each in self.record['rest'].get('pads', [])]

    @property
    def driver_pads(self) -> list[DriverPad]:
        """The pads in the order of the driver. The record needs the steps `rest` and `pads`."""
        order = self.record['pads']['order']
        return [DriverPad(rest, self.mountings[order.index(pad)], self.taxels[order.index(pad)], serial_number)
                for pad, (rest, serial_number) in enumerate(zip(self.rests, self.record.serial_numbers))]

    # ---- gripper ----

    @property
    def opens_rising(self) -> bool:
        """True if the reading of the joint rises as the gripper opens. The record needs the step `first movement`."""
        return bool(self.record['first movement']['opens_rising'])

    @cached_property
    def grips(self) -> list[BlockGrip]:
        return [grip_from(content) for name, content in self.record.items() if name.startswith('block ')]

    @cached_property
    def law(self) -> OpeningLaw | None:
        return find_law([grip.onset for grip in self.grips], [grip.width for grip in self.grips],
                        is_angle=self.plan.unit == 'rad')

    def tried(self, way: StopWay) -> TriedStop:
        """Return what is known about one way to stop.

        Without the step `stops`, there are no trials. Without the step `foam`, the kept share is not known.
        """
        trials = self.record['stops'].get('trials', {}).get(way.value, [])
        kept = self.record['foam'].get('kept', {}).get(way.value, NOT_MEASURED)
        return TriedStop(tuple(StopTrial(*each) for each in trials), Estimate(*kept))

    @property
    def stop_by(self) -> StopWay | None:
        """The way to stop for touch_gripper: it never failed, and does not let go. None if there is none."""
        return next((way for way in (StopWay.CANCEL, StopWay.GOAL) if self.tried(way).is_reliable
                     and self.tried(way).kept.value >= KEPT_SHARE), None)

    @property
    def held(self) -> Estimate:
        """Share of the force on foam that remains without commands."""
        return Estimate(*self.record['foam'].get('held', NOT_MEASURED))

    @property
    def period(self) -> float:
        """Period of the joint states [s]; NaN if unknown."""
        return float(self.record['stops'].get('period', math.nan))

    @property
    def joint_speed(self) -> Estimate:
        """Speed of the joint in a free movement [reading/s]."""
        return Estimate(*self.record['stops'].get('speed', NOT_MEASURED))

    @property
    def start_latency(self) -> float:
        """Upper bound of the time from a command to the movement [s]."""
        started = [trial.started for way in StopWay for trial in self.tried(way).trials]
        return upper_bound(started, self.period) if started else math.nan

    def stop_latency(self, way: StopWay) -> float:
        """Return the upper bound of the time from a stop to standstill [s]."""
        trials = self.tried(way).trials
        if not trials:
            return math.nan
        return stop_latency(trials, self.period, self.record['first movement']['noise'],
                            self.joint_speed.value)

    @property
    def latency(self) -> float:
        """Upper bound of the time from a force on a pad to standstill, for the way to stop [s]."""
        if self.stop_by is None or 'rest' not in self.record:
            return math.nan
        return float(self.record['rest']['age']) + self.stop_latency(self.stop_by)

    @property
    def speed(self) -> Estimate:
        """Speed of the pads in a free movement [m/s]."""
        return self.law.speed(self.law.middle, self.joint_speed) if self.law else NOT_MEASURED

    @property
    def step(self) -> Estimate:
        """Smallest change of the opening [m]."""
        if not self.law or 'step' not in self.record:
            return NOT_MEASURED
        return self.law.speed(self.record['step']['at'], Estimate(*self.record['step']['step']))

    def stiffness_at(self, grip: BlockGrip) -> Estimate:
        """Return the force per change of the opening in a grip [N/m]."""
        if not self.law:
            return NOT_MEASURED
        stiffness = grip.stiffness.scaled(1 / abs(self.law.slope(grip.onset.value).value))
        return stiffness.with_error(stiffness.value * self.force_error)

    @property
    def stiffness(self) -> Estimate:
        """Stiffness of the pads with the block of the longest face, which is the stiffest [N/m]."""
        longest = max(self.plan.blocks, key=lambda block: block.length)
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
        foam = self.record['foam']
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
        if self.law is None or self.alignment is None or not (self.plan.jig and 'jig' in self.record):
            return None
        reading = next(grip.onset.value for grip in self.grips if grip.width == self.plan.jig_block.width)
        return place_left_pad(faces_from(self.record['jig']), self.law.slope(reading).value, self.alignment,
                              self.plan.jig)

    @property
    def shift_per_load(self) -> tuple[Estimate, str]:
        """Shift of a contact per load, and the reason if it is not known [m]."""
        hung = [hung_from(each) for each in self.record['weight'].get('grips', [])]
        return shift_per_load([shift_of(each, self.plan.weight, self.plan.down) for each in hung])

    @property
    def closes(self) -> list[Close]:
        return [Close(*each) for each in self.record['proof'].get('closes', [])]

    @property
    def predicted_overshoot(self) -> float:
        """Largest overshoot that was predicted for the closes [N]; NaN without closes."""
        return float(self.record['proof'].get('predicted', math.nan))

    @property
    def widest_opening(self) -> float:
        """Opening at the open end of the joint, by the law [m]; NaN if unknown."""
        if not self.law:
            return math.nan
        return max(self.law.opening(end).value for end in (self.plan.low, self.plan.high))

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
