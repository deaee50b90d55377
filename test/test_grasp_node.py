"""Tests for the grasps that the node publishes.

In these tests, a pad stops sending shapes, sees only a part of a contact, or uses another clock, and the fingers stop
reporting their opening.
"""

import copy
import itertools
import math
from functools import partial

import numpy as np
import pytest
from rclpy.parameter import Parameter
from ros_bench import TIMEOUT, TimedBench
from sensor_msgs.msg import JointState
from test_malformed_messages import good_shape

from tactile_node.nodes import grasp_node
from tactile_node.nodes.grasp_node import GraspNode
from tactile_node.ros.grasp_checks import check_grasp
from tactile_node.ros.grasp_messages import sides_message
from tactile_node.ros.message_age import age_message, age_seconds
from tactile_node.ros.qos import frames_qos
from tactile_node.ros.shape_messages import pad_shape_of
from tactile_node.ros.time_messages import time_message
from tactile_skin.msg import ContactShape, Grasp, GraspSides

pytestmark = pytest.mark.ros

STEP = 0.01  # Step of the virtual time [s].
PERIOD = 2 * STEP  # Period of the shapes [s].
AGE = 0.015  # Age of a shape when the classifier sends it [s].
BOTH = ('left', 'right')


def hidden_shape() -> ContactShape:
    """Return the shape of a pad on which no contact is visible, but whose hidden taxels could hide one."""
    names = ['none', 'unknown']
    return ContactShape(shape=ContactShape.UNKNOWN, class_name='unknown', unknown_reason=ContactShape.NOT_SEEN,
                        confidence=1.0, class_names=names, probabilities=[0.0, 1.0], frame_probabilities=[0.0, 1.0],
                        frame_shape=ContactShape.UNKNOWN, frame_class_name='unknown', method='learned')


class Gripper(TimedBench):
    """Two classifiers with separate clocks, the grasp node, and a reader of its grasps."""

    def __init__(self, stack, parameters=(), offsets=(0.0, 0.0), lossless=False, **bench):
        super().__init__(stack, STEP, **bench)
        self.grasps: list[tuple[float, Grasp]] = []
        self._offsets = dict(zip(BOTH, offsets))
        self._sequence = 0
        self._shape = good_shape()
        peer, qos = self.add('peer'), frames_qos(500, lossless)
        self.node = self.add(self.timed(GraspNode)(parameter_overrides=[Parameter(*each) for each in parameters]))
        peer.create_subscription(Grasp, '/grasp', self._on_grasp, qos)
        self._publishers = {side: peer.create_publisher(ContactShape, f'/{side}/shape', qos) for side in BOTH}
        self.until_joined(lambda: peer.count_publishers('/grasp') and all(
            each.get_subscription_count() for each in self._publishers.values()))

    def _on_grasp(self, grasp: Grasp) -> None:
        assert check_grasp(grasp) is None
        self.grasps.append((self.steady(), grasp))

    @property
    def latest(self) -> Grasp:
        return self.grasps[-1][1]

    def after(self, since: float) -> list[tuple[float, Grasp]]:
        return [each for each in self.grasps if each[0] > since]

    def message(self, side: str, shape: ContactShape | None = None) -> ContactShape:
        """Return a shape that was acquired AGE ago, with a stamp from the clock of its side."""
        shape = shape or self._shape
        shape.header.stamp = time_message(1.7e9 + self._offsets[side] + self.steady() - AGE)
        shape.age = age_message(AGE)
        shape.sequence = self._sequence
        return shape

    def publish(self, side: str, message: ContactShape) -> None:
        self._publishers[side].publish(message)

    def run(self, seconds: float, sides=BOTH, shapes=None) -> None:
        """Publish one shape for each of ``sides`` per PERIOD, for ``seconds``."""
        for _ in range(round(seconds / PERIOD)):
            self._sequence += 1
            for side in sides:
                self.publish(side, self.message(side, (shapes or {}).get(side)))
            self.wait(PERIOD)

    def feed(self, seconds: float, sides=BOTH) -> None:
        """Pass one shape of each of ``sides`` per PERIOD by function calls, as a classifier of this process does."""
        for _ in range(round(seconds / PERIOD)):
            self._sequence += 1
            shapes = {side: pad_shape_of(copy.deepcopy(self.message(side)), self.steady() - AGE) for side in sides}
            self.node._stages.chain.post(self._feed_each, shapes)
            self.settle()
            self.wait(PERIOD)

    def _feed_each(self, shapes) -> None:
        for side, shape in shapes.items():
            self.node._shapes[side].feed(shape)

    def set_clocks(self, step: float) -> None:
        """Set the wall clocks of both sides forward by ``step`` [s], or back if it is negative."""
        self._offsets = {side: offset + step for side, offset in self._offsets.items()}

    def run_until(self, condition, what: str, **given) -> None:
        end = self.steady() + TIMEOUT
        while not (self.grasps and condition(self.latest)):
            assert self.steady() < end, what
            self.run(PERIOD, **given)


