"""The simulated gripper and its physics.

The tests compare pressures with known solutions, and grasps with the limits of friction. Further tests use the gripper
as a separate process, as other programs do.
"""

import subprocess
import sys
from contextlib import contextmanager
from importlib.util import find_spec
from math import pi, radians, sqrt

import numpy as np
import pytest
from rclpy.action import ActionClient
from ros_bench import RosBench

from bench.planner_world import PITCH, ROWS, STIFFNESS, noisy
from examples.simulated_gripper.console import obey
from examples.simulated_gripper.drive import DELAY, Command
from examples.simulated_gripper.items import ITEMS
from examples.simulated_gripper.pressures import pressures
from examples.simulated_gripper.session import JOINT, Bench
from examples.simulated_gripper.world import (
    AIM,
    GRAVITY,
    MAX_SHIFT,
    MAX_TURN,
    SIDES,
    Outcome,
    Place,
    World,
    random_place,
)
from tactile_node.errors import ConfigurationError
from tactile_node.grasp.frame_tree import Transform
from tactile_node.grasp.gripper import PadPose
from tactile_node.gripper.rules.holding import SWAY_TIME
from tactile_node.pose.events import Moving
from tactile_node.pose.motion import MotionFollower
from tactile_node.pose.pipeline import ContactPipeline, Taxels, sight_of
from tactile_node.shape.methods import make_recogniser
from tactile_skin.msg import Grasp

MIDDLE = (ROWS - 1) / 2 * PITCH
ABORTED, CANCELED, SUCCEEDED = 6, 5, 4  # From action_msgs/msg/GoalStatus.
physics = pytest.mark.skipif(find_spec('mujoco') is None,
                             reason='MuJoCo is not installed: pip install -r requirements/bench_physics.txt')


def felt(name, x=0.0, slope=0.0, force=2.0):
    """Return the pressures that an item exerts on a pad.

    The face of the item lies ``x`` [m] from the middle of the pad, and is rotated about y by ``slope`` [rad].
    """
    pose = Transform(PadPose(rpy=(0.0, slope, 0.0)).rotation, np.array((MIDDLE + x, MIDDLE, ITEMS[name].length / 2)))
    return pressures(ITEMS[name], pose, force)


def gripped(name='square', effort=2.0, place=AIM, hand=AIM):
    world = World(ITEMS[name], place)
    world.move(**hand._asdict())
    world.step(1.0)
    world.command(Command(0.0, effort=effort))
    world.step(2.0)
    return world


def lifted(name='square', effort=2.0):
    world = gripped(name, effort)
    world.move(lift=0.08)
    world.step(2.5)
    return world


# The bar and the bottle are left out, because they extend beyond the pad.
@pytest.mark.parametrize('name', sorted({*ITEMS} - {'bar', 'bottle'}))
@pytest.mark.parametrize('force', [0.0, 0.5, 4.0])
def test_the_taxels_carry_the_force(name, force):
    assert felt(name, force=force).sum() * PITCH**2 == pytest.approx(force, rel=1e-3)
    assert not felt(name, x=0.1, force=force).any()


def test_a_square_in_the_middle_is_even_and_symmetric():
    found = felt('square')
    np.testing.assert_allclose(found, found[::-1])
    np.testing.assert_allclose(found, found.T)
    np.testing.assert_allclose(found[6:10, 6:10], 2.0 / 0.016**2, rtol=1e-6)


def test_an_item_half_off_the_pad_presses_the_other_half_twice():
    found = felt('square', x=0.016)
    assert not found[:, :10].any()
    np.testing.assert_allclose(found[6:10, 14], 2 * 2.0 / 0.016**2, rtol=0.01)


def test_a_ball_presses_as_on_a_foundation():
    """For a Winkler foundation, F = pi k R d**2.

    The pressure is k d in the middle and falls to 0 at the radius sqrt(2 R d).
    """
    radius, force = 0.018, 2.0
    depth = sqrt(force / (pi * STIFFNESS * radius))
    found, edge = felt('ball', force=force), sqrt(2 * radius * depth)
    distance = np.hypot(*np.meshgrid(*[np.arange(ROWS) * PITCH - MIDDLE] * 2))
    np.testing.assert_allclose(found[7:9, 7:9], STIFFNESS * depth, rtol=0.1)
    assert found[distance > edge + 1.5 * PITCH].max() < 0.01 * STIFFNESS * depth
    assert found[distance < edge - PITCH].min() > 0.05 * STIFFNESS * depth


