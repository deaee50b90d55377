"""Tests for the grasp of two pads, with geometry computed by hand and with the timing of holding and withdrawal.

A reader of the latest state must never mistake "not seen" for "empty", nor old results for current ones.
"""

from math import pi

import numpy as np
import pytest

from tactile_node.errors import ConfigurationError
from tactile_node.grasp.gripper import Gripper, PadPose
from tactile_node.grasp.steadiness import SteadinessSettings
from tactile_node.grasp.tracker import GraspContact, GraspSettings, GraspTracker, SideResult, SideState

# The left pad faces +y, and its x axis is the x axis of the gripper. The right pad faces -y.
LEFT, RIGHT = PadPose((0.0, 0.0, 0.0), (-pi / 2, 0.0, 0.0)), PadPose((0.0, 0.0, 0.0), (pi / 2, 0.0, 0.0))
SETTINGS = GraspSettings(Gripper(LEFT, RIGHT), SteadinessSettings(max_creep=0.0005, slip=0.001), min_hold=0.2,
                         max_skew=0.05, max_age=0.25)
# Position resolution of a result [m].
RESOLUTION = 0.0002
# Time between two results [s].
PERIOD = 0.02
# Delay from acquisition to arrival [s].
PATH = 0.01
# Time until a grasp is stable [s]. At max_creep and without noise, a contact moves 1.5 resolutions in this time.
STABLE_AFTER = 0.6


def touch(time, name='circle', centre=(0.01, 0.0), **changes):
    return SideResult(time, SideState.TOUCHED, name, centre, RESOLUTION)._replace(**changes)


def empty(time):
    return SideResult(time, SideState.EMPTY)


def unseen(time):
    return SideResult(time, SideState.UNSEEN, 'unknown')


def run(tracker, times, gap=0.04, left=touch, right=touch):
    """Feed results of both sides, each received PATH after its acquisition, and return the last state."""
    for time in times:
        tracker.update('left', left(time), time + PATH)
        tracker.update('right', right(time), time + PATH)
    return tracker.state(time + PATH, gap)


def until(end, begin=0.0):
    return np.arange(begin, end, PERIOD)


def test_opposite_contacts_make_a_straight_line_as_wide_as_the_gap():
    state = run(GraspTracker(SETTINGS), [0.0])
    assert state.contact is GraspContact.TWO_SIDED and state.fresh and state.same_shape
    assert state.line.left == pytest.approx([0.01, -0.02, 0])
    assert state.line.right == pytest.approx([0.01, 0.02, 0])
    assert state.line.axis == pytest.approx([0, 1, 0])
    assert (state.line.width, state.line.offset, state.line.misalignment) == pytest.approx((0.04, 0, 0))
    assert state.line.midpoint == pytest.approx([0.01, 0, 0])


# Touched sides

E, T, U, N = SideState.EMPTY, SideState.TOUCHED, SideState.UNSEEN, SideState.NOT_KNOWN
CONTACT = {(E, E): GraspContact.NO_CONTACT, (E, T): GraspContact.ONE_SIDED, (T, T): GraspContact.TWO_SIDED,
           (E, U): GraspContact.UNSEEN, (T, U): GraspContact.UNSEEN, (U, U): GraspContact.UNSEEN,
           (E, N): GraspContact.NOT_KNOWN, (T, N): GraspContact.NOT_KNOWN, (U, N): GraspContact.NOT_KNOWN}
RESULT = {E: empty, T: touch, U: unseen}


@pytest.mark.parametrize(('states', 'expected'), CONTACT.items())
@pytest.mark.parametrize('mirrored', [False, True])
def test_the_contact_state_follows_from_the_states_of_both_sides(states, expected, mirrored):
    tracker = GraspTracker(SETTINGS)
    states = states[::-1] if mirrored else states
    for side, state in zip(('left', 'right'), states):
        if state is not N:
            tracker.update(side, RESULT[state](0.0), PATH)
    state = tracker.state(PATH)
    assert state.side_states == states and state.contact is expected
    assert state.fresh == (N not in states)
    assert (state.line is not None) == (expected is GraspContact.TWO_SIDED) and not state.stable


