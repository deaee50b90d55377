"""The unmet conditions of a grasp, derived from given facts. A fact that is currently unknown meets no requirement."""

from math import inf, nan

import numpy as np
import pytest

from tactile_node.errors import RefusedRequirementError, RequirementRefusal
from tactile_node.grasp.gripper import Line
from tactile_node.grasp.requirement import MOST_REQUIRED, Missing, Requirement, SideShape, missing
from tactile_node.grasp.tracker import GraspContact, GraspState, SideState

M = Missing
SQUARE = SideShape('square', 0.9)
LINE = Line(np.zeros(3), np.array((0.001, 0.0, 0.03)), width=0.03, offset=0.001, misalignment=0.033)
HELD = GraspState((SideState.TOUCHED, SideState.TOUCHED), GraspContact.TWO_SIDED, fresh=True, same_shape=True,
                  line=LINE, line_is_bound=False, held=1.0, stable=True, creep=0.0)


def short_of(state=HELD, left=SQUARE, right=SQUARE, **required):
    return missing(Requirement(**required), state, (left, right))


@pytest.mark.parametrize('required', [
    {}, {'shapes': frozenset({'square', 'circle'})}, {'min_confidence': 0.9}, {'min_held': 1.0},
    {'min_width': 0.03, 'max_width': 0.03}, {'max_width': 0.04}, {'max_offset': 0.001}, {'max_misalignment': 0.033}])
def test_a_grasp_that_meets_the_requirement_lacks_nothing(required):
    assert short_of(**required) == ()


@pytest.mark.parametrize(('required', 'expected'), [
    ({'shapes': frozenset({'circle'})}, M.OTHER_SHAPE), ({'min_confidence': 0.91}, M.UNSURE),
    ({'min_held': 1.01}, M.HELD_TOO_SHORT), ({'min_width': 0.031}, M.OTHER_WIDTH),
    ({'max_width': 0.029}, M.OTHER_WIDTH),
    ({'max_offset': 0.0009}, M.OFFSET), ({'max_misalignment': 0.03}, M.MISALIGNED)])
def test_each_limit_is_seen(required, expected):
    assert short_of(**required) == (expected,)


@pytest.mark.parametrize(('contact', 'expected'), [
    (GraspContact.NOT_KNOWN, M.NO_RESULT), (GraspContact.UNSEEN, M.UNSEEN), (GraspContact.NO_CONTACT, M.NO_CONTACT),
    (GraspContact.ONE_SIDED, M.ONE_SIDED)])
@pytest.mark.parametrize('claims', [{}, {'fresh': False}])
def test_without_two_contacts_that_are_seen_nothing_else_counts(contact, expected, claims):
    """The grasp state may still claim to be stable."""
    assert short_of(HELD._replace(contact=contact, **claims)) == (expected,)


@pytest.mark.parametrize(('state', 'expected'), [
    (HELD._replace(fresh=False), M.NOT_FRESH), (HELD._replace(stable=False), M.NOT_STABLE),
    (HELD._replace(line_is_bound=True), M.BOUND)])
def test_every_requirement_demands_a_fresh_stable_and_whole_grasp(state, expected):
    assert short_of(state) == (expected,)


def test_a_bound_is_accepted_on_request_only():
    assert short_of(HELD._replace(line_is_bound=True), accepts_bound=True) == ()


@pytest.mark.parametrize(('line', 'expected'), [
    (None, (M.WIDTH_NOT_KNOWN, M.OFFSET_NOT_KNOWN, M.MISALIGNMENT_NOT_KNOWN)),
    (LINE._replace(width=nan, misalignment=nan), (M.WIDTH_NOT_KNOWN, M.MISALIGNMENT_NOT_KNOWN))])
def test_an_unknown_value_meets_no_limit(line, expected):
    state = HELD._replace(line=line)
    assert short_of(state, max_width=1.0, max_offset=1.0, max_misalignment=3.0) == expected
    assert short_of(state) == ()


@pytest.mark.parametrize('name', ['min_confidence', 'min_held', 'min_width', 'max_width', 'max_offset',
                                  'max_misalignment'])
@pytest.mark.parametrize('value', [nan, inf, -0.001])
def test_an_impossible_limit_is_refused(name, value):
    with pytest.raises(RefusedRequirementError) as error:
        Requirement(**{name: value})
    assert error.value.refusal is RequirementRefusal.NOT_A_LIMIT


@pytest.mark.parametrize(('required', 'refusal'), [
    ({'min_confidence': 1.01}, RequirementRefusal.NOT_A_LIMIT),
    ({'min_width': 0.02, 'max_width': 0.01}, RequirementRefusal.EMPTY_RANGE),
    ({'shapes': frozenset({'none'})}, RequirementRefusal.NO_SUCH_SHAPE),
    ({'shapes': frozenset({'unknown'})}, RequirementRefusal.NO_SUCH_SHAPE),
    ({'shapes': frozenset({''})}, RequirementRefusal.NO_SUCH_SHAPE),
    ({'shapes': frozenset(f'shape {i}' for i in range(MOST_REQUIRED + 1))}, RequirementRefusal.TOO_MANY_SHAPES)])
def test_a_requirement_that_no_grasp_can_meet_is_refused(required, refusal):
    with pytest.raises(RefusedRequirementError) as error:
        Requirement(**required)
    assert error.value.refusal is refusal


