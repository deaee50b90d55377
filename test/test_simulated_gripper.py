"""The gripper in physics: its pressures against known solutions, its grasps against what friction can carry."""

from importlib.util import find_spec
from math import pi, radians, sqrt

import numpy as np
import pytest

from bench.planner_world import FULL_SCALE, PITCH, ROWS, STIFFNESS
from examples.simulated_gripper.drive import DELAY, Command
from examples.simulated_gripper.items import ITEMS
from examples.simulated_gripper.pressures import pressures
from examples.simulated_gripper.world import AIM, GRAVITY, MAX_SHIFT, MAX_TURN, Outcome, Place, World, random_place
from tactile_node.errors import ConfigurationError, InputError
from tactile_node.grasp.gripper import PadPose, Transform
from tactile_node.skin.layout_file import load_layout

MIDDLE = (ROWS - 1) / 2 * PITCH
physics = pytest.mark.skipif(find_spec('mujoco') is None,
                             reason='no MuJoCo: pip install -r requirements/bench_physics.txt')


def felt(name, x=0.0, y=0.0, rpy=(0.0, 0.0, 0.0), force=2.0):
    """What a pad feels of an item at x, y from its middle [m], whose near side is at the skin."""
    pose = Transform(PadPose(rpy=rpy).rotation, np.array((MIDDLE + x, MIDDLE + y, ITEMS[name].length / 2)))
    return pressures(ITEMS[name], pose, force)


def gripped(name='square', effort=2.0, place=AIM):
    world = World(ITEMS[name], place)
    world.command(Command(0.0, effort=effort))
    world.step(2.0)
    return world


def lifted(name='square', effort=2.0):
    world = gripped(name, effort)
    world.move(lift=0.08)
    world.step(2.5)
    return world


def test_the_pads_are_those_of_the_layout():
    layout = load_layout('sim16x16.yaml')
    assert (layout.rows, layout.cols, layout.pitch) == (ROWS, ROWS, PITCH)


@pytest.mark.parametrize('name', sorted({*ITEMS} - {'bar', 'bottle'}))  # they reach over the edge of the pad
@pytest.mark.parametrize('force', [0.5, 4.0])
def test_the_taxels_carry_the_force(name, force):
    assert felt(name, force=force).sum() * PITCH**2 == pytest.approx(force, rel=1e-3)


def test_nothing_is_felt_without_a_force_or_an_item():
    assert not felt('square', force=0.0).any()
    assert not felt('square', x=0.1).any()


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
    """Winkler: F = pi k R d**2, the pressure k d in the middle falls to 0 at sqrt(2 R d)."""
    radius, force = 0.018, 2.0
    depth = sqrt(force / (pi * STIFFNESS * radius))
    found = felt('ball', force=force)
    distance = np.hypot(*np.meshgrid(*[np.arange(ROWS) * PITCH - MIDDLE] * 2))
    np.testing.assert_allclose(found[7:9, 7:9], STIFFNESS * depth, rtol=0.1)
    assert found[distance > sqrt(2 * radius * depth) + 1.5 * PITCH].max() < 0.01 * STIFFNESS * depth
    assert found[distance < sqrt(2 * radius * depth) - PITCH].min() > 0.05 * STIFFNESS * depth


def test_an_oblique_face_presses_one_side_more():
    slope = 0.01
    found = felt('square', rpy=(0.0, slope, 0.0))  # about y: the face comes nearer along x
    np.testing.assert_allclose(np.diff(found[7, 6:10]), STIFFNESS * slope * PITCH, rtol=0.01)


def test_the_other_pad_sees_the_other_face():
    turned = felt('right_triangle', rpy=(pi, 0.0, 0.0))
    np.testing.assert_allclose(turned[::-1], felt('right_triangle'), atol=1e-9)


def test_places_are_within_bounds_and_repeat():
    drawn = [random_place(seed) for seed in range(200)]
    assert drawn[:3] == [random_place(seed) for seed in range(3)]
    assert MAX_SHIFT * 0.9 < max(np.hypot(each.x, each.y) for each in drawn) <= MAX_SHIFT
    assert MAX_TURN * 0.9 < max(abs(each.yaw) for each in drawn) <= MAX_TURN


@pytest.mark.parametrize('wrong', [{'position': -0.01}, {'position': 1.0}, {'effort': 0.0}, {'velocity': float('nan')}])
def test_what_the_gripper_cannot_do_is_refused(wrong):
    with pytest.raises(InputError, match='gripper command'):
        Command(**{'position': 0.0, **wrong})