def test_an_oblique_face_presses_one_side_more():
    found = felt('square', slope=0.01)  # The face approaches the pad along x.
    np.testing.assert_allclose(np.diff(found[7, 6:10]), STIFFNESS * 0.01 * PITCH, rtol=0.01)


def middle_of(values):
    """Return the centre of pressure along x and y [m]."""
    y, x = np.indices(values.shape) * PITCH
    return np.array(((x * values).sum(), (y * values).sum())) / values.sum()


@pytest.mark.parametrize('load', [(0.3, 0.0), (0.0, -0.2), (0.3, 0.4)])
def test_a_load_along_the_pad_moves_the_pressure_towards_the_load(load):
    """Under a skin of 4 mm with G = 25 kPa, a face of 16 mm moves by h T / (G A), and its pressure by h T / N more."""
    pose = Transform(np.eye(3), np.array((MIDDLE, MIDDLE, ITEMS['square'].length / 2)))
    loaded = pressures(ITEMS['square'], pose, 2.0, load)
    moved = 0.004 * np.array(load) * (1 / 2.0 + 1 / (25e3 * 0.016**2))
    np.testing.assert_allclose(middle_of(loaded) - middle_of(felt('square')), moved, atol=0.05e-3)
    assert loaded.sum() * PITCH**2 == pytest.approx(2.0, rel=1e-3)


def test_places_are_within_bounds_and_repeat():
    drawn = [random_place(seed) for seed in range(200)]
    assert drawn == [random_place(seed) for seed in range(200)]
    assert MAX_SHIFT * 0.9 < max(np.hypot(each.x, each.y) for each in drawn) <= MAX_SHIFT
    assert MAX_TURN * 0.9 < max(abs(each.yaw) for each in drawn) <= MAX_TURN


def test_without_mujoco_the_remedy_is_named(monkeypatch):
    monkeypatch.setattr('examples.simulated_gripper.world.mujoco', None)
    with pytest.raises(ConfigurationError, match='requirements/bench_physics.txt'):
        World(ITEMS['square'])


@physics
@pytest.mark.parametrize(('name', 'effort', 'outcome'), [
    ('square', 0.5, Outcome.GRIPPED), ('square', 10.0, Outcome.GRIPPED), ('fragile', 5.0, Outcome.GRIPPED),
    ('fragile', 7.0, Outcome.BROKEN)])
def test_at_rest_both_pads_press_with_the_effort(name, effort, outcome):
    world = gripped(name, effort)
    assert world.drive.is_stalled and not world.drive.is_at_goal and world.outcome is outcome
    assert [*world.forces.values(), world.effort] == pytest.approx([effort] * 3, rel=0.02)


@physics
@pytest.mark.parametrize('name', ITEMS)
def test_the_fingers_do_not_enter_the_item(name):
    world = gripped(name)
    assert world.outcome is Outcome.GRIPPED
    assert 0 < -min(contact.dist for contact in world.data.contact) < 0.001


@physics
@pytest.mark.parametrize(('name', 'effort', 'outcome'), [
    ('square', 2.0, Outcome.HELD), ('square', 0.55, Outcome.HELD), ('square', 0.45, Outcome.FREE),
    ('square', 0.2, Outcome.FREE), ('slippery', 2.0, Outcome.FREE), ('slippery', 3.0, Outcome.HELD)])
def test_two_pads_carry_50_grams_by_friction(name, effort, outcome):
    """The object weighs 0.49 N.

    With a friction coefficient of 0.5, each pad needs at least 0.49 N. With a friction coefficient of 0.1, each pad
    needs at least 2.45 N.
    """
    assert lifted(name, effort).outcome is outcome


@physics
def test_a_lift_moves_the_pressure_down_by_the_weight_on_each_pad():
    """The rows of the left pad run downwards, and the rows of the right pad run upwards."""
    before, after = gripped(), lifted()
    for side, down in zip(SIDES, (1, -1)):
        np.testing.assert_allclose(after.load(side), (0, down * 0.05 * GRAVITY / 2), atol=0.01)
        shift = middle_of(after.pressures(side)) - middle_of(before.pressures(side))
        assert shift == pytest.approx((0, down * 0.004 * 0.245 * (1 / 2.0 + 1 / (25e3 * 0.016**2))), abs=0.05e-3)


