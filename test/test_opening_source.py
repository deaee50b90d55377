"""The opening of the gripper in a running node, and values that the node must never use as the present opening.

The grippers have the dimensions in their makers' drawings. Each expected number is computed by hand.
"""

import logging
from math import inf, isnan, nan

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from opening_bench import PERIOD, OpeningBench
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from ros_bench import TIMEOUT
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from tactile_node.errors import ConfigurationError
from tactile_node.grasp.opening import UNKNOWN_OPENING, GapSource, Opening
from tactile_node.ros.message_health import total
from tactile_node.ros.opening_messages import opening_status
from tactile_node.skin.taxel_array import RejectReason as R

pytestmark = [pytest.mark.ros, pytest.mark.bus]

#: Value of the parameter max_gap_age [s].
LIMIT = 0.3
#: Each finger moves by half of the gap.
TWO_FINGERS = {'gap_source': 'joint_states', 'gap_joints': ['finger_left', 'finger_right']}
KNUCKLE = {'gap_source': 'joint_states', 'gap_joints': ['knuckle'], 'gap_offset': 0.085, 'gap_scale': -0.1}
ARM = (['shoulder', 'elbow'], [0.1, 0.2])


class Gripper(OpeningBench):
    """A node with a source of the opening, and a publisher of joint states."""

    def __init__(self, stack):
        super().__init__(stack, [(JointState, '/joint_states', QoSProfile(depth=50))])

    def send(self, names, positions, stamp=0.0):
        """Publish one joint state and return the opening after the node has received the joint state."""
        header = Header(stamp=Time(sec=int(stamp), nanosec=round(stamp % 1 * 1e9)))
        return self.publish(JointState(header=header, name=names, position=positions))


@pytest.fixture
def gripper(ros):
    return Gripper(ros)


def test_two_fingers_add_to_the_opening_wherever_they_stand_in_the_message(gripper):
    gripper.make(**TWO_FINGERS)
    assert gripper.current() is UNKNOWN_OPENING
    opening = gripper.send(['elbow', 'finger_right', 'finger_left'], [1.5, 0.010, 0.012])
    assert opening.gap == pytest.approx(0.022) and opening.source is GapSource.JOINT_STATES
    assert opening.age == 0


def test_joint_states_that_stop_leave_no_opening(gripper):
    gripper.make(**TWO_FINGERS)
    assert not isnan(gripper.send(['finger_left', 'finger_right'], [0.01, 0.01]).gap)
    gripper.wait(LIMIT - PERIOD)
    assert not isnan(gripper.current().gap)
    gripper.wait(2 * PERIOD)
    late = gripper.current()
    assert isnan(late.gap) and late.age > LIMIT
    assert gripper.send(['finger_left', 'finger_right'], [0.02, 0.02]).gap == pytest.approx(0.04)


def test_joint_states_of_an_arm_on_the_same_topic_are_neither_an_opening_nor_a_fault(gripper):
    gripper.make(**KNUCKLE)
    gripper.send(['knuckle'], [0.5])
    gripper.send(*ARM)
    assert gripper.current().gap == pytest.approx(0.035) and not gripper.counts.dropped
    for _ in range(round(2 * LIMIT / PERIOD)):  # The arm's joint states do not renew the age of the opening.
        gripper.step()
        gripper.send(*ARM)
    assert isnan(gripper.current().gap)


@pytest.mark.parametrize('names, positions, reason', [
    (['finger_left', 'finger_right'], [0.03], R.WRONG_LENGTH),
    (['finger_left', 'finger_right'], [], R.WRONG_LENGTH),  # The joint state contains only velocities or efforts.
    (['finger_left', 'finger_right'], [0.03, nan], R.NOT_FINITE),
    (['finger_left', 'finger_right'], [0.03, float('inf')], R.NOT_FINITE),
    (['finger_left'], [0.03], R.MISSING_JOINT),
    (['finger_left', 'finger_right', 'finger_left'], [0.03, 0.03, 0.01], R.INCONSISTENT),
    # The sign of the joint position is wrong.
    (['finger_left', 'finger_right'], [-0.03, -0.03], R.IMPLAUSIBLE_OPENING),
    (['finger_left', 'finger_right'], [30.0, 30.0], R.IMPLAUSIBLE_OPENING)])  # The joint positions are in millimetres.
