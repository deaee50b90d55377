"""Lead a person through the commissioning of a gripper with two pads, step by step.

Each step asks the person for something, moves the gripper with the person's consent, and stores its results. A mistake
stops the gripper, is explained, and repeats only the part in which the mistake was made. The procedure reads no clock
and knows no ROS: it talks to a `CommissionedGripper` and a `Person`.
"""

from collections.abc import Callable, Collection
from functools import partial
from typing import Any, TypeVar

import numpy as np

from tactile_node.commissioning import jig
from tactile_node.commissioning.block_grip import (
    BlockFace,
    BlockGrip,
    Stall,
    measure_faces,
    measure_grip,
    print_of,
    repair,
    stiffness_of,
)
from tactile_node.commissioning.commissioned_gripper import DIRECTIONS, Act, CommissionedGripper, Person, Question
from tactile_node.commissioning.commissioning_record import CommissioningRecord
from tactile_node.commissioning.evaluation import Evaluation
from tactile_node.commissioning.force import Close, map_effort, predict_overshoot, remaining_share, safe_force
from tactile_node.commissioning.guarded_gripper import REACT, SILENCE, TOUCHED, GuardedGripper, Move
from tactile_node.commissioning.lateral_shift import HungWeight, shift_of, shift_per_load
from tactile_node.commissioning.measurement import Estimate
from tactile_node.commissioning.mistake import Mistake, RefusedStepError
from tactile_node.commissioning.movement import (
    StopTrial,
    StopWay,
    measure_speed,
    measure_step,
    measure_stop,
)
from tactile_node.commissioning.pad_mounting import (
    PLACES,
    PadMounting,
    Press,
    check_two_pads,
    find_mounting,
    find_press,
    taxel_places,
)
from tactile_node.commissioning.pad_rest import measure_rest, was_touched
from tactile_node.commissioning.plan import CommissioningPlan, GaugeBlock
from tactile_node.commissioning.recording import JointStates, Recording
from tactile_node.commissioning.taxel_survey import TaxelFinding, survey

Result = TypeVar('Result')
PADS = 'left', 'right'
OPTIONAL = 'foam', 'block', 'jig', 'step', 'weight', 'proof'  #: Steps that may be left out. All blocks are one of them.
#: Steps whose results a step needs.
NEEDED = {'block': ('foam',), 'jig': ('foam', 'block'), 'weight': ('foam',), 'proof': ('foam', 'block')}
PAD_STEPS = 'rest', 'pads'  #: Steps that find the zero, the faulty taxels and the mountings of the pads.
REPEATS = 3             #: Number of attempts of each part of a step.
PRESS_TIME = 4.0        #: Duration of the recording of a press [s].
STROKE_TIME = 15.0      #: Duration of the recording in which the person presses everywhere [s].
FIRST_SHARE = 0.02      #: First movement, as a share of the travel.
FIRST_EFFORT = 0.01     #: First effort, as a share of the largest one.
EFFORT_FACTOR = 1.4     #: Factor between two efforts while the effort rises.
MOVING_FACTOR = 1.5     #: Effort of free movements, as a multiple of the smallest one that moves the gripper.
FREE_TIME = 4.0         #: Time in which a free movement covers the whole travel [s].
FREE_SHARE = 0.5        #: Share of the travel that free movements use, from the open end.
PROBE_SHARES = (0.08, 0.16)  #: Forces of the first two stalls on a block, as shares of the force limit.
STALLS = 7              #: Number of further stalls on a block.
DEPTH = 0.002           #: Depth to which these stalls press further into the skins, unless the force limits it [m].
STALL_TIME = 0.5        #: Duration of the recording of a stall [s].
FOAM_SHARE = 0.5        #: Force on the foam, as a share of the force limit.
FOAM_STALLS = 4         #: Smallest number of stalls on the foam.
LET_GO_TIME = 2.0       #: Time for which the force is watched after a stop on the foam [s].
FOAM_FACTOR = 1.2       #: Factor between two efforts on the foam.
SEEN_TIME = 0.1         #: Duration of the recording that reads the present position [s].
STOPPED_TIME = 1.2      #: Duration of the recording after a stop [s].
PHASES = 0.05           #: Range of the time before a command, so that the phase of the samples varies [s].
STEP_INCREMENT = 2.5e-5  #: Increment of the commands that find the step of the gripper [m].
STEP_RANGE = 6          #: Number of steps of the gripper over which the commands rise at most.
STEP_COMMANDS = 260     #: Largest number of these commands.
SETTLE = 0.2            #: Time between a command in small increments and its recording, in addition to the latency [s].
BACK = 0.002            #: Opening beyond the object before a close [m].
PROOF_FACTOR = 2.0      #: Force at which the gripper would stall, as a multiple of the force that stops a close.
SLOWEST = 2e-4          #: Slowest closing speed [m/s].
READING_NOISES = 3.0    #: Largest of some hundred readings, in deviations above their mean.
CLOSE_LIMIT = 90.0      #: Time allowed for a close [s].
SETTLED_FRAMES = 10     #: Number of frames from which the force after a close is averaged.
LOOSE_SHARE = 0.3       #: Share of the force below which the object was pulled out.
AGE_TIME = 5.0          #: Time over which the age of the frames is observed [s].
RATE_TIME = 2.0         #: Time over which the rate of the frames is compared with the record [s].
MOST_RATE_CHANGE = 0.1  #: Largest relative difference of the two rates.
PROMISED = 1.1          #: Force that is promised to the person, as a multiple of the force at which the foam step ends.
BLOCK_SHARE = 0.95      #: Largest commanded force on a block, as a share of the force limit. The pads may read more.