@physics
@pytest.mark.slow
@pytest.mark.parametrize('name', ['square', *(pytest.param(name, marks=pytest.mark.long) for name in sorted(
    {*ITEMS} - {'square', 'slippery', 'bottle'}))])  # the slippery block and the heavy bottle slide at this force
def test_a_lift_and_a_shake_let_no_hold_press_harder(name):
    """A hold that presses harder may break the item. It answers to a slide that is reported for SWAY_TIME."""
    world, recogniser, random = gripped(name), make_recogniser(), np.random.default_rng(5)
    pads = {side: (ContactPipeline(recogniser), MotionFollower()) for side in SIDES}

    def movements(rest):
        """Return all movements that the pads report until the hand has rested for ``rest`` seconds.

        Also return the longest time for which a slide is reported.
        """
        moving, longest, still = Moving.NOT_KNOWN, 0.0, world.now
        end = world.now + rest
        while world.now < end:
            end = world.now + rest if world.is_moving else end
            world.step(0.02)
            now = Moving.NOT_KNOWN
            for side, (pipeline, motions) in pads.items():
                found = pipeline.find(noisy(world.pressures(side), random), Taxels(PITCH, 'Pa'))
                now |= motions.update(sight_of(pipeline.recognise(found, world.now), world.now)).moving
            moving |= now
            still = still if Moving.SLIDING in now else world.now
            longest = max(longest, world.now - still)
        return moving, longest
    movements(0.8)
    before = {side: world.item_in(side).translation for side in SIDES}
    world.move(lift=0.1)
    _, slid_in_lift = movements(0.3)
    world.shake(1.0)
    in_shake, slid_in_shake = movements(0.5)
    assert world.outcome is Outcome.HELD
    for side in SIDES:
        assert np.hypot(*(world.item_in(side).translation - before[side])[:2]) < 0.3e-3
    assert Moving.SHIFTING in in_shake and max(slid_in_lift, slid_in_shake) < SWAY_TIME


@physics
@pytest.mark.parametrize(('effort', 'outcome'), [(0.7, Outcome.DROPPED), (2.0, Outcome.HELD)])
def test_a_shake_of_2_g_loses_a_weakly_held_item(effort, outcome):
    world, speeds = lifted(effort=effort), []
    assert world.outcome is Outcome.HELD
    world.shake(2.0, seconds=1.0)
    while world.is_moving:
        world.step(0.001)
        speeds.append(world.data.joint('lift').qvel[0])
    assert np.abs(np.diff(speeds)).max() / 0.001 == pytest.approx(2 * GRAVITY, rel=0.1)
    world.step(0.5)
    assert world.outcome is outcome


@physics
@pytest.mark.parametrize(('effort', 'outcome'), [(4.0, Outcome.HELD), (2.0, Outcome.DROPPED)])
def test_a_pull_of_3_newtons_slides_an_item_that_friction_does_not_carry(effort, outcome):
    world = lifted(effort=effort)  # The object weighs 0.5 N.
    world.pull(0.01, 3.0)
    world.step(4.0)
    assert world.outcome is outcome


@physics
def test_the_gripper_obeys_late_closes_at_its_speed_and_stops_where_it_is():
    world, gaps = World(ITEMS['square']), []
    world.command(Command(0.0, velocity=0.05))
    for seconds in (DELAY - 0.002, 0.3, 0.2, 0.3):
        world.step(seconds)
        gaps.append(world.gap)
        if len(gaps) == 3:
            world.stop_gripper()
    assert gaps[0] == pytest.approx(0.09, abs=1e-5)
    assert gaps[1] - gaps[2] == pytest.approx(0.05 * 0.2, rel=0.02)
    assert gaps[2] - gaps[3] == pytest.approx(0.05 * DELAY, abs=5e-4)
    world = lifted()
    world.stop_gripper()
    world.step(1.0)
    assert world.outcome is Outcome.HELD and world.forces['left'] == pytest.approx(2.0, rel=0.02)


