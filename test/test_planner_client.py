"""The example client decides as its docstrings say."""

import importlib.util
from math import pi, radians
from pathlib import Path
from types import SimpleNamespace

import pytest

PATH = Path(__file__).resolve().parents[1] / 'examples' / 'planner_client.py'
SPEC = importlib.util.spec_from_file_location('planner_client', PATH)
client = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(client)

AIM = (0.015, 0.015)


GOOD = client.Side(touched=True, confidence=0.99, centre=AIM, aim=AIM, angle=0.0, symmetry=2)


def side(**changes):
    return GOOD._replace(**changes)


def choose(left=GOOD, right=GOOD, offset=0.0, stable=True):
    return client.choose(left, right, offset, stable)


def test_a_good_stable_grasp_is_lifted():
    assert choose().action == 'lift'
    assert choose(stable=False).action == 'wait'


def test_one_sided_contact_waits():
    assert choose(right=side(touched=False)).action == 'wait'


def test_an_unsure_shape_is_waited_for_and_then_grasped_again():
    assert choose(right=side(confidence=0.5), stable=False).action == 'wait'
    assert choose(right=side(confidence=0.5)).action == 'regrasp'


def test_an_off_centre_contact_shifts_the_gripper_after_it():
    correction = choose(left=side(centre=(0.018, 0.014)))
    assert correction.action == 'shift'
    assert correction.shift == pytest.approx((0.003, -0.001))


def test_centres_that_do_not_face_each_other_are_grasped_again():
    assert choose(offset=0.004).action == 'regrasp'


@pytest.mark.parametrize(('angle', 'symmetry', 'expected'), [
    (radians(20), 2, radians(20)), (radians(80), 2, radians(-10)), (radians(-30), 4, radians(-30)),
    (radians(170), 1, radians(-10)),
    (radians(20), 3, radians(-10))])  # of edges at 20, 140 and 260 degrees
def test_an_oblique_edge_rotates_the_gripper_the_short_way(angle, symmetry, expected):
    correction = choose(left=side(angle=angle, symmetry=symmetry))
    assert correction.action == 'rotate' and correction.angle == pytest.approx(expected)


def test_a_circle_needs_no_turn():
    assert choose(left=side(angle=1.0, symmetry=0)).action == 'lift'


def test_yaw_of_a_quaternion():
    half = pi / 6
    assert client.yaw(SimpleNamespace(w=0.5 * 3**0.5, x=0.0, y=0.0, z=0.5)) == pytest.approx(2 * half)
