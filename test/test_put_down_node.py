"""The action `put_down` of the gripper node, in virtual time with simulated pads and a simulated gripper.

test_put_down.py tests the rules without ROS, and test_put_down_example.py kills and stops the node.
"""

from copy import deepcopy
from itertools import count, product

import pytest
from test_malformed_messages import good_shape
from virtual_gripper import AGE, PERIOD, STEP

from tactile_node.gripper.put_down_goal import FEEDBACK_LIMIT
from tactile_node.gripper.rules.closing import Outcome
from tactile_node.gripper.rules.put_down import BASELINE_TIME, BLIND_TIME, LASTING, LONGEST_TIMEOUT
from tactile_skin.action import PutDown
from tactile_skin.msg import GraspSides

pytestmark = [pytest.mark.ros, pytest.mark.bus, pytest.mark.usefixtures('control_msgs')]

LONG = pytest.mark.long
TIMEOUT = 8.0  # s
FORCE = 5.0    # N
Result = PutDown.Result


class Sides:
    """Publishes the results of both pads with each grasp. ``change`` modifies the results before they are sent."""

    def __init__(self, bench):
        self._bench, self._numbers, self._shape = bench, count(1), good_shape()
        self._publishers = []
        self.change = lambda sides: sides
        self.add_publisher()

    def add_publisher(self):
        node = self._bench.add(f'sides_{len(self._publishers)}')
        self._publishers.append(node.create_publisher(GraspSides, '/grasp_sides', 10))

    @property
    def is_wanted(self):
        return all(each.get_subscription_count() for each in self._publishers)

    def publish_with(self, grasp):
        """Publish the results of which ``grasp`` consists."""
        number = next(self._numbers)
        sides = []
        for force in grasp.forces:
            side = deepcopy(self._shape)
            side.sequence, side.pad_force, side.header.stamp, side.age = number, force, grasp.header.stamp, grasp.age
            sides.append(side)
        message = GraspSides(header=grasp.header, age=grasp.age, side_states=grasp.side_states, sides=sides)
        for publisher in self._publishers:
            publisher.publish(self.change(message))
        return grasp


@pytest.fixture
def make_bench(ros):
    from gripper_bench import GripperBench

    def make(**parameters):
        bench = GripperBench(ros, parameters=parameters)
        bench.sides = Sides(bench)
        bench.pads.change = bench.sides.publish_with
        bench.motor.move_to(bench.pads.width - FORCE / bench.pads.stiffness)
        bench.wait(0.2)
        return bench
    return make


def begun(bench, timeout=TIMEOUT):
    """Send a goal, and return it once the node receives the results of the pads."""
    goal = bench.client.put_down(timeout)
    bench.until_joined(lambda: bench.sides.is_wanted)
    return goal


def watching(bench):
    """Return a goal that has completed its baseline."""
    goal = begun(bench)
    bench.until(lambda: goal.is_watching or goal.result)
    assert goal.result is None, goal.result.message
    return goal


def ended(bench, goal):
    """Return the result of a goal, and the time until its end [s]."""
    since = bench.steady()
    bench.until(lambda: goal.result is not None)
    return goal.result, bench.steady() - since


def moved(sides, by=1e-3):
    for side in sides.sides:
        side.centre_of_pressure.x += by
    return sides


def test_a_touch_is_reported_with_its_sign_and_moves_nothing(make_bench):
    bench = make_bench()
    goal = begun(bench)
    begin = bench.steady()
    bench.until(lambda: goal.is_current)
    assert not goal.is_watching
    bench.until(lambda: goal.is_watching)
    assert bench.steady() - begin >= BASELINE_TIME - AGE
    bench.wait(1.0)
    assert goal.is_watching and goal.result is None
    bench.sides.change = moved
    result, seconds = ended(bench, goal)
    assert (result.outcome, result.signs) == (Result.SOMETHING_TOUCHES, Result.SHIFTED) and result.deviations >= 3
    assert 'moved along its pad' in result.message
    assert LASTING <= seconds <= LASTING + AGE + PERIOD + 2 * STEP
    assert not goal.is_current and not bench.motor.commands


def test_an_object_that_is_lost_and_a_pad_that_is_unseen_end_the_goal(make_bench):
    bench = make_bench()
    goal = watching(bench)
    bench.motor.move_to(bench.pads.width + 0.01)
    assert ended(bench, goal)[0].outcome == Result.OBJECT_LOST
    assert ended(bench, begun(bench))[0].outcome == Result.NOT_HELD
    bench.motor.move_to(bench.pads.width - FORCE / bench.pads.stiffness)
    bench.wait(0.2)
    goal = watching(bench)
    bench.pads.is_silent = True
    bench.until(lambda: not goal.is_current)
    assert bench.steady() - goal.heard <= FEEDBACK_LIMIT + 2 * STEP and goal.result is None
    assert ended(bench, goal)[0].outcome == Result.PAD_UNSEEN
    assert bench.steady() - goal.heard <= BLIND_TIME + 0.15 + 2 * PERIOD and not bench.motor.commands