@physics
@pytest.mark.parametrize('seed', range(4))
def test_the_hand_corrects_an_error(seed):
    place = random_place(seed)
    assert World(ITEMS['square'], place).off_hand() == pytest.approx(place, abs=1e-4)
    world = gripped(place=place, hand=place)
    assert world.off_hand() == pytest.approx(AIM, abs=radians(0.1))
    for side in SIDES:  # without the load by which the stand carries the item, because a load moves the pressure
        taxels = pressures(world.item, world.item_in(side), world.forces[side])
        assert taxels.sum() * PITCH**2 == pytest.approx(2.0, rel=0.05)
        centre = [np.arange(ROWS) @ taxels.sum(axis) / taxels.sum() for axis in (0, 1)]
        assert centre == pytest.approx([7.5, 7.5], abs=0.2)


@physics
def test_both_pads_see_an_item_where_it_is():
    world = gripped('right_triangle', place=Place(x=0.006))
    left, right = map(world.pressures, ('left', 'right'))
    assert [np.arange(ROWS) @ each.sum(0) / each.sum() for each in (left, right)] == pytest.approx([10.5] * 2, abs=0.2)
    np.testing.assert_allclose(left[::-1], right, atol=0.05 * left.max())  # The rows of this pad run upwards.


@physics
def test_known_orders_are_executed_and_unknown_orders_get_the_list():
    world = World(ITEMS['square'])
    for line in ('close 3', 'move lift=0.02', ''):
        assert obey(world, line).startswith(world.outcome.value)
        world.step(2.0)
    assert world.outcome is Outcome.HELD and world.forces['left'] == pytest.approx(3.0, rel=0.02)
    for line in ('fly', 'move z=1', 'close 99', 'close hard', 'place'):
        assert 'expected' in obey(world, line)


@contextmanager
def bringup(channel):
    process = subprocess.Popen([f'{sys.prefix}/bin/tactile', 'bringup', '--interface', 'slcan', '--channel', channel,
                                '--pads', 'left,right', '--node-id', '32,64', '--gap-source', 'joint_states',
                                '--gap-joints', JOINT])
    yield
    process.terminate()
    process.wait(20)


@physics
@pytest.mark.bus
@pytest.mark.ros
def test_driver_and_perception_of_another_process_report_the_grasp(ros, tmp_path):
    world, grasps = World(ITEMS['square']), []
    ros.enter_context(Bench(world, str(tmp_path / 'skin')))
    ros.enter_context(bringup(str(tmp_path / 'skin')))
    bench = RosBench(ros)
    bench.add('planner').create_subscription(Grasp, 'grasp', grasps.append, 1)
    bench.until(lambda: grasps and grasps[-1].contact == Grasp.NO_CONTACT and grasps[-1].gap > 0.0899)
    world.command(Command(0.0))
    bench.until(lambda: grasps[-1].stable)
    assert grasps[-1].class_name == 'square'
    assert list(grasps[-1].forces) == pytest.approx([2.0, 2.0], rel=0.1)
    assert grasps[-1].gap == pytest.approx(world.gap, abs=1e-4)
    world.command(Command(0.09))
    bench.until(lambda: grasps[-1].contact == Grasp.NO_CONTACT)


@physics
@pytest.mark.bus
@pytest.mark.ros
def test_the_action_is_that_of_a_gripper(ros):
    action = pytest.importorskip('control_msgs.action').ParallelGripperCommand
    ros.enter_context(Bench(World(ITEMS['square'])))
    bench = RosBench(ros)
    client = ActionClient(bench.add('planner'), action, 'hand/gripper_cmd')
    bench.until(client.server_is_ready)

    def answer(future):
        bench.until(future.done)
        return future.result()

    def sent(position, velocity=0.05, effort=2.0):
        goal = action.Goal()
        goal.command.position, goal.command.velocity, goal.command.effort = [position], [velocity], [effort]
        return answer(client.send_goal_async(goal))

    def ended(handle):
        found = answer(handle.get_result_async())
        return (found.status, found.result.stalled, found.result.reached_goal), found.result.state.position[0]

    assert not sent(-0.01).accepted
    first, second = sent(0.0), sent(0.08)
    assert ended(first)[0] == (ABORTED, False, False)
    assert ended(second)[0] == (SUCCEEDED, False, True)
    third = sent(0.0, velocity=0.02)
    bench.wait(0.5)
    answer(third.cancel_goal_async())
    assert ended(third) == ((CANCELED, False, False), pytest.approx(0.07, abs=0.008))
    assert ended(sent(0.0)) == ((SUCCEEDED, True, False), pytest.approx(0.0496, abs=3e-4))