def test_a_malformed_joint_state_is_dropped_and_counted(gripper, names, positions, reason):
    gripper.make(**TWO_FINGERS)
    assert isnan(gripper.send(names, positions).gap)
    good = gripper.send(['finger_left', 'finger_right'], [0.01, 0.01])
    assert good.gap == pytest.approx(0.02)
    after = gripper.send(names, positions).gap
    assert isnan(after) or after == pytest.approx(0.02)
    assert gripper.counts.dropped == {reason: 2}


def test_diagnostics_report_the_opening_and_what_was_dropped(gripper, caplog):
    caplog.set_level(logging.INFO)
    seen = []
    gripper.publishing.create_subscription(DiagnosticArray, '/diagnostics', lambda array: seen.extend(array.status), 10)
    gripper.make(**KNUCKLE)

    def wait_for(level):
        seen.clear()
        end = gripper.steady() + TIMEOUT
        while not any(status.level == level for status in seen):
            assert gripper.steady() < end, seen
            gripper.step()
            gripper.send(*state)
        status = next(status for status in seen if status.level == level)
        assert status.name == '/grasp: opening'
        return {each.key: each.value for each in status.values}
    state = ['knuckle_joint'], [0.5]
    values = wait_for(DiagnosticStatus.STALE)
    assert values['source'] == 'not_known' and int(values['dropped_missing_joint']) > 0
    state = ['knuckle'], [0.5]
    values = wait_for(DiagnosticStatus.OK)
    logged = [record.getMessage() for record in caplog.records if 'opening of the gripper' in record.getMessage()]
    assert 'is not known' in logged[0] and logged[-1] == 'the opening of the gripper is known: 35.0 mm'
    assert values['gap_m'] == '0.0350' and values['source'] == 'joint_states' and float(values['age_s']) < LIMIT


@pytest.mark.parametrize('opening, words', [
    (UNKNOWN_OPENING, 'no joint'), (Opening(nan, GapSource.TF, 2.0), '2.0 s old'),
    (Opening(nan, GapSource.TF, inf), 'stamps')])
def test_the_diagnostic_has_the_reason(opening, words):
    status = opening_status('/grasp', opening, total(()), total(()), 'no joint')
    assert status.level == DiagnosticStatus.STALE and words in status.message


def test_two_controllers_with_contradictory_stamps_give_no_opening(gripper):
    """The joint states of the two controllers alternate.

    The stamps of the two controllers disagree, so their joint states give no present opening.
    """
    gripper.make(**KNUCKLE)
    first, second = Sender(gripper, 1.7e9), Sender(gripper, 1.7e9 - 5.0)
    for _ in range(60):
        assert isnan(first.send(0.2).gap) and isnan(second.send(0.8).gap)


def test_a_nan_of_another_joint_is_not_ours(gripper):
    gripper.make(**KNUCKLE)
    assert gripper.send(['knuckle', 'elbow'], [0.5, nan]).gap == pytest.approx(0.035)


class Sender:
    """Sends one joint state per PERIOD, stamped by another clock, as a controller does."""

    def __init__(self, gripper, clock):
        self.gripper = gripper
        self.shift = clock - gripper.steady()

    def send(self, angle=0.5):
        self.gripper.step()
        return self.gripper.send(['knuckle'], [angle], self.gripper.steady() + self.shift)

    def send_until_known(self, angle=0.5):
        return self.gripper.until_known(lambda: self.send(angle))


@pytest.mark.parametrize('step', [-3600.0, 3600.0])
def test_a_jump_of_the_clock_never_keeps_an_old_opening_and_has_a_limited_effect(gripper, step):
    gripper.make(**KNUCKLE)
    sender = Sender(gripper, 1.7e9)
    sender.send_until_known(0.2)
    sender.shift += step
    for _ in range(20):
        assert sender.send(0.8).gap in (pytest.approx(0.005), pytest.approx(nan, nan_ok=True))
    assert sender.send_until_known(0.8).gap == pytest.approx(0.005)
    gripper.wait(LIMIT + PERIOD)
    assert isnan(gripper.current().gap)