@pytest.fixture
def make_gripper(ros):
    return partial(Gripper, ros)


def test_a_grasp_says_what_is_held_and_its_sides_are_made_while_subscribed_to(make_gripper, monkeypatch):
    gripper, made, heard = make_gripper(), [], []
    monkeypatch.setattr(grasp_node, 'sides_message', lambda *given: made.append(1) or sides_message(*given))
    gripper.run_until(lambda grasp: grasp.fresh, 'a grasp of both')
    assert gripper.latest.class_name == 'square' and gripper.latest.shape == ContactShape.SQUARE
    assert list(gripper.latest.dimensions) == pytest.approx([6 * 0.002], rel=0.03) and gripper.latest.symmetry == 4
    assert gripper.latest.sequences[0] == gripper._sequence
    assert not made
    peer = gripper.add('reader')
    peer.create_subscription(GraspSides, '/grasp_sides', heard.append, 10)
    gripper.run_until(lambda grasp: heard, 'its sides')
    assert [side.class_name for side in heard[-1].sides] == ['square', 'square']
    assert list(heard[-1].side_states) == [Grasp.SIDE_TOUCHED] * 2 and heard[-1].header.frame_id == 'gripper'


def test_both_messages_of_a_grasp_have_the_same_age(make_gripper, monkeypatch):
    gripper, heard = make_gripper(), []
    gripper.add('reader').create_subscription(GraspSides, '/grasp_sides', heard.append, 10)
    gripper.run_until(lambda grasp: heard and grasp.fresh, 'its sides')
    readings = itertools.count()
    monkeypatch.setattr(gripper.node, '_steady', lambda: gripper.steady() + 0.001 * next(readings))
    gripper.run(PERIOD)
    assert heard[-1].header == gripper.latest.header and next(readings) > 1
    assert heard[-1].age == gripper.latest.age


@pytest.mark.parametrize('age, grasps', [(AGE, 1), (math.inf, 2)], ids=['age known', 'age unknown'])
def test_the_waiting_shapes_of_both_pads_are_one_grasp_if_their_ages_are_known(make_gripper, age, grasps):
    """Shapes of unknown age have no order, so an overloaded chain could postpone their grasp without end."""
    gripper = make_gripper()
    gripper.run_until(lambda grasp: grasp.fresh, 'a grasp of both')
    since, sequence = gripper.steady(), gripper._sequence + 1
    gripper._sequence = sequence

    def accept_both() -> None:
        for side in BOTH:
            gripper.node.accept(side, pad_shape_of(copy.copy(gripper.message(side)), since - age))

    gripper.node._stages.chain.post(accept_both)
    gripper.wait(PERIOD)
    found = [grasp for _, grasp in gripper.grasps if sequence in grasp.sequences]
    assert len(found) == grasps and list(found[-1].sequences) == [sequence, sequence]
    assert found[-1].fresh == math.isfinite(age)


OFFSETS = [(0.0, 0.0), (3600.0, -86400.0)]
SIM_TIME = ('use_sim_time', Parameter.Type.BOOL, True),


