"""Tests that the gripper node describes its own state in /diagnostics and in the text of the outcome NOT_SEEN."""

import math

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from gripper_bench import GripperBench
from virtual_gripper import PERIOD

from tactile_node.gripper.health import gripper_status, unseen_text
from tactile_node.gripper.rules.closing import Outcome
from tactile_node.ros.message_health import MessageCounts
from tactile_skin.msg import Grasp

pytestmark = [pytest.mark.ros, pytest.mark.bus, pytest.mark.usefixtures('control_msgs')]

MAX_AGE = 0.15  # The default [s].


@pytest.fixture
def bench(ros):
    return GripperBench(ros)


def unseen(side):
    def change(message):
        message.contact = Grasp.UNSEEN
        message.side_states[side] = Grasp.SIDE_UNSEEN
        message.forces[side] = math.nan
        return message
    return change


def not_fresh(message):
    message.fresh = False
    return message


def malformed(message):
    message.gap_source = 77
    return message


def refused(bench):
    bench.wait(MAX_AGE + 2 * PERIOD)
    outcome = bench.close(position=0.0).outcome
    assert outcome.outcome == Outcome.NOT_SEEN and not bench.motor.commands
    return outcome.message


def test_before_bringup_runs_the_text_names_it(ros):
    bench = GripperBench(ros)
    bench.pads.is_silent = True
    restart(bench)
    assert refused(bench) == 'NOT_SEEN: no grasp has been received on /grasp: is bringup running?'


def restart(bench):
    """Replace the node with a new node that has not received any message."""
    bench.node.destroy_node()
    bench.node = bench.add(bench.timed(type(bench.node).__mro__[1])())
    bench.client.until_ready()
    bench.until_joined(lambda: bench.node.count_publishers('/grasp'))
    bench.until_listened()


def test_dropped_grasps_do_not_count_as_silence(bench):
    bench.pads.change = malformed
    restart(bench)
    assert 'every grasp on /grasp was dropped' in refused(bench)


@pytest.mark.parametrize(('change', 'says'), [
    (unseen(0), 'the left pad is unseen'), (unseen(1), 'the right pad is unseen'),
    (lambda message: unseen(0)(unseen(1)(message)), 'the left pad is unseen and the right pad is unseen'),
    (not_fresh, 'not fresh')])
def test_a_pad_that_is_unseen_is_named(bench, change, says):
    bench.pads.change = change
    message = refused(bench)
    assert says in message and message.count('unseen') == says.count('unseen')


def test_a_goal_while_the_pads_are_silent_has_the_age_of_the_grasp(bench):
    bench.pads.is_silent = True
    message = refused(bench)
    assert float(message.split('the grasp is ')[1].split(' s old')[0]) > MAX_AGE


@pytest.mark.parametrize(('age', 'says'), [
    (0.4, 'the grasp is 0.400 s old, but max_age is 0.15 s'), (9.852, 'the grasp is 9.9 s old, because a pad sends no'),
    (math.inf, 'the age of the grasp is not known'), (math.nan, 'the age of the grasp is not known')])
def test_a_late_grasp_and_a_silent_pad_have_different_remedies(age, says):
    """With the bus down, a larger max_age would let the gripper close on old data."""
    text = unseen_text('/grasp', MessageCounts(5, 5, {}), ['/grasp'], Grasp(), age, MAX_AGE)
    assert says in text and ('raise max_age' in text) == (age == 0.4)


def test_two_publishers_are_named(bench):
    bench.add('other').create_publisher(Grasp, '/grasp', 10)
    bench.until_joined(lambda: bench.node.count_publishers('/grasp') == 2)
    message = refused(bench)
    assert '/other' in message and '/pads' in message


FACTS = {'duplicate': '', 'is_served': True, 'work': 'none', 'last': None, 'grasp_age': 0.02}


@pytest.mark.parametrize(('facts', 'level', 'says'), [
    (FACTS, DiagnosticStatus.OK, 'ready'),
    # The outcome LOST concerns the object, not the state of the node.
    (FACTS | {'last': Outcome.LOST}, DiagnosticStatus.OK, 'ready'),
    (FACTS | {'is_served': False}, DiagnosticStatus.WARN, '/arm/gripper_cmd'),
    (FACTS | {'last': Outcome.GRIPPER_SILENT}, DiagnosticStatus.WARN, 'GRIPPER_SILENT'),
    (FACTS | {'last': Outcome.NOT_STOPPED}, DiagnosticStatus.WARN, 'NOT_STOPPED'),
    (FACTS | {'duplicate': 'another one', 'is_served': False}, DiagnosticStatus.ERROR, 'another one')])
def test_the_level_follows_from_the_worst_fact(facts, level, says):
    found = gripper_status('/touch_gripper', '/arm/gripper_cmd', **facts)
    assert (found.name, found.level) == ('/touch_gripper: gripper', level) and says in found.message


def test_the_values_are_facts():
    def values(facts):
        return {each.key: each.value for each in gripper_status('/touch_gripper', '/arm/gripper_cmd', **facts).values}
    assert values(FACTS | {'work': 'hold', 'last': Outcome.TOUCHED}) == {
        'duplicate': 'False', 'served': 'True', 'work': 'hold', 'last_outcome': 'TOUCHED', 'grasp_age_s': '0.020'}
    assert values(FACTS | {'grasp_age': math.inf})['grasp_age_s'] == 'not known'


def test_the_node_publishes_both_entries_once_a_second(ros):
    from diagnostic_msgs.msg import DiagnosticArray
    bench, found = GripperBench(ros), []
    bench.add('monitor').create_subscription(DiagnosticArray, '/diagnostics', lambda message: found.extend(
        message.status), 10)
    bench.until(lambda: found)
    bench.close(position=0.0)
    found.clear()
    bench.wait(2.0)
    names = [each.name for each in found]
    assert names.count('/touch_gripper: gripper') == names.count('/touch_gripper') == 2
    last = next(each for each in reversed(found) if each.name == '/touch_gripper: gripper')
    assert {each.key: each.value for each in last.values}['last_outcome'] == 'TOUCHED'