@pytest.mark.parametrize('state', [T, E])
def test_a_result_that_is_too_old_is_unseen(state):
    """A result that arrives after a long delay also counts as unseen."""
    tracker = GraspTracker(SETTINGS)
    for time in until(0.3):
        tracker.update('left', touch(time), time + PATH)
        tracker.update('right', RESULT[state](time), time + 0.26)
        found = tracker.state(time + 0.26)
    assert found.side_states[1] is U and found.contact is GraspContact.UNSEEN and not found.fresh


def test_a_result_of_unknown_age_is_unseen():
    for result in (empty, touch):
        tracker = GraspTracker(SETTINGS)
        tracker.update('left', empty(0.0), 0.0)
        tracker.update('right', result(-np.inf), 0.0)
        state = tracker.state(0.0)
        assert state.side_states == (E, U) and state.contact is GraspContact.UNSEEN and not state.fresh


@pytest.mark.parametrize('stopped', [('left', 'right'), ('left',), ('right',)])
@pytest.mark.parametrize('period', [0.01, 0.02, 0.05, 0.1])
def test_freshness_ends_when_the_results_of_a_side_stop(stopped, period):
    """A reader must learn of the silence within 3 periods, or within 0.1 s if that is longer.

    The tracker uses less than 80 % of this time and leaves the rest for sending the message.
    """
    tracker = GraspTracker(SETTINGS)
    last = run(tracker, np.arange(0, 3, period))
    assert last.fresh and last.stable
    now = 3 - period + PATH
    bound = max(0.1, 3 * period)
    assert max(tracker.silence_limit(side) for side in stopped) < 0.8 * bound
    for time in np.arange(3, 3 + bound, period):
        for side in {'left', 'right'} - set(stopped):
            tracker.update(side, touch(time), time + PATH)
    state = tracker.state(now + 0.8 * bound)
    assert not (state.fresh or state.stable) and state.line is None and state.contact is GraspContact.UNSEEN
    assert [found is U for found in state.side_states] == [side in stopped for side in ('left', 'right')]


def test_sides_of_different_times_are_not_fresh():
    tracker = GraspTracker(SETTINGS)
    for time in until(1.0):
        tracker.update('left', touch(time), time + PATH)
        tracker.update('right', touch(time - 0.06), time + PATH)
        state = tracker.state(time + PATH)
    assert not state.fresh and not state.stable and state.contact is GraspContact.TWO_SIDED and state.line is None


# Holding

def test_a_grasp_is_stable_once_it_has_held():
    tracker, times = GraspTracker(SETTINGS), until(1.0)
    states = [run(tracker, [time]) for time in times]
    assert [state.stable for state in states] == [time > STABLE_AFTER + 1e-9 for time in times]
    assert states[-1].held == pytest.approx(0.98) and states[-1].creep == pytest.approx(0.0, abs=1e-9)
    assert np.isnan(states[0].creep)


ENDING = {'shape': lambda t: touch(t, 'square'), 'slip': lambda t: touch(t, centre=(0.0112, 0.0)), 'loss': empty}
UNCERTAIN = {'no centre': lambda t: touch(t, centre=None), 'creep hidden': lambda t: touch(t, hides_creep=True),
             'hidden': unseen, 'age not known': lambda t: touch(-np.inf)}


@pytest.mark.parametrize('name', [*ENDING, *UNCERTAIN])
def test_one_disturbed_result_withdraws_stability_at_once(name):
    tracker, disturbed = GraspTracker(SETTINGS), (ENDING | UNCERTAIN)[name]
    assert run(tracker, until(1.0)).stable
    state = run(tracker, [1.0], right=disturbed)
    assert not state.stable and not state.held > 0.0


@pytest.mark.parametrize('name', ENDING)
def test_another_shape_a_slip_or_a_loss_restarts_the_hold(name):
    tracker = GraspTracker(SETTINGS)
    run(tracker, until(1.0))
    run(tracker, [1.0], right=ENDING[name])
    after = run(tracker, until(1.13, begin=1.02))
    assert not after.stable and after.held == pytest.approx(0.1)