@pytest.mark.parametrize('offsets', OFFSETS, ids=['one clock', 'two clocks'])
def test_pads_of_any_clocks_are_one_grasp_with_an_age(make_gripper, offsets):
    gripper = make_gripper(offsets=offsets)
    gripper.run_until(lambda grasp: grasp.contact == Grasp.UNSEEN, 'a grasp of both')
    assert not gripper.latest.fresh
    # Until the delay has settled, the shape may have been held back for any time.
    assert age_seconds(gripper.latest.age) == math.inf
    gripper.run_until(lambda grasp: grasp.stable, 'a stable grasp')
    assert gripper.latest.contact == Grasp.TWO_SIDED and gripper.latest.fresh and gripper.latest.creep < 1e-4
    # The tolerance covers the rounding of stamps that count from 1970.
    assert age_seconds(gripper.latest.age) == pytest.approx(AGE, abs=1e-6)


@pytest.mark.parametrize('step', [3600.0, -3600.0])
def test_a_clock_that_is_set_makes_no_result_of_this_process_older_or_fresher(make_gripper, step):
    gripper = make_gripper()
    gripper.feed(1.0)
    assert gripper.latest.stable
    since = gripper.steady()
    gripper.set_clocks(step)
    gripper.feed(0.5)
    found = [grasp for _, grasp in gripper.after(since - STEP)]
    assert [list(grasp.sequences) for grasp in found] == [[number] * 2 for number in range(51, 76)]
    assert all(grasp.fresh and grasp.stable for grasp in found)
    assert [age_seconds(grasp.age) for grasp in found] == pytest.approx([AGE] * 25)
    gripper.feed(0.2, ['left'])
    assert list(gripper.latest.side_states) == [Grasp.SIDE_TOUCHED, Grasp.SIDE_UNSEEN]
    assert not gripper.latest.fresh


@pytest.mark.parametrize(('continuing', 'parameters'), [((), SIM_TIME), (('left',), ()), (('right',), ())],
                         ids=['none, sim time without a clock', 'left', 'right'])
def test_a_message_reports_that_the_shapes_have_stopped(make_gripper, parameters, continuing):
    """test_grasp.py tests how late this message may be, and `make misled` measures the delay."""
    gripper = make_gripper(parameters)
    gripper.run_until(lambda grasp: grasp.stable, 'a stable grasp')
    gripper.run_until(lambda grasp: not grasp.fresh and age_seconds(grasp.age) > 0.3, 'nothing', sides=continuing)
    ended, stopped = gripper.grasps[-1][0], [side not in continuing for side in BOTH]
    gripper.run_until(lambda grasp: age_seconds(grasp.age) > 0.6, 'it again, for one may be lost', sides=continuing)
    gripper.run_until(lambda grasp: [state == Grasp.SIDE_UNSEEN for state in grasp.side_states] == stopped,
                      'which side', sides=continuing)
    later = [grasp for _, grasp in gripper.after(ended)]
    assert later and not any(grasp.fresh or grasp.stable for grasp in later)
    assert all(grasp.contact == Grasp.UNSEEN and math.isnan(grasp.offset) for grasp in later)


@pytest.mark.parametrize('hidden', BOTH)
def test_a_pad_that_is_not_seen_is_unseen(make_gripper, hidden):
    gripper = make_gripper()
    gripper.run_until(lambda grasp: grasp.stable, 'a stable grasp')
    since = gripper.steady()

    def found() -> list[Grasp]:
        return [grasp for _, grasp in gripper.after(since) if not grasp.stable]
    gripper.run_until(lambda grasp: len(found()) > 20 and not grasp.stable, 'it is not seen',
                      shapes={hidden: hidden_shape()})
    assert {grasp.contact for grasp in found()} == {Grasp.UNSEEN}
    assert found()[-1].side_states[BOTH.index(hidden)] == Grasp.SIDE_UNSEEN