def test_without_mujoco_the_remedy_is_named(monkeypatch):
    monkeypatch.setattr('examples.simulated_gripper.world.mujoco', None)
    with pytest.raises(ConfigurationError, match='requirements/bench_physics.txt'):
        World(ITEMS['square'])


@physics
@pytest.mark.parametrize('effort', [0.5, 2.0, 10.0])
def test_at_rest_both_pads_press_with_the_effort(effort):
    world = gripped(effort=effort)
    assert world.is_stalled and not world.is_at_goal and world.outcome is Outcome.GRIPPED
    assert list(world.forces.values()) == pytest.approx([effort, effort], rel=0.02)
    assert world.effort == pytest.approx(effort, rel=0.02)


@physics
@pytest.mark.parametrize('name', ITEMS)
def test_the_fingers_do_not_enter_the_item(name):
    world = gripped(name)
    deepest = -min(contact.dist for contact in world.data.contact)
    assert 0 < deepest < 0.001
    assert world.outcome is Outcome.GRIPPED


@physics
@pytest.mark.parametrize(('effort', 'outcome'), [(2.0, Outcome.HELD), (0.55, Outcome.HELD), (0.45, Outcome.FREE),
                                                 (0.2, Outcome.FREE)])
def test_friction_of_a_half_carries_50_grams_from_half_a_newton_on(effort, outcome):
    assert lifted(effort=effort).outcome is outcome


@physics
def test_a_slippery_item_slips_where_another_holds():
    assert lifted('slippery').outcome is Outcome.FREE
    assert lifted('slippery', effort=3.0).outcome is Outcome.HELD


@physics
@pytest.mark.parametrize(('effort', 'outcome'), [(0.7, Outcome.DROPPED), (2.0, Outcome.HELD)])
def test_a_shake_of_2_g_loses_what_is_held_weakly(effort, outcome):
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
@pytest.mark.parametrize(('effort', 'outcome'), [(5.0, Outcome.GRIPPED), (7.0, Outcome.BROKEN)])
def test_the_fragile_item_breaks_above_its_strength(effort, outcome):
    assert gripped('fragile', effort).outcome is outcome


@physics
def test_the_gripper_obeys_late_and_closes_at_its_speed():
    world = World(ITEMS['square'])
    world.command(Command(0.0, velocity=0.05))
    world.step(DELAY - 0.002)
    assert world.gap == pytest.approx(0.09, abs=1e-5)
    world.step(0.3)
    before = world.gap
    world.step(0.2)
    assert (before - world.gap) / 0.2 == pytest.approx(0.05, rel=0.02)


@physics
def test_a_gripper_that_is_stopped_keeps_its_place_and_its_force():
    world = World(ITEMS['square'])
    world.command(Command(0.0))
    world.step(0.5)
    world.stop_gripper()
    world.step(0.5)
    before = world.gap
    world.step(0.5)
    assert 0.055 < before == pytest.approx(world.gap, abs=1e-5)
    world = lifted()
    world.stop_gripper()
    world.step(1.0)
    assert world.outcome is Outcome.HELD and world.forces['left'] == pytest.approx(2.0, rel=0.02)


@physics
@pytest.mark.parametrize('seed', range(4))
def test_the_hand_corrects_an_error_and_the_pads_show_it(seed):
    place = random_place(seed)
    world = World(ITEMS['square'], place)
    assert world.off_hand() == pytest.approx(place, abs=1e-4)
    world.move(x=place.x, y=place.y, yaw=place.yaw)
    world.step(1.0)
    world.command(Command(0.0))
    world.step(2.0)
    assert world.off_hand() == pytest.approx((0, 0, 0), abs=radians(0.1))
    for side in ('left', 'right'):
        taxels = world.pressures(side)
        rows, cols = np.indices(taxels.shape)
        assert taxels.sum() * PITCH**2 == pytest.approx(2.0, rel=0.05)
        assert [(each * taxels).sum() / taxels.sum() for each in (rows, cols)] == pytest.approx([7.5, 7.5], abs=0.2)
        assert taxels.max() < FULL_SCALE


@physics
def test_an_item_beside_the_middle_is_seen_there_by_both_pads():
    world = gripped('right_triangle', place=Place(x=0.006))
    left, right = (world.pressures(side) for side in ('left', 'right'))
    cols = np.arange(ROWS)
    assert [(cols * each).sum() / each.sum() for each in (left, right)] == pytest.approx([10.5, 10.5], abs=0.2)
    np.testing.assert_allclose(left[::-1], right, atol=0.05 * left.max())  # its rows go up
