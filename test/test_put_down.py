"""The rules that watch a held object while an arm lowers it, in virtual time.

A simulated object is held by two pads with 2 mm pitch. Who could be misled by a wrong SOMETHING_TOUCHES? A planner that
opens the gripper because of it. When? While the arm still carries the object high above the table. The worst
consequence: the object falls from there. The first test therefore disturbs a planner in the air in each way that we
know, and counts the openings.
"""

import math
from itertools import count

import numpy as np
import pytest
from put_down_world import STIFFNESS, Descent, Hand

from tactile_node.grasp.tracker import GraspContact
from tactile_node.gripper.rules.closing import LOST_AFTER
from tactile_node.gripper.rules.put_down import (
    BASELINE_TIME,
    BLIND_TIME,
    LASTING,
    START_TIME,
    HeldContact,
    HeldReading,
    PutDown,
    PutDownOutcome,
    Sign,
)
from tactile_node.shape.methods import make_recogniser
from training.ground_truth.seeds import Purpose, generator

PERIOD = 0.02     # Period of the frames [s].
LOOK = 0.01       # Time between two looks [s].
AGE = 0.03        # Age of a reading when it arrives [s].
PITCH = 0.002     # m
NOISE = 7e-5      # Standard deviation of the centre of pressure on the pads of put_down_world.py [m].
FORCE = 5.0       # N
FORCE_NOISE = 0.04  # N
MAX_AGE = 0.15    # s
TIMEOUT = 10.0    # s
AFTER = BASELINE_TIME + 1.0  # Time at which a disturbance begins [s].
NOTHING = {'shift': 0.0, 'force': 0.0, 'angle': 0.0}


class Planner:
    """An arm with a held object, and a planner that opens the gripper if, and only if, something touches the object.

    Parameters
    ----------
    world : callable
        Function that returns the changes of the reading at a time: the shift [m], the changes of force [N] and angle
        [rad], or any field of HeldReading. It returns None if no frame is acquired.
    is_resting : callable
        Function that returns True if the gripper is at rest at a time.
    """

    def __init__(self, world, is_resting=lambda time: True, *, seed=0, angle=0.4, period=PERIOD):
        self._world, self._is_resting, self._period = world, is_resting, period
        self._angle, self._rng, self._numbers = angle, np.random.default_rng(seed), count(1)
        self.has_opened, self.ended = False, math.nan
        self.rules = PutDown(0.0, TIMEOUT, MAX_AGE)

    def put_down(self):
        """Return the outcome of a goal that begins at the time 0."""
        arriving, latest, acquired = [], HeldReading(-math.inf, GraspContact.NOT_KNOWN), 0.0
        for step in count():
            now = step * LOOK
            if now >= acquired - 1e-9:
                reading = self._reading(acquired)
                arriving += [] if reading is None else [reading]
                acquired += self._period
            while arriving and arriving[0].acquired <= now - AGE:
                latest = arriving.pop(0)
            outcome = self.rules.look(now, latest, is_resting=self._is_resting(now))
            if outcome is not None:
                self.ended, self.has_opened = now, outcome is PutDownOutcome.SOMETHING_TOUCHES
                return outcome

    def _reading(self, time):
        changes = self._world(time)
        if changes is None:
            return None
        of_reading = {name: value for name, value in changes.items() if name not in NOTHING}
        changes = NOTHING | changes
        number = next(self._numbers)
        pads = tuple(self._contact(**{name: changes[name] for name in NOTHING}) for _ in range(2))
        return HeldReading(time, GraspContact.TWO_SIDED, pads, (number, number))._replace(**of_reading)

    def _contact(self, shift, force, angle):
        x, y = self._rng.normal((0.02 + shift, 0.03), NOISE)
        return HeldContact((x, y), FORCE + force + self._rng.normal(0, FORCE_NOISE), PITCH, 'rectangle',
                           math.remainder(self._angle + angle + self._rng.normal(0, 0.01), math.pi), 2)


def later(change, at=AFTER):
    """Return a world that is quiet until the time ``at``, and then follows ``change(time since then)``."""
    return lambda time: change(time - at) if time >= at else {}


def shake(frequency, amplitude=1e-3, force=1.0):
    def change(time):
        swing = math.sin(2 * math.pi * frequency * time)
        return {'shift': amplitude * swing, 'force': force * swing}
    return change


def stopping_arm(time):
    """The arm stops with a jerk, and swings at 6 Hz until the swing has decayed."""
    return {'shift': 1e-3 * math.exp(-time / 0.3) * math.sin(12 * math.pi * time)}