def test_joint_states_that_were_held_back_give_no_opening(gripper):
    gripper.make(**KNUCKLE)
    sender = Sender(gripper, 1.7e9)
    sender.send_until_known()
    stamps = [gripper.steady() + sender.shift + 0.01 * i for i in range(10)]
    gripper.wait(1.0)
    for stamp in stamps:  # All joint states of the list arrive at once.
        assert isnan(gripper.send(['knuckle'], [0.5], stamp).gap)
    assert gripper.current().age > 0.8
    assert sender.send_until_known().gap == pytest.approx(0.035)


@pytest.mark.parametrize('more', [{}, {'use_sim_time': True}])
def test_a_repeated_measurement_grows_old(gripper, more):
    gripper.make(**KNUCKLE, **more)
    sender = Sender(gripper, 1.7e9)
    sender.send_until_known()
    stamp = gripper.steady() + sender.shift
    for _ in range(round(2 * LIMIT / PERIOD)):
        gripper.step()
        opening = gripper.send(['knuckle'], [0.5], stamp)
    assert isnan(opening.gap) and opening.age > LIMIT
    assert sender.send_until_known().gap == pytest.approx(0.035)


@pytest.mark.parametrize('speed', [0.2, 3.0])
def test_simulated_time_may_run_at_another_speed(gripper, speed):
    gripper.make(**KNUCKLE, use_sim_time=True)
    begun, opening = gripper.steady(), UNKNOWN_OPENING
    while isnan(opening.gap):
        gripper.step()
        passed = gripper.steady() - begun
        assert passed < TIMEOUT, 'not known'
        opening = gripper.send(['knuckle'], [0.5], 10 + speed * passed)
    assert opening.gap == pytest.approx(0.035) and opening.age < LIMIT


def test_a_parameter_is_live_and_holds_until_it_is_set_again(gripper):
    gripper.make()
    assert gripper.current() is UNKNOWN_OPENING

    def set_gap(value):
        return gripper.node.set_parameters([Parameter('gap', value=value)])[0].successful
    assert set_gap(0.04)
    gripper.wait(2 * LIMIT)
    assert gripper.current().gap == 0.04 and gripper.current().source is GapSource.PARAMETER
    assert gripper.current().age == pytest.approx(2 * LIMIT)
    assert set_gap(0.02) and gripper.current().gap == 0.02
    assert gripper.current().age == 0
    assert not set_gap(nan) and not set_gap(1.5) and not set_gap('wide') and gripper.current().gap == 0.02
    assert set_gap(-1.0) and isnan(gripper.current().gap) and gripper.current().source is GapSource.NOT_KNOWN


@pytest.mark.parametrize('parameters', [TWO_FINGERS, {'gap_source': 'none'}])
def test_a_gap_that_nothing_reads_is_refused_at_run_time(gripper, parameters):
    gripper.make(**parameters)
    result, = gripper.node.set_parameters([Parameter('gap', value=0.04)])
    assert not result.successful and 'gap_source' in result.reason
    assert isnan(gripper.current().gap)


@pytest.mark.parametrize('parameters, where', [
    ({'gap_source': 'guess'}, 'gap_source'), ({'gap_source': 'none', 'gap': 0.04}, 'gap'),
    ({**TWO_FINGERS, 'gap': 0.04}, 'gap'), ({'gap_source': 'joint_states'}, 'gap_joints'),
    ({'gap_source': 'joint_states', 'gap_joints': ['a', 'a']}, 'gap_joints'), ({**KNUCKLE, 'gap_scale': 0.0}, 'scale'),
    ({'gap_source': 'tf'}, 'gap_frames'), ({'gap_source': 'tf', 'gap_frames': ['a', '/a']}, 'gap_frames'),
    ({'gap': 0.04, 'gap_scale': 2.0}, 'parameter gap_scale: expected no value with gap_source parameter, got 2.0'),
    ({'gap_scale': 0.0}, 'got 0.0. Remove it, or set gap_source to joint_states or tf'),
    ({'gap_source': 'none', 'gap_offset': 0.01}, 'parameter gap_offset'), ({'gap_joints': ['a']}, 'gap_joints'),
    ({**TWO_FINGERS, 'gap_frames': ['a', 'b']}, 'parameter gap_frames')])
def test_parameters_that_do_not_fit_the_source_are_refused(gripper, parameters, where):
    with pytest.raises(ConfigurationError, match=where):
        gripper.make(**parameters)
