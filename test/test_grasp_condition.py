"""Tests that the condition of the behaviour-tree example never succeeds because of an old grasp."""

from copy import deepcopy
from types import SimpleNamespace

import grasp_condition as example
import py_trees
import pytest
from py_trees.common import Status
from test_malformed_messages import good_shape

from tactile_node.grasp.gripper import Gripper
from tactile_node.grasp.opening import UNKNOWN_OPENING
from tactile_node.grasp.tracker import GraspTracker, SideResult, SideState
from tactile_node.ros.grasp_checks import check_grasp
from tactile_node.ros.grasp_messages import CurrentGrasp, grasp_message
from tactile_node.ros.message_age import age_message
from tactile_node.ros.shape_messages import pad_shape_of
from tactile_node.ros.time_messages import time_message
from tactile_skin.msg import ContactShape, Grasp

pytestmark = pytest.mark.ros

PERIOD = 0.05  # Time between two messages [s].
AGE = 0.03  # Age of a message on arrival [s].


class World:
    """A clock, a publisher of grasps, and the behaviour tree's view of the grasp."""

    def __init__(self):
        self.now, self._tracker = 100.0, GraspTracker()
        node = SimpleNamespace(create_subscription=lambda *given: None)
        self.watch = example.GraspWatch(node, steady=self.steady)

    def steady(self) -> float:
        return self.now

    def publish(self, seconds=PERIOD, states=(SideState.TOUCHED,) * 2):
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            for side, state in zip(('left', 'right'), states):
                centre = (0.01, 0.015) if state is SideState.TOUCHED else None
                self._tracker.update(side, SideResult(self.now - AGE, state, 'square', centre), self.now)
            self.watch.receive(self.message(self._tracker.state(self.now)))

    def message(self, state) -> Grasp:
        sides = [good_shape(), good_shape()]
        for side in sides:
            side.header.stamp = time_message(1.7e9 + self.now - AGE)
        message = grasp_message(CurrentGrasp(state, [*map(pad_shape_of, sides)], UNKNOWN_OPENING, 'gripper', (AGE, AGE),
                                             Gripper()))
        message.age = age_message(AGE)
        assert check_grasp(message) is None
        return message

    def tick(self, **given):
        condition = example.IsGraspStable('held', self.watch, **given)
        condition.tick_once()
        return condition.status


@pytest.fixture
def world():
    return World()


@pytest.fixture(scope='module')
def first_held():
    """Return a world whose grasp has been stable for a while.

    The tests share this world, because computing its messages takes half a second.
    """
    world = World()
    world.publish(1.5)
    assert world.tick() is Status.SUCCESS
    return world


@pytest.fixture
def held(first_held):
    return deepcopy(first_held)


def test_the_condition_succeeds_while_the_grasp_is_stable_and_meets_the_requirements(world):
    assert world.tick() is Status.FAILURE
    world.publish(1.5)
    assert world.tick() is Status.SUCCESS
    assert world.tick(shapes=('square',), min_confidence=0.5) is Status.SUCCESS
    assert world.tick(shapes=('circle',)) is Status.FAILURE
    assert world.tick(min_confidence=1.0) is Status.FAILURE


def test_the_condition_fails_once_grasps_stop(held):
    assert held.tick() is Status.SUCCESS
    held.now += example.MAX_SILENCE + 0.01
    assert held.tick() is Status.FAILURE


def test_a_grasp_that_was_held_back_is_too_old(held):
    kept = held.message(held._tracker.state(held.now))
    held.now += 1.0
    held.watch.receive(kept)
    assert held.tick() is Status.FAILURE


@pytest.mark.parametrize('states', [(SideState.TOUCHED, SideState.UNSEEN), (SideState.TOUCHED, SideState.EMPTY),
                                    (SideState.EMPTY, SideState.EMPTY)])
def test_the_condition_fails_if_the_object_is_not_held_or_not_seen(held, states):
    held.publish(states=states)
    assert held.tick() is Status.FAILURE


@pytest.mark.parametrize('required, expected', [({}, Status.SUCCESS), ({'min_confidence': 0.5}, Status.FAILURE)])
def test_a_certainly_unknown_shape_is_not_a_confident_name(held, required, expected):
    """If a minimum confidence is required, an unknown shape fails, however confident the recogniser is of "unknown"."""
    grasp = held.message(held._tracker.state(held.now))
    grasp.shape, grasp.class_name, grasp.confidence = ContactShape.UNKNOWN, 'unknown', 0.5
    held.watch = SimpleNamespace(current=lambda: grasp)
    assert held.tick(**required) is expected


def test_a_malformed_message_neither_succeeds_nor_counts(held):
    held.watch.receive(Grasp(stable=True, fresh=True, contact=Grasp.TWO_SIDED))
    held.now += example.MAX_SILENCE + 0.01
    assert held.tick() is Status.FAILURE


def test_a_sequence_starts_its_next_child_only_while_it_holds(held):
    root = py_trees.composites.Sequence('lift', memory=False, children=[
        example.IsGraspStable('held', held.watch), py_trees.behaviours.Running('lifting')])
    root.tick_once()
    assert root.status is Status.RUNNING
    held.now += 1.0
    root.tick_once()
    assert root.status is Status.FAILURE