def test_a_side_that_never_answers_is_not_known(make_gripper):
    gripper = make_gripper()
    gripper.run(1.0, ['left'])
    gripper.until(lambda: len(gripper.grasps) > 20)
    assert {(grasp.contact, grasp.fresh) for _, grasp in gripper.grasps} == {(Grasp.NOT_KNOWN, False)}
    assert age_seconds(gripper.latest.age) == math.inf


#: Largest age of the opening [s], which is no multiple of PERIOD, because the age is rounded to nanoseconds.
GAP_LIMIT = 0.305
FINGERS = ['left_finger', 'right_finger']
#: Two fingers that each move by half of the opening, with pads mounted as in a drawing [m, rad].
MEASURED = [
    ('gap_source', Parameter.Type.STRING, 'joint_states'), ('gap_joints', Parameter.Type.STRING_ARRAY, FINGERS),
    ('max_gap_age', Parameter.Type.DOUBLE, GAP_LIMIT),
    *((name, Parameter.Type.DOUBLE_ARRAY, value) for name, value in {
        'left_xyz': [-0.015, 0.0, 0.145], 'left_rpy': [-math.pi / 2, 0.0, 0.0],
        'right_xyz': [-0.015, 0.0, 0.115], 'right_rpy': [math.pi / 2, 0.0, 0.0]}.items())]


def check_place(grasp: Grasp) -> None:
    """Check a grasp against the drawing, in which both squares are 11 mm from column 0 and 13 mm from row 0."""
    left, right, gap, across = grasp.left_centre, grasp.right_centre, grasp.gap, 0.004
    place = partial(pytest.approx, abs=2e-5)
    assert (left.x, left.y, left.z) == place((-0.004, -gap / 2, 0.132))
    assert (right.x, right.y, right.z) == place((-0.004, gap / 2, 0.128))
    assert grasp.offset == place(across) and grasp.width == place(math.hypot(gap, across))
    assert grasp.misalignment == pytest.approx(math.atan2(across, gap), abs=0.002)
    assert (grasp.midpoint.x, grasp.midpoint.y, grasp.midpoint.z) == place((-0.004, 0.0, 0.130))


def test_no_grasp_has_a_wrong_or_an_old_opening(make_gripper):
    gripper = make_gripper(MEASURED)
    joints = gripper.add('joints').create_publisher(JointState, '/joint_states', 10)
    gripper.until_joined(joints.get_subscription_count)

    def run(opening=None, sides=BOTH) -> list[Grasp]:
        """Return the grasps of half a second, during which the fingers report ``opening`` once per PERIOD."""
        since = gripper.steady()
        for _ in range(round(0.5 / PERIOD)):
            if opening is not None:
                joints.publish(JointState(name=FINGERS, position=[opening / 2] * 2))
            gripper.run(PERIOD, sides)
        return [grasp for _, grasp in gripper.after(since)]
    gripper.run_until(lambda grasp: grasp.fresh, 'a grasp of both')
    unknown = run()
    assert all(np.isnan([grasp.gap, grasp.width, grasp.midpoint.x]).all() for grasp in unknown)
    assert unknown[-1].offset == pytest.approx(0.004, abs=2e-5)
    known = [*run(0.040), *run(0.020)]
    openings = [round(grasp.gap, 6) for grasp in known]
    assert openings == sorted(openings, reverse=True) and set(openings) == {0.04, 0.02}
    for grasp in known:
        check_place(grasp)
    stopped = run()
    ages = [age_seconds(grasp.gap_age) for grasp in stopped]
    assert all(math.isnan(grasp.gap) or age <= GAP_LIMIT for grasp, age in zip(stopped, ages))
    assert all(math.isnan(grasp.width) == math.isnan(grasp.gap) for grasp in stopped)
    assert math.isnan(stopped[-1].gap) and ages[-1] > GAP_LIMIT
    assert stopped[-1].fresh and stopped[-1].gap_source == Grasp.GAP_JOINT_STATES
    silent = run(0.060, sides=())[-1]
    assert not silent.fresh and silent.gap == pytest.approx(0.060) and math.isnan(silent.width)