def unseen(time):
    return {'contact': GraspContact.UNSEEN, 'pads': None}


#: Each disturbance in the air, and the outcomes with which the goal may end.
DISTURBED = {
    'nothing': (later(lambda time: {}), {'TIMED_OUT'}),
    **{f'shaken at {each:g} Hz': (later(shake(each)), {'TIMED_OUT'}) for each in (5, 6.3, 7, 10, 12.5, 15)},
    **{f'shaken at {each:g} Hz from the beginning': (shake(each), {'TIMED_OUT', 'NO_QUIET_BASELINE'})
       for each in (5, 7, 10, 15)},
    'the arm stops': (later(stopping_arm), {'TIMED_OUT'}),
    'one frame jumps': (lambda time: {'shift': 2e-3} if round(time / PERIOD) % 50 == 7 else {}, {'TIMED_OUT'}),
    'two frames jump': (lambda time: {'force': -2.0} if round(time / PERIOD) % 50 in (7, 8) else {}, {'TIMED_OUT'}),
    'every fifth frame is lost': (lambda time: None if round(time / PERIOD) % 5 == 0 else {}, {'TIMED_OUT'}),
    'every fifth frame lacks CAN frames': (lambda time: {'pads': None} if round(time / PERIOD) % 5 == 0 else {},
                                           {'TIMED_OUT'}),
    'the skin creeps': (lambda time: {'force': -0.3 * (1 - math.exp(-time / 5))}, {'TIMED_OUT'}),
    'the skin creeps a lot': (lambda time: {'force': -2.0 * (1 - math.exp(-time / 10))},
                              {'DRIFTED', 'NO_QUIET_BASELINE'}),
    'the zero drifts': (lambda time: {'shift': 2e-5 * time}, {'TIMED_OUT'}),
    'frames stop': (later(lambda time: None), {'PAD_UNSEEN'}),
    'a pad is unseen': (later(unseen), {'PAD_UNSEEN'}),
    'a pad is unseen for 0.3 s': (later(lambda time: unseen(time) if time < 0.3 else {}), {'TIMED_OUT'}),
    'a second contact': (later(lambda time: {'pads': None}), {'PAD_UNSEEN'}),
    'the object falls': (later(lambda time: {'contact': GraspContact.NO_CONTACT, 'pads': None}), {'OBJECT_LOST'}),
    'a pad loses the object': (later(lambda time: {'contact': GraspContact.ONE_SIDED, 'pads': None}), {'OBJECT_LOST'}),
    'a contact bounces': (later(lambda time: {'contact': GraspContact.ONE_SIDED, 'pads': None}
                                if time < LOST_AFTER / 2 else {}), {'TIMED_OUT'}),
    'nothing is held': (lambda time: {'contact': GraspContact.NO_CONTACT, 'pads': None}, {'NOT_HELD'}),
    'one pad is touched': (lambda time: {'contact': GraspContact.ONE_SIDED, 'pads': None}, {'NOT_HELD'}),
    'nothing is known': (lambda time: None, {'PAD_UNSEEN'}),
    'old frames': (lambda time: {'acquired': time - 2 * MAX_AGE}, {'PAD_UNSEEN'}),
    'frames without an age': (lambda time: {'acquired': -math.inf}, {'PAD_UNSEEN'}),
    'stamps that jitter': (lambda time: {'acquired': time - PERIOD * (round(time / PERIOD) % 2)}, {'TIMED_OUT'}),
    'the same frame again and again': (later(lambda time: {'sequences': (1, 1), 'shift': 1e-3}), {'TIMED_OUT'}),
}


@pytest.mark.parametrize('seed', [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in (1, 2))])
@pytest.mark.parametrize('name', DISTURBED)
def test_no_disturbance_in_the_air_opens_the_gripper(name, seed):
    world, outcomes = DISTURBED[name]
    planner = Planner(world, seed=seed)
    assert planner.put_down().name in outcomes
    assert not planner.has_opened


def ramp(amount, seconds, name='shift'):
    return lambda time: {name: amount * min(1.0, time / seconds)}


#: The sizes of the changes that a touch causes, their durations [s] and signs.
TOUCHES = [(0.5e-3, 0.2, Sign.SHIFTED), (-0.5e-3, 1.0, Sign.SHIFTED), (-1.0, 0.2, Sign.FORCE_CHANGED),
           (1.0, 0.5, Sign.FORCE_CHANGED), (0.2, 0.2, Sign.TURNED), (-0.2, 0.5, Sign.TURNED)]