@pytest.mark.parametrize('name', UNCERTAIN)
def test_a_single_result_that_shows_nothing_only_suspends_it(name):
    """A single uncertain result only suspends the grasp, like a lost result.

    If uncertain results continue, the hold starts again.
    """
    tracker, disturbed = GraspTracker(SETTINGS), UNCERTAIN[name]
    run(tracker, until(1.0))
    run(tracker, [1.0], right=disturbed)
    assert run(tracker, [1.02]).stable
    assert not any(run(tracker, [time], right=disturbed).stable for time in until(1.2, begin=1.04))
    state = run(tracker, [1.2])
    assert not state.stable and state.held == 0.0


def test_a_result_that_is_a_bound_is_marked():
    state = run(GraspTracker(SETTINGS), until(3.0), left=lambda t: touch(t, is_bound=True))
    assert state.line is not None and state.line_is_bound and state.stable


def test_a_contact_that_could_creep_unseen_is_never_stable():
    """A bar across the whole pad may slide along its length without a change in its visible part."""
    state = run(GraspTracker(SETTINGS), until(3.0), left=lambda t: touch(t, hides_creep=True))
    assert state.fresh and state.line is not None and not state.stable and np.isnan(state.creep)


def test_results_that_were_held_back_are_never_fresh():
    tracker = GraspTracker(SETTINGS)
    assert run(tracker, until(2.0)).stable
    states = []
    for time in until(2.2, begin=2.0):
        for side in ('left', 'right'):
            tracker.update(side, touch(time), 7.0 + time / 1000)
            states.append(tracker.state(7.0 + time / 1000))
    assert not any(state.fresh or state.stable or state.line for state in states)
    assert {state.contact for state in states} == {GraspContact.UNSEEN}


def test_wrong_settings_are_refused():
    with pytest.raises(ConfigurationError, match='face each other'):
        Gripper(LEFT, LEFT)
    with pytest.raises(ConfigurationError):
        PadPose((0.0, 0.0, float('nan')))
    for wrong in ({'max_skew': 0.0}, {'max_age': np.nan}, {'min_hold': -1.0}):
        with pytest.raises(ConfigurationError):
            GraspSettings(**wrong)
    with pytest.raises(ConfigurationError):
        GraspTracker().update('top', touch(0.0), 0.0)


def test_without_an_opening_only_the_offset_is_known():
    line = run(GraspTracker(SETTINGS), [0.0], gap=np.nan, right=lambda t: touch(t, centre=(0.04, 0.0))).line
    assert line.offset == pytest.approx(0.03)
    assert np.isnan([line.width, line.misalignment, *line.left, *line.midpoint, *line.axis]).all()


def test_freshness_outlives_a_lost_result():
    tracker = GraspTracker(SETTINGS)
    run(tracker, until(2.0))
    assert tracker.state(2.0 - PERIOD + PATH + 2.5 * PERIOD).fresh
    assert run(tracker, [2.0 + 2 * PERIOD]).stable


def test_min_hold_may_ask_for_more():
    tracker = GraspTracker(GraspSettings(min_hold=1.5))
    assert [run(tracker, [time]).stable for time in until(2.0)] == [time >= 1.5 - 1e-9 for time in until(2.0)]


def test_back_after_a_silence_it_holds_from_then():
    tracker = GraspTracker(SETTINGS)
    assert run(tracker, until(1.0)).stable
    for time in until(1.2, begin=1.0):
        tracker.update('left', touch(time), time + PATH)
    tracker.update('right', touch(1.18), 1.18 + PATH)
    state = tracker.state(1.18 + PATH)
    assert state.fresh and not state.stable and state.held == 0.0


def test_an_outage_after_a_single_result_is_no_period():
    """Results from before an outage say nothing about the object that is held afterwards."""
    tracker = GraspTracker(SETTINGS)
    run(tracker, [0.0])
    state = run(tracker, [60.0])
    assert state.held == 0.0 and tracker.silence_limit('left') < 0.1
    state = run(tracker, until(60.0 + 0.3, begin=60.0 + PERIOD))
    assert 0 < state.held < 0.3 and not state.stable


def test_unknown_shapes_are_not_the_same_shape():
    assert not run(GraspTracker(SETTINGS), [0.0], 0.04, *[lambda t: touch(t, 'unknown')] * 2).same_shape
    assert run(GraspTracker(SETTINGS), [0.0], 0.04, *[lambda t: touch(t, 'my_hexagon')] * 2).same_shape
    assert not run(GraspTracker(SETTINGS), [0.0], 0.04, empty, empty).same_shape
