"""The example planner runs in a loop with a simulated gripper.

The loop either ends with opposing contacts, or does not squeeze the object.
"""

from dataclasses import replace
from math import nan, pi, radians, remainder
from typing import NamedTuple

import numpy as np
import planner_client
import planner_world
import pytest
from grasp_loop import MOVES, PATIENCE, SETTLE, GraspLoop, Reason
from planner_chain import DELAY, PlannerChain
from planner_client import MAX_ANGLE, MAX_MISALIGNMENT, MAX_OFFSET, Correction, Planner, asked_for
from planner_world import (
    AIM,
    FORCE,
    PITCH,
    STIFFNESS,
    Closed,
    Placed,
    Thing,
    close,
    noisy,
    random_place,
    random_thing,
)
from scipy.spatial.transform import Rotation

from tactile_node.simulator.world import Contact

SEED = 4000  # seed of the first start; each further start adds 1
KINDS = ('circle', 'square', 'rectangle', 'right_triangle', 'isosceles_triangle', 'ball')
BEGIN = 100.0  # time of the first frame [s]
PERIOD = 0.08  # time between two frames [s]
OPEN_TIME = 0.24  # time with an open gripper [s]

# Standard deviations of the random errors of a move
GAIN = 0.05
SHIFT_ERROR = 0.0003  # [m]
TURN_ERROR = radians(0.5)
TOLERANCE = 1.25  # factor applied to the planner's limits, because the planner's measurements contain errors

def loop(closed=0.0, **options):
    found = GraspLoop(**options)
    found.closed(closed)
    return found


def test_nothing_is_decided_on_what_was_acquired_before_the_gripper_closed():
    assert SETTLE > planner_client.MAX_AGE
    for action in ('lift', *MOVES):
        assert loop().next(Correction(action), SETTLE - 0.01).kind == 'wait'
    assert GraspLoop().next(Correction('lift'), 1e9).kind == 'wait'  # The gripper has not closed yet.


@pytest.mark.parametrize(('action', 'kind'), [('lift', 'done'), *((each, 'move') for each in MOVES), ('hold', 'wait'),
                                              ('wait', 'wait'), ('open', 'wait')])
def test_a_decision_is_followed(action, kind):
    assert loop().next(Correction(action), SETTLE).kind == kind


@pytest.mark.parametrize(('action', 'reason'), [('hold', Reason.NOT_SEEN), ('wait', Reason.NO_DECISION),
                                                ('open', Reason.EMPTY)])
def test_the_loop_gives_up_without_a_decision(action, reason):
    order = loop(patience=2.0).next(Correction(action), 2.0)
    assert (order.kind, order.reason) == ('give_up', reason)


def test_the_loop_gives_up_after_a_number_of_moves_and_counts_none_twice():
    found = loop(max_moves=2)
    for now in (1.0, 2.0):
        assert found.next(Correction('shift'), now).kind == 'move'
        assert found.next(Correction('shift'), now + 0.5).kind == 'wait'  # The gripper is still moving.
        found.closed(now + 0.5)
    order = found.next(Correction('shift'), 4.0)
    assert (order.kind, order.reason, found.moves) == ('give_up', Reason.TOO_MANY_MOVES, 2)


def placed(tilt=0.0, shift=0.0):
    thing = Thing(Contact('square', (6.0,), x=0.0, y=0.0), length=0.04)
    return Placed(thing, np.array((AIM[0] + shift, AIM[1], 0.0)), Rotation.from_euler('y', tilt))


def test_the_world_agrees_with_statics():
    """The expected force, gap and tilt for a square of 12 x 12 mm are worked out by hand.

    The two ends of the tilted prism are length * sin(tilt) apart across the closing direction.
    """
    closed = close(placed())
    assert [values.sum() * PITCH**2 for values in closed.values] == pytest.approx([FORCE, FORCE], rel=1e-3)
    assert closed.gap == pytest.approx(0.04 - 2 * FORCE / (25e6 * 0.012**2), rel=1e-3)
    truth = placed(0.1).truth
    assert (truth.offset, truth.misalignment) == pytest.approx((0.04 * np.sin(0.1), 0.1))


FACES = {'square': (8.0,), 'rectangle': (12.0, 6.0), 'isosceles_triangle': (9.0, 10.0), 'circle': (4.25,)}


FORCES = 2.0, 5.0  # Forces in N.
TURNS = (0.0, 0.15, 0.0), (0.0, -0.12, 0.0), (0.15, 0.0, 0.0), (-0.09, 0.09, 0.0)  # Rotation vectors [rad].