OF_SIGN = {Sign.SHIFTED: 'shift', Sign.FORCE_CHANGED: 'force', Sign.TURNED: 'angle'}


@pytest.mark.parametrize(('amount', 'seconds', 'sign'), TOUCHES)
@pytest.mark.parametrize('angle', [0.4, math.pi / 2])
def test_a_lasting_change_is_a_touch(amount, seconds, sign, angle):
    """At an angle of a quarter turn, the angle of a rectangle may jump to the equivalent angle of minus a quarter."""
    planner = Planner(later(ramp(amount, seconds, OF_SIGN[sign])), angle=angle)
    assert planner.put_down() is PutDownOutcome.SOMETHING_TOUCHES
    assert planner.rules.signs == sign and planner.rules.deviations >= 3
    assert AFTER + LASTING < planner.ended < AFTER + seconds + LASTING + AGE + PERIOD + LOOK


def test_a_push_in_the_air_is_a_touch():
    """The pads cannot tell a hand that pushes the object for 0.3 s from a table."""
    planner = Planner(later(lambda time: {'shift': 1e-3 * (time < 0.3)}))
    assert planner.put_down() is PutDownOutcome.SOMETHING_TOUCHES


@pytest.mark.parametrize(('shift', 'outcome'), [(0.4e-3, 'DRIFTED'), (1e-3, 'SOMETHING_TOUCHES')])
def test_a_change_on_one_pad_alone_must_be_larger(shift, outcome):
    class OneSided(Planner):
        def _contact(self, shift, force, angle):
            self._is_left = not getattr(self, '_is_left', False)
            return super()._contact(shift if self._is_left else 0.0, force, angle)
    assert OneSided(later(ramp(shift, 0.2))).put_down().name == outcome
    assert Planner(later(ramp(shift, 0.2))).put_down() is PutDownOutcome.SOMETHING_TOUCHES


def test_a_larger_change_is_surer():
    def sureness(shift):
        planner = Planner(later(lambda time: {'shift': shift}))
        assert planner.put_down() is PutDownOutcome.SOMETHING_TOUCHES
        return planner.rules.deviations
    assert sureness(0.5e-3) < sureness(1e-3) < sureness(2e-3)


def test_a_shift_below_the_resolution_is_no_touch():
    """A light object that the table takes shifts by less than 0.05 pitches."""
    planner = Planner(later(ramp(0.05 * PITCH, 0.1)))
    assert planner.put_down() is PutDownOutcome.TIMED_OUT


#: Times during the baseline [s], and changes that are complete or clear before its end.
TOO_EARLY = [(at, change) for at in (0.1, 0.4, 0.75) for change in (ramp(1e-3, 0.1), ramp(1e-3, 1.0))]
TOO_EARLY += [(at, ramp(-1.5, 0.3, 'force')) for at in (0.1, 0.75, 1.2)]


@pytest.mark.parametrize(('at', 'change'), TOO_EARLY)
def test_a_table_met_during_the_baseline_is_never_a_success(at, change):
    """The planner was wrong, and the arm stops after the baseline at the latest."""
    planner = Planner(later(change, at))
    assert planner.put_down() is PutDownOutcome.NO_QUIET_BASELINE
    assert planner.ended < BASELINE_TIME + 0.1 and not planner.has_opened and planner.rules.reason


def test_a_table_met_at_the_end_of_the_baseline_is_a_touch_because_the_change_goes_on():
    planner = Planner(later(ramp(1e-3, 1.0), BASELINE_TIME - 0.1))
    assert planner.put_down() is PutDownOutcome.SOMETHING_TOUCHES


def test_a_table_met_before_the_baseline_is_never_a_success():
    """The object slips in the hand at 5 mm/s, or the slip does not show."""
    assert Planner(lambda time: {'shift': 0.005 * time}).put_down() is PutDownOutcome.NO_QUIET_BASELINE
    assert Planner(lambda time: {'shift': 1e-3}).put_down() is PutDownOutcome.TIMED_OUT


def test_a_touch_that_is_too_slow_to_be_one_ends_as_a_drift():
    planner = Planner(later(lambda time: {'shift': 6e-5 * time}))
    assert planner.put_down() is PutDownOutcome.DRIFTED
    assert 'place of the contact' in planner.rules.reason


def test_a_touch_is_detected_on_a_hand_that_has_been_shaken_from_the_beginning():
    def world(time):
        swing = shake(8, amplitude=2e-4, force=0.2)(time)
        return swing | {'shift': swing['shift'] + 1.5e-3 * (time >= AFTER)}
    planner = Planner(world)
    assert planner.put_down() is PutDownOutcome.SOMETHING_TOUCHES
    assert planner.ended > AFTER