def of_sides(**fields):
    """Return a function that sets fields of both results."""
    def change(sides):
        for side, (name, value) in product(sides.sides, fields.items()):
            setattr(side, name, value)
        return sides
    return change


@pytest.mark.parametrize('change', [
    of_sides(missing_can_frames=1),
    pytest.param(of_sides(contacts=2, contact_areas=[1e-4, 1e-5], others_present=True), marks=LONG),
    pytest.param(of_sides(confidence=7.0), marks=LONG)], ids=['lost CAN frames', 'two contacts', 'malformed'])
def test_results_that_cannot_be_compared_stop_the_feedback(make_bench, change):
    bench = make_bench()
    goal = watching(bench)
    bench.sides.change = lambda sides: change(moved(sides))
    bench.until(lambda: not goal.is_current)
    assert ended(bench, goal)[0].outcome == Result.PAD_UNSEEN


def test_two_publishers_of_results_are_not_used(make_bench):
    bench = make_bench()
    goal = watching(bench)
    bench.sides.add_publisher()
    bench.until_joined(lambda: bench.node.count_publishers('/grasp_sides') == 2)
    bench.sides.change = moved
    assert ended(bench, goal)[0].outcome == Result.PAD_UNSEEN


def test_a_goal_can_be_cancelled_and_times_out(make_bench):
    bench = make_bench()
    goal = watching(bench)
    goal.cancel()
    assert ended(bench, goal)[0].outcome == Result.CANCELED
    goal = begun(bench, 2.0)
    result, _ = ended(bench, goal)
    assert result.outcome == Result.TIMED_OUT and result.signs == Result.NO_SIGN and result.deviations == 0


def test_an_impossible_timeout_is_refused(make_bench):
    bench = make_bench()
    for timeout in (0.0, LONGEST_TIMEOUT + 0.1):
        result, _ = ended(bench, bench.client.put_down(timeout))
        assert result.outcome == Result.REFUSED and 'timeout' in result.message
        assert not bench.node._control.suspends_hold


def test_a_new_goal_replaces_the_goal_in_progress(make_bench):
    bench = make_bench()
    first = watching(bench)
    second = begun(bench)
    assert ended(bench, first)[0].outcome == Result.REPLACED
    bench.until(lambda: second.is_watching)


def test_another_goal_of_the_gripper_ends_the_watch(make_bench):
    bench = make_bench()
    goal = watching(bench)
    sent = bench.client.send(position=0.06)
    assert ended(bench, goal)[0].outcome == Result.GRIPPER_MOVED
    assert Outcome(bench.client.result(sent).outcome.outcome) is Outcome.REACHED


def test_a_second_gripper_node_ends_the_watch(make_bench):
    bench = make_bench()
    goal = watching(bench)
    bench.node._watch._heard['/touch_gripper/heartbeat'] = bench.steady()
    result, _ = ended(bench, goal)
    assert result.outcome == Result.DUPLICATE and 'another touch_gripper' in result.message


@pytest.fixture
def hold(make_bench):
    """Return a bench on which a hold keeps FORCE on the object, and answers to a slide."""
    bench = make_bench(hold=True, slide_force_step=1.0, highest_force=FORCE + 1.0)
    bench.motor.move_to(0.045)
    bench.wait(0.2)
    bench.close(position=0.0, effort=FORCE)
    bench.wait(0.5)
    return bench


def test_the_hold_waits_with_its_corrections(hold):
    """The object shrinks. A hold would correct the force at once, and hide that the force has changed."""
    bench = hold
    goal = watching(bench)
    commands = len(bench.motor.commands)
    bench.pads.width -= 1.5e-3
    result, _ = ended(bench, goal)
    assert (result.outcome, result.signs) == (Result.SOMETHING_TOUCHES, Result.FORCE_CHANGED)
    assert len(bench.motor.commands) == commands
    bench.until(lambda: min(bench.pads.forces()) > FORCE - 1)  # afterwards, the hold corrects the force
    assert len(bench.motor.commands) > commands


def sliding(grasp):
    for motion in grasp.motions:
        motion.moving, motion.direction = motion.SLIDING, 1.0
    return grasp


@pytest.mark.parametrize(('end', 'outcome'), [
    ('slides', 'SOMETHING_TOUCHES'), ('is cancelled', 'CANCELED'),
    *(pytest.param(*each, marks=LONG) for each in (('has two contacts', 'PAD_UNSEEN'), ('times out', 'TIMED_OUT')))])
def test_the_hold_answers_to_a_slide_after_each_ending_although_the_planner_is_dead(hold, end, outcome):
    """The planner neither opens the gripper nor sends another goal."""
    bench = hold
    goal = watching(bench)
    {'slides': lambda: setattr(bench.sides, 'change', moved), 'is cancelled': goal.cancel,
     'has two contacts': lambda: setattr(bench.sides, 'change', of_sides(contacts=2, contact_areas=[1e-4, 1e-5],
                                                                          others_present=True)),
     'times out': lambda: None}[end]()
    bench.pads.change = lambda grasp: sliding(bench.sides.publish_with(grasp))
    assert ended(bench, goal)[0].outcome == getattr(Result, outcome)
    bench.until(lambda: min(bench.pads.forces()) > FORCE + 0.5)
