"""The grasp of two pads: geometry by hand, holding as a state machine of stamps."""

from math import atan2, pi, sqrt

import numpy as np
import pytest

from tactile_node.errors import ConfigurationError
from tactile_node.grasp.gripper import Gripper, PadPose
from tactile_node.grasp.tracker import GraspContact, GraspSettings, GraspTracker, SideResult
from tactile_node.shape.recognition import Shape

# Left pad looks along +y, its x along the gripper's x; the right one along -y.
LEFT, RIGHT = PadPose((0.0, 0.0, 0.0), (-pi / 2, 0.0, 0.0)), PadPose((0.0, 0.0, 0.0), (pi / 2, 0.0, 0.0))
SETTINGS = GraspSettings(Gripper(LEFT, RIGHT), centre_tolerance=0.001, min_hold=0.2, max_skew=0.05)


def touch(stamp, shape=Shape.CIRCLE, centre=(0.01, 0.0)):
    return SideResult(stamp, shape, centre)


def run(tracker, stamps, gap=0.04, left=touch, right=touch):
    for stamp in stamps:
        tracker.update('left', left(stamp), gap)
        state = tracker.update('right', right(stamp), gap)
    return state


def test_roll_pitch_yaw_are_about_fixed_axes():
    pose = PadPose((1.0, 2.0, 3.0), (pi / 2, 0.0, pi / 2))  # z to -y, then -y to x
    assert pose.normal == pytest.approx([1, 0, 0])
    assert pose.place((1.0, 0.0), 0.0) == pytest.approx([1, 3, 3])


def test_opposite_contacts_make_a_straight_line_as_wide_as_the_gap():
    state = run(GraspTracker(SETTINGS), [0.0])
    assert state.contact is GraspContact.TWO_SIDED and state.fresh and state.same_shape
    assert state.line.left == pytest.approx([0.01, -0.02, 0])
    assert state.line.right == pytest.approx([0.01, 0.02, 0])
    assert state.line.axis == pytest.approx([0, 1, 0])
    assert (state.line.width, state.line.offset, state.line.misalignment) == pytest.approx((0.04, 0, 0))
    assert state.line.midpoint == pytest.approx([0.01, 0, 0])


def test_contacts_that_do_not_face_each_other_are_measured():
    state = run(GraspTracker(SETTINGS), [0.0], right=lambda t: touch(t, centre=(0.04, 0.0)))
    assert state.line.offset == pytest.approx(0.03)
    assert state.line.width == pytest.approx(sqrt(0.03**2 + 0.04**2))
    assert state.line.misalignment == pytest.approx(atan2(3, 4))


def test_a_grasp_is_stable_once_it_has_held():
    tracker, stamps = GraspTracker(SETTINGS), np.arange(0, 0.31, 0.02)
    states = [run(tracker, [stamp]) for stamp in stamps]
    assert [state.stable for state in states] == [stamp >= 0.2 - 1e-9 for stamp in stamps]
    assert states[-1].held == pytest.approx(0.3)


@pytest.mark.parametrize('disturbed', [
    lambda t: touch(t, Shape.SQUARE), lambda t: touch(t, centre=(0.0112, 0.0)),
    lambda t: touch(t, centre=None)])
def test_another_shape_a_slip_or_a_loss_restarts_the_hold(disturbed):
    tracker = GraspTracker(SETTINGS)
    assert run(tracker, np.arange(0, 0.3, 0.02)).stable
    assert not run(tracker, [0.3], right=disturbed).stable
    after = run(tracker, np.arange(0.32, 0.43, 0.02))
    assert not after.stable and after.held == pytest.approx(0.1)


def test_a_slow_creep_is_seen_although_no_step_is_large():
    tracker = GraspTracker(SETTINGS)
    creep = lambda t: touch(t, centre=(0.01 + 0.01 * t, 0.0))  # noqa: E731  0.2 mm a frame, 10 mm/s
    assert not any(run(tracker, [stamp], left=creep).stable for stamp in np.arange(0, 1, 0.02))


def test_small_movements_are_tolerated():
    tracker = GraspTracker(SETTINGS)
    shaken = lambda t: touch(t, centre=(0.01 + 0.0009 * np.cos(round(t / 0.02) * pi), 0.0))  # noqa: E731
    first = SideResult(0.0, Shape.CIRCLE, (0.01, 0.0))
    tracker.update('left', first), tracker.update('right', first)
    assert run(tracker, np.arange(0.02, 0.3, 0.02), left=shaken).stable


def test_a_side_that_falls_silent_makes_the_grasp_stale_not_stable():
    tracker = GraspTracker(SETTINGS)
    assert run(tracker, np.arange(0, 0.3, 0.02)).stable
    for stamp in np.arange(0.3, 0.4, 0.02):
        state = tracker.update('left', touch(stamp), 0.04)
    assert not state.fresh and not state.stable and state.line is None
    assert not tracker.update('right', touch(0.38), 0.04).stable  # back after a silence: holds again from then


def test_one_side_alone_is_one_sided():
    tracker = GraspTracker(SETTINGS)
    assert tracker.update('left', touch(0.0)).contact is GraspContact.ONE_SIDED
    assert tracker.update('right', touch(0.0, Shape.NONE, None)).contact is GraspContact.ONE_SIDED
    assert tracker.update('left', touch(0.01, Shape.NONE, None)).contact is GraspContact.NO_CONTACT


def test_a_clock_set_back_restarts_the_hold():
    tracker = GraspTracker(SETTINGS)
    run(tracker, np.arange(10, 10.3, 0.02))
    assert not run(tracker, [0.0]).stable


def test_unknown_shapes_are_not_the_same_shape():
    unknown = [lambda t: touch(t, Shape.UNKNOWN)] * 2
    state = run(GraspTracker(SETTINGS), [0.0], 0.04, *unknown)
    assert not state.same_shape


def test_wrong_settings_are_refused():
    with pytest.raises(ConfigurationError, match='face each other'):
        Gripper(LEFT, LEFT)
    with pytest.raises(ConfigurationError):
        PadPose((0.0, 0.0, float('nan')))
    with pytest.raises(ConfigurationError):
        GraspSettings(centre_tolerance=0.0)
    with pytest.raises(ConfigurationError):
        GraspTracker().update('top', touch(0.0))