def test_a_touch_is_detected_although_frames_are_lost():
    planner = Planner(lambda time: None if round(time / PERIOD) % 3 == 0 else later(ramp(1e-3, 0.2))(time))
    assert planner.put_down() is PutDownOutcome.SOMETHING_TOUCHES


def test_a_contact_without_force_and_angle_is_watched_by_its_place():
    class OnOff(Planner):
        def _contact(self, shift, force, angle):
            contact = super()._contact(shift, force, angle)
            return contact._replace(force=math.nan, angle=math.nan, outline='', symmetry=0)
    planner = OnOff(later(ramp(1e-3, 0.2)))
    assert planner.put_down() is PutDownOutcome.SOMETHING_TOUCHES and planner.rules.signs is Sign.SHIFTED


def test_another_outline_is_no_turn():
    """The classifier names the contact differently from frame to frame, with another angle."""
    class Undecided(Planner):
        def _contact(self, shift, force, angle):
            contact = super()._contact(shift, force, angle)
            return contact._replace(outline='square', angle=1.2, symmetry=4) if angle else contact
    planner = Undecided(later(lambda time: {'angle': 1.0}))
    assert planner.put_down() is PutDownOutcome.TIMED_OUT


def test_a_gripper_that_corrects_its_force_delays_the_baseline():
    planner = Planner(lambda time: {'force': -1.0 * (time < 0.5)}, lambda time: time > 0.6)
    assert planner.put_down() is PutDownOutcome.TIMED_OUT


def test_a_gripper_that_moves_while_the_object_is_watched_ends_the_goal():
    planner = Planner(lambda time: {}, lambda time: time < AFTER)
    assert planner.put_down() is PutDownOutcome.GRIPPER_MOVED
    assert planner.ended == pytest.approx(AFTER, abs=2 * LOOK)


@pytest.mark.parametrize('speed', [1e-4, 3e-4, 1e-3, 3e-3, 1e-2])
@pytest.mark.parametrize('begin', [0.0, AFTER])
def test_a_slide_ends_the_goal_before_the_object_has_slid_far(speed, begin):
    """The hold of the gripper answers to no slide during a goal, even if the planner has died."""
    planner = Planner(later(lambda time: {'shift': speed * time}, begin))
    assert planner.put_down().name in ('SOMETHING_TOUCHES', 'DRIFTED', 'NO_QUIET_BASELINE')
    latest = BASELINE_TIME if begin == 0 else LASTING
    assert speed * (planner.ended - begin) < 0.3 * PITCH + speed * (latest + AGE + PERIOD + LOOK)


def test_slow_frames_give_no_baseline():
    planner = Planner(lambda time: {}, period=0.12)
    assert planner.put_down() is PutDownOutcome.NO_QUIET_BASELINE and 'at least 20' in planner.rules.reason


def test_the_limits_of_time_are_kept():
    def ended(name):
        planner = Planner(DISTURBED[name][0])
        planner.put_down()
        return planner.ended
    assert ended('nothing') == pytest.approx(TIMEOUT, abs=2 * LOOK)
    assert ended('nothing is known') == pytest.approx(START_TIME, abs=2 * LOOK)
    assert ended('frames stop') == pytest.approx(AFTER + MAX_AGE + BLIND_TIME, abs=PERIOD + 2 * LOOK)
    assert ended('the object falls') == pytest.approx(AFTER + AGE + LOST_AFTER, abs=PERIOD + 2 * LOOK)


@pytest.mark.slow
@pytest.mark.parametrize('kind', ['square', 'ball'])
def test_a_table_is_detected_on_an_elastic_skin(kind):
    """An object of 200 g is lowered at 2 mm/s onto a table, on simulated taxels with noise, hum and dead taxels."""
    hand = Hand(generator(Purpose.TEST, 5_200), kind, make_recogniser())
    descent = Descent(weight=0.2, speed=0.002, met=3.0)
    rules = PutDown(0.0, TIMEOUT, MAX_AGE)
    ended = next((reading.acquired, outcome) for reading in hand.see(descent.path, 6.0)
                 if (outcome := rules.look(reading.acquired, reading, is_resting=True)) is not None)
    assert ended[1] is PutDownOutcome.SOMETHING_TOUCHES
    assert descent.met < ended[0] <= descent.met + descent.most / (STIFFNESS * descent.speed)