def advice(monkeypatch, thing, turn=(0.0, 0.0, 0.0), force=2.0, shift=0.0):
    """Return the planner's advice and the grasp after ``thing`` has been pressed for 20 frames.

    ``turn`` is the rotation vector of ``thing`` [rad].
    """
    monkeypatch.setattr(planner_world, 'FORCE', force)
    closed = close(Placed(thing, np.array((AIM[0] + shift, AIM[1], 0.0)), Rotation.from_rotvec(turn)))
    chain, random = PlannerChain(), np.random.default_rng(2000)
    for number in range(20):
        values = closed.values if number > 3 else (np.zeros((16, 16)),) * 2
        frames = {side: noisy(each, random) for side, each in zip(('left', 'right'), values)}
        grasp = chain.grasp(frames, closed.gap, 100.0 + 0.05 * number)
    return planner_client.asked_for(grasp, AIM), grasp


@pytest.mark.ros
@pytest.mark.parametrize(('name', 'turn', 'force'), [
    pytest.param(name, turn, FORCES[(row + column) % 2], marks=() if row == column else pytest.mark.long)
    for row, name in enumerate(FACES) for column, turn in enumerate(TURNS)])
def test_oblique_faces_are_laid_flat_on_the_pads(name, force, turn, monkeypatch):
    """The gripper holds a tilted prism by friction. Opposite edges of the prism touch the left and the right pad.

    The planner's advice must reduce the tilt and add no other error. The line between the contacts is a diagonal of the
    prism.
    """
    thing = Thing(Contact(name, FACES[name], x=0.0, y=0.0), length=0.05)
    found, grasp = advice(monkeypatch, thing, turn, force)
    assert found.action == 'tilt', grasp
    assert np.linalg.norm(np.array(turn) - found.tilt) < 0.7 * np.linalg.norm(turn)


@pytest.mark.ros
@pytest.mark.parametrize('force', [FORCES[1], pytest.param(FORCES[0], marks=pytest.mark.long)])
def test_flat_faces_are_not_tilted_and_ball_ends_along_their_line(force, monkeypatch):
    for name, sizes in FACES.items():
        found, grasp = advice(monkeypatch, Thing(Contact(name, sizes, x=0.0, y=0.0), length=0.05), force=force)
        assert found.action != 'tilt' and np.abs(grasp.lean).max() < 0.01 * STIFFNESS, grasp
    rod = Thing(Contact('circle', (8.0,), x=0.0, y=0.0), length=0.05, ball=0.012)
    found, grasp = advice(monkeypatch, rod, (0.0, 0.15, 0.0), force)
    centres = 0.05 - 2 * 0.012
    # The line between the tops of the balls is worked out by hand.
    line = np.arctan2(centres * np.sin(0.15), centres * np.cos(0.15) + 2 * 0.012)
    assert found.action == 'tilt' and found.tilt == pytest.approx((0.0, line, 0.0), abs=0.02)


@pytest.mark.ros
def test_oblique_faces_that_the_edge_of_a_pad_cuts_are_not_tilted(monkeypatch):
    thing = Thing(Contact('square', (8.0,), x=0.0, y=0.0), length=0.05)
    assert advice(monkeypatch, thing, (0.0, 0.15, 0.0), 5.0)[0].action == 'tilt'
    for shift in (-0.011, 0.011):
        assert advice(monkeypatch, thing, (0.0, 0.15, 0.0), 5.0, shift=shift)[0].action in ('wait', 'shift')


class Run(NamedTuple):
    """Result of one start."""

    is_done: bool
    reason: Reason
    before: Placed
    after: Placed

    @property
    def is_right(self) -> bool:
        """True if the loop ended with "done" and the contacts really oppose each other at the planned place."""
        return self.is_done and opposes(self.after)


def opposes(placed: Placed) -> bool:
    truth = placed.truth
    return (truth.offset <= TOLERANCE * MAX_OFFSET and truth.misalignment <= TOLERANCE * MAX_MISALIGNMENT
            and truth.off_aim <= TOLERANCE * MAX_OFFSET and off_edge(placed) <= TOLERANCE * MAX_ANGLE)