UPPER_ENDS = 'the following numbers are upper limits'  #: Part of the text of a series whose effort rises.

#: End of the request to hold an object.
UNTIL_HELD = '. After you have consented to the movements, keep holding it until the gripper grips it.'


def kind_of(step: str) -> str:
    """Return the name of a step without the width of a block."""
    return 'block' if step.startswith('block ') else step


class CommissioningProcedure:
    """The steps of a commissioning.

    Parameters
    ----------
    gripper, person
        The gripper with its pads, and the person beside it.
    plan : CommissioningPlan
        Properties of the gripper from its data sheet, and durations of the steps.
    record : CommissioningRecord
        Results of the steps. Finished steps are not repeated.
    on_step : callable
        Function that is called with the name of each step before the step begins.
    on_result : callable
        Function that is called with the name of each step after the step, and with the reason if the step has found
        nothing, or ''.
    """

    def __init__(self, gripper: CommissionedGripper, person: Person, plan: CommissioningPlan,
                 record: CommissioningRecord, on_step: Callable[[str], None] = lambda name: None,
                 on_result: Callable[[str, str], None] = lambda name, reason: None):
        self._gripper = GuardedGripper(gripper, person, plan)
        self._others, self._serial_numbers = gripper.others, gripper.serial_numbers
        self._person, self._plan, self._record = person, plan, record
        self._on_step, self._on_result = on_step, on_result
        self.refused: list[tuple[str, RefusedStepError]] = []  #: parts that were refused, with the reason
        self._gripper.noise = record.get('first movement').get('noise', self._gripper.noise)
        self._order: tuple[int, ...] = ()  # numbers of the left and the right pad
        self._places: tuple[np.ndarray, np.ndarray]
        self._recall_pads()

    @property
    def steps(self) -> dict[str, Callable[[], dict[str, Any]]]:
        """The steps by name, in their order."""
        return {'rest': self._rest, 'pads': self._pads, 'first movement': self._first_movement,
                'stops': self._stops, 'foam': self._foam,
                **{f'block {1e3 * block.width:g} mm': partial(self._block, block) for block in self._plan.blocks},
                **({'jig': self._jig} if self._plan.jig else {}),
                'step': self._step, 'weight': self._weight, 'proof': self._proof}

    def run(self, skip: Collection[str] = ()) -> None:
        """Carry out all steps that are not finished.

        Parameters
        ----------
        skip : collection of str
            Steps of OPTIONAL to leave out. A step that needs one of them is left out as well.

        Raises
        ------
        RefusedStepError
            Raised if a part of a step was refused REPEATS times. The results of the finished steps are kept.
        """
        if who := self._others():
            raise RefusedStepError('gripper', Mistake.OTHER_CLIENT, expected='no other client of the gripper', got=who,
                                   remedy='Stop touch_gripper and all other clients first.')
        if self._ask(Act.CONFIRM_STOP, 'The gripper will move. Is the emergency stop in your reach?',
                     ('yes', 'no')) != 'yes':
            raise RefusedStepError('gripper', Mistake.NO_CONSENT, expected='an emergency stop in reach', got='no',
                                   remedy='Put the emergency stop within your reach.')
        try:
            if 'rest' in self._record:
                self._attempt(self._check_rates)
            for name, step in self.steps.items():
                kind = kind_of(name)
                if name not in self._record and kind not in skip and self._has_finished(NEEDED.get(kind, ())):
                    self._on_step(name)
                    results = step()
                    if is_found := bool(results.keys() - {'reason'}):
                        self._record.save(name, results)
                    if kind in PAD_STEPS:
                        self._recall_pads()
                    self._on_result(name, '' if is_found else results['reason'])
        except BaseException:  # Ctrl-C stops the gripper as well
            self._gripper.stop()
            raise

    def unfinished(self, skip: Collection[str] = ()) -> list[str]:
        """Return the steps without results, except those that are skipped or that need a skipped step."""
        return [name for name in self.steps
                if name not in self._record and not {kind_of(name), *NEEDED.get(kind_of(name), ())} & set(skip)]

    def _check_rates(self) -> None:
        """Refuse to continue a record if the driver sends frames at another rate, on which the latencies depend."""
        recording = self._gripper.watch(RATE_TIME, 'rest', may_touch=True)
        for name, pad, rest in zip(self._plan.pads, recording.pads, self._found.rests):
            if abs(pad.rate / rest.rate - 1) > MOST_RATE_CHANGE:
                raise RefusedStepError(f'pad {name!r}', Mistake.OTHER_RATE, got=f'{pad.rate:.1f}',
                                       expected=f'{rest.rate:.1f} frames per second, as in the record',
                                       remedy='Start the driver with the settings of the record, or begin again in '
                                       'another folder.')

    def _has_finished(self, kinds: Collection[str]) -> bool:
        return all(name in self._record for name in self.steps if kind_of(name) in kinds)

    @property
    def _found(self) -> Evaluation:
        """Evaluation of the finished steps."""
        return Evaluation(self._record, self._plan)

    def _attempt(self, part: Callable[..., Result], *given: Any) -> Result:
        """Carry out a part of a step with the arguments ``given``, again after each mistake."""
        for attempt in range(REPEATS):
            try:
                return part(*given)
            except RefusedStepError as error:
                self._gripper.stop()
                self.refused.append((error.where, error))
                if attempt == REPEATS - 1 or error.mistake is Mistake.NO_CONSENT:
                    raise
                self._ask(Act.REPEAT, str(error))
        raise AssertionError('a part is either carried out or refused')

    def _ask(self, act: Act, text: str, choices: tuple[str, ...] = ('done',), *, pad: str = '', place: str = '',
             width: float = 0.0) -> str:
        return self._person.ask(Question(act, text, choices, pad, place, width))

    # ---- the pads ----

    def _rest(self) -> dict[str, Any]:
        self._ask(Act.LEAVE, f'Do not touch the pads for {self._plan.rest_time:g} s.')
        recording = self._attempt(self._record_rest)
        age = self._gripper.age_of_frames(AGE_TIME)
        found = [measure_rest(pad) for pad in recording.pads]
        if None in found:
            raise RefusedStepError('rest', Mistake.PADS_SILENT, expected='frames of both pads', got='too few',
                                   remedy='Check the driver of the skin.')
        return {'pads': [each._asdict() for each in found if each], 'age': age,
                'serial_numbers': self._serial_numbers()}

    def _record_rest(self) -> Recording:
        recording = self._record_pads(self._plan.rest_time, 'rest')
        for name, pad in zip(self._plan.pads, recording.pads):
            if was_touched(pad):
                raise RefusedStepError('rest', Mistake.HAND_BETWEEN, expected='untouched pads', got=f'a touch on the '
                                       f'pad {name!r}', remedy='Leave the pads alone until the step has ended.')
        return recording

    def _pads(self) -> dict[str, Any]:
        (left, first), (right, second) = self._attempt(self._press_both)
        strokes = [self._stroke(pad) for pad in PADS]
        findings = {pad: survey([each.pads[pad].forces for each in strokes]) for pad in (0, 1)}
        return {'order': [left, right], 'mountings': [first, second],
                'taxels': [findings[pad] for pad in (left, right)]}

    def _press_both(self) -> tuple[tuple[int, PadMounting], tuple[int, PadMounting]]:
        left, right = (self._attempt(self._press_pad, pad) for pad in PADS)
        check_two_pads(left[0], right[0])
        return left, right

    def _press_pad(self, pad: str) -> tuple[int, PadMounting]:
        presses = [self._attempt(self._press, pad, place) for place in PLACES]
        return find_mounting(presses, f'presses on the {pad} pad')

    def _press(self, pad: str, place: str) -> Press:
        self._ask(Act.PRESS, f'Hold the {pad} pad with the fingertip up, look at its skin, and press the {place} for '
                  f'2 s.', pad=pad, place=place)
        recording = self._gripper.watch(PRESS_TIME, f'press on the {pad} pad', may_touch=True)
        return find_press(recording.pads, f'press on the {pad} pad, {place}')

    def _stroke(self, pad: str) -> Recording:
        self._ask(Act.STROKE, f'Press everywhere on the {pad} pad for {STROKE_TIME:g} s.', pad=pad)
        return self._attempt(self._record_pads, STROKE_TIME, f'{pad} pad')

    def _record_pads(self, seconds: float, where: str) -> Recording:
        return self._gripper.watch(seconds, where, may_touch=True)

    def _recall_pads(self) -> None:
        """Take the zero, the faulty taxels and the mountings from the record."""
        found = self._found
        if found.mountings:
            self._order = (1, 0) if found.is_swapped else (0, 1)
            left, right = (taxel_places(self._plan.grid, each) for each in found.mountings)
            self._places = left, right
            for pad, taxels in zip(self._order, found.taxels):
                self._gripper.is_faulty[pad] = taxels == TaxelFinding.FAULTY
        if found.rests:
            self._gripper.zero = np.array([rest.zero for rest in found.rests])

    def _images(self, recording: Recording) -> tuple[np.ndarray, np.ndarray]:
        """Return the mean force on each taxel of the left and of the right pad [N]."""
        left, right = (repair(recording.pads[pad].mean, self._gripper.is_faulty[pad]) for pad in self._order)
        return left, right

    def _force_of(self, recording: Recording) -> list[np.ndarray]:
        """Return the force on the left and on the right pad in each of their frames [N]."""
        return [np.nansum(recording.pads[pad].forces, axis=(1, 2)) for pad in self._order]

    # ---- free movements ----

    def _first_movement(self) -> dict[str, Any]:
        self._clear('first movement')
        noise = self._gripper.measure_noise('first movement')
        effort, opens_rising = self._attempt(self._move_and_return)
        return {'noise': noise, 'effort': effort, 'opens_rising': opens_rising}

    def _move_and_return(self) -> tuple[float, bool]:
        """Return the smallest effort that moves the gripper both ways, and True if the reading rises as it opens.

        All later movements depend on the direction. The person therefore names it twice, and a slip of the hand shows.
        """
        start, way = self._gripper.reading, FIRST_SHARE * self._plan.travel
        is_rising = start < (self._plan.low + self._plan.high) / 2
        away = Move(start + way if is_rising else start - way, FIRST_EFFORT * self._plan.most_effort,
                    self._plan.travel / FREE_TIME / 10)
        self._gripper.consent(f'first movement{self._to(away.position)} and the way back, with an effort that rises, '
                              f'at most to {self._plan.most_effort:g}', away, TOUCHED, 2)
        effort = self._smallest_effort(away)
        answer = self._ask(Act.DIRECTION, 'How have the fingers moved?', DIRECTIONS)
        effort = self._smallest_effort(away._replace(position=start, effort=effort))
        back = self._ask(Act.DIRECTION, 'The gripper has moved back. How have the fingers moved this time?',
                         DIRECTIONS)
        if answer == back == 'not moved':
            raise RefusedStepError('first movement', Mistake.OTHER_JOINT, expected='fingers that move with the joint',
                                   got='a joint that moves alone', remedy='Give the name of the joint of the gripper.')
        if {answer, back} != {'opened', 'closed'}:
            raise RefusedStepError('first movement', Mistake.WRONG_DIRECTION, got=f'"{answer}", then "{back}"',
                                   expected='"opened" and "closed", because the gripper has moved there and back',
                                   remedy='Watch the fingers, and answer again.')
        return effort, (answer == 'opened') == is_rising

    def _smallest_effort(self, move: Move) -> float:
        """Raise the effort until the gripper moves, and return the effort."""
        start, effort = self._gripper.reading, move.effort
        while effort <= self._plan.most_effort:
            self._gripper.command(move._replace(effort=effort))
            self._gripper.watch(1.0, 'first movement', may_touch=False)
            if abs(self._gripper.reading - start) > abs(move.position - start) / 4:
                self._gripper.watch(2.0, 'first movement', may_touch=False)
                return effort
            effort *= EFFORT_FACTOR
        raise self._gripper.stuck('first movement')

    @property
    def _open_end(self) -> float:
        return self._plan.high if self._found.opens_rising else self._plan.low

    @property
    def _closed_end(self) -> float:
        return self._plan.low if self._found.opens_rising else self._plan.high

    @property
    def _effort(self) -> float:
        """Effort of free movements."""
        return min(MOVING_FACTOR * self._record['first movement']['effort'], self._plan.most_effort)

    @property
    def _towards(self) -> float:
        """Sign of the change of the reading when the gripper closes."""
        return float(np.sign(self._closed_end - self._open_end))

    def _to(self, position: float) -> str:
        """Return the target of a movement for the text of a series."""
        return f' to {position:.3g} {self._plan.unit}'

    def _free(self, position: float) -> Move:
        return Move(position, self._effort, self._plan.travel / FREE_TIME)

    def _closing(self, effort: float) -> Move:
        return Move(self._closed_end, effort, self._plan.travel / FREE_TIME)

    def _stop_by(self, way: StopWay, move: Move) -> None:
        """Stop the movement ``move`` in one way."""
        if way is StopWay.CANCEL:
            self._gripper.cancel()
        else:
            position = self._gripper.reading if way is StopWay.GOAL else self._open_end
            self._gripper.command(move._replace(position=position))

    def _stops(self) -> dict[str, Any]:
        target = self._open_end + FREE_SHARE * (self._closed_end - self._open_end)
        self._clear('stops')
        self._gripper.consent(f'stops, back and forth between {self._open_end:.3g} and {target:.3g} {self._plan.unit}',
                              self._free(target), TOUCHED, 6 * self._plan.stop_trials)
        results: dict[str, Any] = {'trials': {}}
        movements: list[JointStates] = []
        for way in StopWay:
            trials = []
            for number in range(self._plan.stop_trials):
                trial, movement = self._attempt(self._stop_trial, way, number, target)
                trials.append(trial)
                movements.append(movement)
            results['trials'][way.value] = trials
        results['speed'] = measure_speed(movements, self._gripper.noise)
        results['period'] = float(np.median(np.diff(movements[0].times)))
        return results

    def _stop_trial(self, way: StopWay, number: int, target: float) -> tuple[StopTrial, JointStates]:
        """Return the outcome of one stop, and the movement back to the open end."""
        movement = self._gripper.move(self._free(self._open_end), 'stops').joint
        phase = (number * 0.618) % 1  # the phase of the samples differs between trials
        before = self._gripper.watch(0.2 + PHASES * phase, 'stops', may_touch=False)
        commanded = self._gripper.now()
        start = self._gripper.reading
        self._gripper.command(self._free(target))
        share = 0.2 + 0.2 * phase
        moving = self._gripper.watch(3.0, 'stops', may_touch=False, tick=0.003, is_over=lambda part: abs(
            self._gripper.reading - start) > share * abs(target - start))
        if abs(self._gripper.reading - start) <= share * abs(target - start):
            raise self._gripper.stuck('stops')
        stopped = self._gripper.now()
        self._stop_by(way, self._free(target))
        after = self._gripper.watch(STOPPED_TIME + FREE_TIME * FREE_SHARE, 'stops', may_touch=False)
        joint = JointStates(*(np.concatenate(each) for each in zip(before.joint, moving.joint, after.joint)))
        return measure_stop(joint, commanded, stopped, target, self._gripper.noise), movement

    def _step(self) -> dict[str, Any]:
        """Command small increments, at rest after each, and find the levels at which the gripper stays.

        The results are only a reason if the levels cannot be distinguished.
        """
        self._clear('step')
        law = self._found.law
        middle = law.middle if law else (self._plan.low + self._plan.high) / 2
        increment = STEP_INCREMENT / abs(law.slope(middle).value) if law else 0.0003 * self._plan.travel
        self._gripper.consent(f'small steps, after a movement{self._to(middle)} ({UPPER_ENDS})', self._free(middle),
                              TOUCHED, STEP_COMMANDS)
        self._attempt(self._gripper.move, self._free(middle), 'step')
        settling = self._found.start_latency + SETTLE  # time after which a small movement has ended [s]
        commanded, reached = [], []
        for number in range(STEP_COMMANDS):
            commanded.append(middle + number * increment)
            self._gripper.command(self._free(commanded[-1]))
            self._gripper.watch(settling, 'step', may_touch=False)
            joint = self._gripper.watch(0.15, 'step', may_touch=False).joint
            if not joint.times.size:  # wait for a joint state; the guard refuses a longer silence
                joint = self._gripper.watch(2 * SILENCE, 'step', may_touch=False,
                                            is_over=lambda part: part.joint.times.size > 0).joint
            reached.append(float(joint.positions.mean()))
            if number > 20 and abs(reached[-1] - reached[0]) > STEP_RANGE * self._largest_jump(reached):
                break
        found = measure_step(np.array(commanded), np.array(reached), self._gripper.noise / 3)
        return {'step': found, 'at': middle, 'increment': increment} if found.is_known else {
            'reason': 'the levels at which the gripper stays cannot be distinguished'}

    def _largest_jump(self, reached: list[float]) -> float:
        return max(float(np.abs(np.diff(reached)).max()), 8 * self._gripper.noise)

    # ---- forces ----

    def _clear(self, where: str) -> None:
        """Open the gripper, and measure the zero again after everything was taken out."""
        if 'first movement' in self._record:  # a gripper that holds an object would snap shut
            self._attempt(self._open, where)
        self._ask(Act.CLEAR, 'Take everything out of the gripper, and keep away from the pads.')
        self._attempt(self._gripper.renew_zero, where)

    def _open(self, where: str) -> None:
        opening = self._free(self._open_end)
        self._gripper.watch(SEEN_TIME, where, may_touch=True)
        if abs(self._gripper.reading - self._open_end) > FIRST_SHARE * self._plan.travel:
            self._gripper.consent(f'opening{self._to(opening.position)} (hold what is between the pads)', opening,
                                  TOUCHED, 1)
        self._gripper.move(opening, where, may_touch=True)

    def _insert(self, act: Act, text: str, width: float = 0.0) -> None:
        where = act.value
        self._clear(where)
        self._ask(act, text, width=width)

    def _stall(self, effort: float, where: str) -> Stall:
        """Close with an effort until the gripper stalls, and record it at rest."""
        self._gripper.move(self._closing(effort), where, may_touch=True)
        recording = self._gripper.watch(STALL_TIME, where, may_touch=True)
        return Stall(effort, float(recording.joint.positions.mean()), self._images(recording))

    def _foam(self) -> dict[str, Any]:
        stalls = self._attempt(self._squeeze)
        effort = stalls[-1].effort
        kept = {way.value: self._attempt(self._remaining_share, effort, LET_GO_TIME, way)
                for way in (StopWay.CANCEL, StopWay.GOAL)}
        held = self._attempt(self._remaining_share, effort, self._plan.hold_time)
        return {'efforts': [stall.effort for stall in stalls], 'forces': [stall.force for stall in stalls],
                'stiffness': stiffness_of(stalls), 'kept': kept, 'held': held}

    def _squeeze(self) -> list[Stall]:
        """Let the person insert the foam, and return the stalls on the foam at rising efforts."""
        goal = FOAM_SHARE * self._plan.force_limit
        effort = self._record['first movement']['effort']
        self._insert(Act.FOAM, f'Hold the foam between the pads{UNTIL_HELD}')
        rises = np.log(self._plan.most_effort / effort) / np.log(FOAM_FACTOR)
        self._gripper.consent(f'foam, closing{self._to(self._closed_end)} with rising effort ({UPPER_ENDS})',
                              self._closing(self._plan.most_effort), PROMISED * goal, int(rises) + 5)
        stalls: list[Stall] = []
        while effort <= self._plan.most_effort:
            stalls.append(self._stall(effort, 'foam'))
            if abs(stalls[-1].reading - self._closed_end) < FIRST_SHARE * self._plan.travel:
                raise RefusedStepError('foam', Mistake.BLOCK_MISSING, expected='foam that holds the gripper open',
                                       got='a closed gripper', remedy='Hold stiffer or thicker foam between the pads.')
            if stalls[-1].force >= goal and len(stalls) >= FOAM_STALLS:
                return stalls
            known = map_effort([stall.effort for stall in stalls], [stall.force for stall in stalls])
            rise = known.effort(1.05 * goal) / effort if known.is_known else FOAM_FACTOR
            effort *= min(max(rise, 1.05), FOAM_FACTOR)
        if not stalls or stalls[-1].force < TOUCHED:
            raise RefusedStepError('foam', Mistake.BLOCK_MISSING, expected='a force on both pads', got='none',
                                   remedy='Hold the foam between the pads.')
        return stalls

    def _remaining_share(self, effort: float, seconds: float, way: StopWay | None = None) -> Estimate:
        """Return the share of the force on the foam that is left after a stop, or without commands."""
        self._stall(effort, 'foam')
        before = self._gripper.watch(STALL_TIME, 'foam', may_touch=True)
        ended = self._gripper.now()
        if way is not None:
            self._stop_by(way, self._closing(effort))
        after = self._gripper.watch(seconds, 'foam', may_touch=True)
        pad = self._order[0]
        times = np.concatenate((before.pads[pad].times, after.pads[pad].times))
        forces = np.concatenate([self._force_of(each)[0] for each in (before, after)])
        taxels = self._plan.grid.rows * self._plan.grid.cols
        drift = abs(self._found.rests[pad].drift.value) * taxels * (times[-1] - times[0])
        return remaining_share(times, forces, ended, drift)

    # ---- blocks ----

    def _effort_for(self, force: float) -> float:
        """Return the effort that presses with a force on a pad, by the map from the foam."""
        foam = self._record['foam']
        known = map_effort(foam['efforts'], foam['forces'])
        if not known.is_known:
            raise RefusedStepError('foam', Mistake.BLOCK_MISSING, expected='a force that rises with the effort',
                                   got='another one', remedy='Repeat the foam with another record.')
        return min(max(known.effort(force), self._record['first movement']['effort']), self._plan.most_effort)

    @property
    def _middle_block(self) -> GaugeBlock:
        return self._plan.blocks[len(self._plan.blocks) // 2]

    @property
    def _middle_grip(self) -> BlockGrip:
        return self._found.grips[len(self._plan.blocks) // 2]

    @property
    def _rough_metres(self) -> float:
        """Change of the opening per unit of the reading, assuming that the travel spans the widest block twice."""
        widest = max(block.width for block in self._plan.blocks)
        return -self._towards * 2 * widest / self._plan.travel

    def _block(self, block: GaugeBlock) -> dict[str, Any]:
        return self._attempt(self._grip, block)._asdict()

    def _grip(self, block: GaugeBlock) -> BlockGrip:
        stalls = self._press_block(block, Act.BLOCK, f'Hold the block of {1e3 * block.width:g} mm freely between the '
                                   f'pads{UNTIL_HELD}')
        return measure_grip(stalls, self._places, block.width, block.length, self._rough_metres)

    def _press_block(self, block: GaugeBlock, act: Act, text: str) -> list[Stall]:
        """Let the person insert a block, and return the stalls on the block at rising efforts."""
        where = f'block of {1e3 * block.width:g} mm'
        self._insert(act, text, block.width)
        limit = self._plan.force_limit
        move = self._closing(self._effort_for(limit))
        self._gripper.consent(f'{where}, closing{self._to(move.position)} with rising effort ({UPPER_ENDS})', move,
                              limit, len(PROBE_SHARES) + STALLS)
        stalls = [self._held_stall(self._effort_for(share * limit), where) for share in PROBE_SHARES]
        first, second = stalls[-2:]
        closed = max(abs(second.reading - first.reading), self._gripper.noise) * abs(self._rough_metres)
        work = second.force + abs(second.force - first.force) / closed * DEPTH
        foam = self._record['foam']
        most = min(BLOCK_SHARE * limit, safe_force(foam['efforts'], foam['forces'], limit), work)
        for force in np.linspace(second.force, most, STALLS + 1)[1:]:
            stalls.append(self._held_stall(self._effort_for(float(force)), where))
            if stalls[-1].force > limit:
                break
        return stalls

    def _held_stall(self, effort: float, where: str) -> Stall:
        """Return a stall against the block, which must be there."""
        stall = self._stall(effort, where)
        if stall.force < TOUCHED:
            raise RefusedStepError(where, Mistake.BLOCK_MISSING, expected='a force on both pads', got='none',
                                   remedy='Hold the block between the pads until the gripper grips it.')
        return stall

    def _jig(self) -> dict[str, Any]:
        faces = self._attempt(self._grip_jig)
        stated = ', '.join(f'{1e3 * each:.1f}' for each in self._plan.jig[:3])
        self._ask(Act.MEASURE, 'While the gripper holds the block, measure where its centre lies along the closing '
                  f'direction. --jig states the place {stated} mm in the frame of the gripper. If the centre lies '
                  'elsewhere, start the command again later with the measured place.')
        return {'faces': faces}

    def _grip_jig(self) -> tuple[BlockFace, BlockFace]:
        """Return the faces of the block in the jig on both pads."""
        block = self._plan.jig_block
        stalls = self._press_block(block, Act.JIG, f'Put the block of {1e3 * block.width:g} mm into the jig. Hold the '
                                   'face A against the palm, and the faces B and C at their places beside it. Hold the '
                                   'block on the floor of the groove with a finger on its top, away from the pads.')
        measure_grip(stalls, self._places, block.width, block.length, self._rough_metres, jig.MOST_SKEW)
        faces = measure_faces(stalls, self._places)
        jig.check_jig(faces)
        return faces

    def _weight(self) -> dict[str, Any]:
        return {'grips': [hung._asdict() for hung in self._attempt(self._weigh)]}

    def _weigh(self) -> list[HungWeight]:
        found = [self._attempt(self._hang) for _ in range(self._plan.shift_grips)]
        shift, reason = shift_per_load([self._shift(hung) for hung in found])
        if not shift.is_known:
            raise RefusedStepError('weight', Mistake.BLOCK_SLID, expected='two grips that agree', got=reason,
                                   remedy='Hang the weight without a jerk, below the middle of the object.')
        return found

    def _shift(self, hung: HungWeight) -> float:
        return shift_of(hung, self._plan.weight, self._plan.down)

    def _hang(self) -> HungWeight:
        self._insert(Act.OBJECT, 'Hold the block between the pads, in the orientation of use.',
                     self._middle_block.width)
        effort = self._effort_for(self._plan.weight)
        move = self._closing(effort)
        self._gripper.consent(f'grip for the weight, closing{self._to(move.position)}', move, self._plan.force_limit, 1)
        before = self._held_stall(effort, 'weight')
        self._ask(Act.WEIGHT, f'Hang the weight of {self._plan.weight:g} N on the object.')
        recording = self._gripper.watch(STALL_TIME, 'weight', may_touch=True)
        loaded = Stall(before.effort, before.reading, self._images(recording))
        first, second = ((print_of(each.images[0], self._places[0]), print_of(each.images[1], self._places[1]))
                         for each in (before, loaded))
        hung = HungWeight(first, second, loaded.forces)
        self._shift(hung)  # refuses a weight that does not hang
        return hung

    # ---- proof ----

    def _proof(self) -> dict[str, Any]:
        """Close ten times until the pads read a force."""
        found = self._found
        law, way = found.law, found.stop_by
        if law is None or way is None:
            return {'closes': [], 'reason': 'the opening is not known' if law is None else 'no way to stop is reliable'}
        block, grip = self._middle_block, self._middle_grip
        slope = abs(law.slope(grip.onset.value).value)
        stiffness = found.stiffness_at(grip).upper
        speed = max(SLOWEST, min(self._plan.overshoot / (found.latency * stiffness), found.speed.value))
        predicted = predict_overshoot(found.latency, speed, stiffness, found.rounding) + self._reading_error
        self._insert(Act.OBJECT, f'Hold the block of {1e3 * block.width:g} mm between the pads{UNTIL_HELD}',
                     block.width)
        start = grip.onset.value - self._towards * BACK / slope
        move = Move(self._closed_end, self._effort_for(PROOF_FACTOR * self._plan.touch_force), speed / slope)
        self._gripper.consent(f'proof, closing{self._to(move.position)} until a pad reads {self._plan.touch_force:g} N',
                              move, self._plan.touch_force + predicted, self._plan.closes)
        closes = [self._attempt(self._close, move, start, way, grip) for _ in range(self._plan.closes)]
        return {'closes': closes, 'speed': speed, 'predicted': predicted, 'reason': ''}

    @property
    def _reading_error(self) -> float:
        """Noise by which the largest of several force readings exceeds the true force [N]."""
        noise = max(rest.noise.value for rest in self._found.rests)
        return READING_NOISES * noise * float(np.sqrt(self._plan.grid.rows * self._plan.grid.cols))

    def _close(self, move: Move, start: float, way: StopWay, grip: BlockGrip) -> Close:
        self._gripper.move(self._free(start)._replace(effort=move.effort), 'proof', may_touch=True)
        self._gripper.command(move)
        limit = self._plan.touch_force
        strongest = 0.0

        def is_reached(part: Recording) -> bool:
            nonlocal strongest
            strongest = max(strongest, *(float(each.max(initial=0.0)) for each in self._force_of(part)))
            return strongest >= limit
        self._gripper.watch(CLOSE_LIMIT, 'proof', may_touch=True, tick=REACT, is_over=is_reached)
        if strongest < limit:
            raise self._pulled_out()
        due = self._gripper.now()
        self._stop_by(way, move)
        after = self._gripper.watch(STOPPED_TIME, 'proof', may_touch=True)
        forces = self._force_of(after)
        peak = max((0, 1), key=lambda number: forces[number].max())
        largest = int(np.argmax(forces[peak]))
        held = grip.stiffness.value * self._towards * (self._gripper.reading - grip.onset.value)  # force of the block
        if forces[peak][-1] < LOOSE_SHARE * min(held, limit):
            raise self._pulled_out()
        left, right = (float(each[-SETTLED_FRAMES:].mean()) for each in forces)
        return Close(float(forces[peak][largest]) - limit,
                     float(after.pads[self._order[peak]].times[largest]) - due, (left, right))

    def _pulled_out(self) -> RefusedStepError:
        return RefusedStepError('proof', Mistake.PULLED_OUT, expected='an object between the pads', got='no force',
                                remedy='Put the object back, and leave it there.')