def off_edge(placed: Placed) -> float:
    """Return the smallest angle between an edge of the object and an axis of the pad [rad], or 0 for round objects."""
    if placed.thing.face.shape == 'circle':
        return 0.0
    corners = placed.thing.face.outline()
    edges = placed.turn.apply(np.column_stack((np.roll(corners, -1, 0) - corners, np.zeros(len(corners)))))
    return min(abs(remainder(float(np.arctan2(y, x)), pi / 2)) for x, y, _ in edges)


class Simulation:
    """Simulates one start, with a ``fault`` or none, and with the ``patience`` of the grasp loop [s]."""

    def __init__(self, seed: int, kind: str, fault: str = '', patience: float = PATIENCE):
        self._random, self._fault = np.random.default_rng(seed), fault
        self._placed = random_place(self._random, random_thing(self._random, kind))
        if fault in ('misses a pad', 'nothing there'):
            self._placed = replace(self._placed, ends=(fault == 'misses a pad', False))
        self._chain, self._planner, self._loop = PlannerChain(), Planner(), GraspLoop(patience)
        self._now = BEGIN

    def run(self) -> Run:
        before = self._placed
        self._send_open()
        while True:
            closed = close(self._placed)
            self._placed = closed.placed
            order, middle = self._settled(closed)
            if order.kind != 'move':
                return Run(order.kind == 'done', order.reason, before, self._placed)
            self._placed = self._moved(order.correction, middle)
            self._send_open()

    def _settled(self, closed: Closed):
        """Send frames while the loop waits, and return the loop's next command and the midpoint of the grasp."""
        self._loop.closed(self._now)
        while True:
            grasp = self._sent(closed.values, closed.gap)
            order = self._loop.next(self._planner.decide(self._now), self._now)
            if order.kind != 'wait':
                return order, np.array((grasp.midpoint.x, grasp.midpoint.y, grasp.midpoint.z))

    def _send_open(self) -> None:
        """Send frames of an open gripper, which contain only the noise of the pads."""
        for _ in range(round(OPEN_TIME / PERIOD)):
            self._sent((np.zeros((16, 16)),) * 2, 0.08)

    def _sent(self, values, gap: float):
        self._now += PERIOD
        frames = {side: noisy(each, self._random) for side, each in zip(('left', 'right'), values)}
        if self._fault == 'a pad is silent':
            del frames['right']
        if self._fault == 'half a pad is hidden':
            frames['right'][8:] = nan
        grasp = self._chain.grasp(frames, gap, self._now)
        age = grasp.age.sec + grasp.age.nanosec * 1e-9
        self._planner.receive(asked_for(grasp, AIM), self._now, age + DELAY)
        return grasp

    def _moved(self, correction, middle: np.ndarray) -> Placed:
        """Return the object's place after a move with random gripper errors. A regrasp moves only by these errors."""
        gain = 1 + GAIN * self._random.standard_normal()
        shift = gain * np.array(correction.shift) + SHIFT_ERROR * self._random.standard_normal(2)
        turn = gain * (np.array(correction.tilt) + (0.0, 0.0, correction.angle))
        about = middle if np.isfinite(middle).all() else np.array((*AIM, 0.0))
        return self._placed.moved(shift, about,
                                  Rotation.from_rotvec(turn + TURN_ERROR * self._random.standard_normal(3)))


def runs(count: int) -> list[Run]:
    return [Simulation(SEED + number, KINDS[number % len(KINDS)]).run() for number in range(count)]


@pytest.mark.slow
@pytest.mark.ros
def test_from_random_starts_the_contacts_come_to_oppose():
    found = runs(2)
    assert not any(opposes(run.before) for run in found)
    assert [run.is_right for run in found] == [True] * len(found)


@pytest.mark.slow
@pytest.mark.ros
@pytest.mark.parametrize(('fault', 'reason'), [
    ('misses a pad', Reason.NO_DECISION), ('nothing there', Reason.EMPTY), ('a pad is silent', Reason.NOT_SEEN),
    pytest.param('half a pad is hidden', Reason.NO_DECISION, marks=pytest.mark.long)])
def test_the_loop_gives_up_without_a_squeeze_if_no_move_helps(fault, reason):
    run = Simulation(SEED + 500, 'circle', fault, patience=1.5).run()
    assert not run.is_done and run.reason is reason


@pytest.mark.slow
@pytest.mark.ros
def test_the_loop_is_never_done_with_wrong_advice(monkeypatch):
    """If the loop succeeded with wrong advice, the tests above could not fail."""
    monkeypatch.setattr(planner_client, 'opposing', lambda line, left: (0.0, -line.misalignment, 0.0))
    run, = runs(1)
    assert not run.is_done
