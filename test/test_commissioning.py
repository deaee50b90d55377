"""Tests of the commissioning on a simulated desk in virtual time."""

import itertools
import json
import math
from dataclasses import asdict, replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from commissioning_world import FACES, GRID, CommissioningDesk, random_truth
from launch_stand_in import processes_of, put_stand_ins

from tactile_node.cli.commission import _check as check_of
from tactile_node.cli.commission import _procedure as procedure_at
from tactile_node.cli.commissioning_pictures import pictures_of
from tactile_node.commissioning import movement_steps
from tactile_node.commissioning.block_grip import BlockFace
from tactile_node.commissioning.changes import Change, find_changes, largest_expected
from tactile_node.commissioning.commissioned_gripper import Act, Question
from tactile_node.commissioning.commissioning_record import CommissioningRecord, plan_from
from tactile_node.commissioning.evaluation import KEPT_SHARE, Evaluation
from tactile_node.commissioning.force import map_effort, safe_force
from tactile_node.commissioning.guarded_gripper import GuardedGripper, Move
from tactile_node.commissioning.jig import place_left_pad
from tactile_node.commissioning.lateral_shift import shift_per_load
from tactile_node.commissioning.measurement import Estimate, line_through, mean_of
from tactile_node.commissioning.mistake import Mistake, RefusedStepError
from tactile_node.commissioning.movement import StopWay, upper_bound
from tactile_node.commissioning.opening_law import chord_error, find_law
from tactile_node.commissioning.pad_alignment import PadAlignment
from tactile_node.commissioning.pad_mounting import (
    MOUNTINGS,
    PLACES,
    REACH,
    PadMounting,
    Press,
    find_mounting,
    taxel_places,
)
from tactile_node.commissioning.pad_rest import measure_rest, was_touched
from tactile_node.commissioning.parameter_file import measured_parameters, pad_poses, write_parameters
from tactile_node.commissioning.plan import CommissioningPlan, GaugeBlock
from tactile_node.commissioning.procedure import OPTIONAL, CommissioningProcedure
from tactile_node.commissioning.recording import JointStates, PadFrames, Recording
from tactile_node.commissioning.report import found_lines, report_data, write_report
from tactile_node.commissioning.report_lines import Verdict, fact_lines, fits_closing, measurement_lines
from tactile_node.commissioning.session import FIRST_SHARE
from tactile_node.commissioning.taxel_survey import TaxelFinding, survey
from tactile_node.errors import InputError
from tactile_node.grasp.gripper import Gripper, PadPose, contact_line
from tactile_node.gripper.gripper_settings import GripperSettings
from tactile_node.nodes.driver_source import driver_pads
from tactile_node.parameter import table
from tactile_node.pose.moments import contact_moments
from tactile_node.ros import settings
from tactile_node.skin.layout_file import load_layout
from tactile_node.skin.taxel_codec import TaxelCodec

LAUNCH_FILE = Path(__file__).resolve().parents[1] / 'launch' / 'bringup.launch.py'
SHORT = {'rest_time': 20.0, 'hold_time': 8.0, 'stop_trials': 6, 'closes': 2}
SEED = 2007    #: Seed of the gripper of these tests.
WEIGHT = 5.0   #: [N]
LONGEST = max(FACES.values()) / 0.018  #: Stiffness of the block with the longest face, as a share of that of the truth.


def plan_for(truth, **changes):
    """Return the plan that a person writes who has the data sheet of the gripper."""
    blocks = tuple(GaugeBlock(width, length) for width, length in FACES.items())
    return CommissioningPlan(GRID, 'finger_joint', truth.unit, truth.low, truth.high, truth.most_effort, blocks,
                             WEIGHT, **changes)


def desk_of(mistakes=(), seed=SEED, **changes):
    """Return a desk whose gripper has the properties of ``seed``, and the plan for it."""
    rng = np.random.default_rng(seed)
    truth = random_truth(rng)
    desk = CommissioningDesk(truth, rng, tuple(mistakes))
    return desk, plan_for(truth, **(SHORT | changes))


@pytest.fixture(scope='module')
def finished(tmp_path_factory):
    """A desk after a whole commissioning, with its plan and the file of the record."""
    path = tmp_path_factory.mktemp('commissioning') / 'record.json'
    desk, plan = desk_of()
    CommissioningProcedure(desk, desk, plan, CommissioningRecord(path)).run()
    return desk, plan, path


def without(path, folder, step):
    """Return a record in which one step is missing."""
    content = json.loads(path.read_text())
    del content['steps'][step]
    copy = folder / 'record.json'
    copy.write_text(json.dumps(content))
    return CommissioningRecord(copy)


# ---- estimators ----

def presses_on(mounting, corners, noise=0.0, rng=None):
    """Return the presses at ``corners`` (x, y) that a pad with this mounting reports."""
    places = [REACH * np.array(corner) + (noise * rng.standard_normal(2) if rng else 0) for corner in corners]
    return [Press(0, tuple(np.linalg.inv(mounting.matrix) @ place)) for place in places]


@pytest.mark.parametrize('mounting', MOUNTINGS, ids=str)
def test_two_corners_and_the_edge_between_them_show_how_a_pad_is_mounted(mounting):
    rng = np.random.default_rng(3)
    assert find_mounting(presses_on(mounting, PLACES.values(), 0.08, rng), 'here') == (0, mounting)


@pytest.mark.parametrize('wrong', range(3))
def test_a_press_at_any_other_place_is_refused(wrong):
    others = {(x, y) for x, y in itertools.product((-1, 0, 1), repeat=2) if (x, y) != (0, 0)}
    for other in others - {tuple(map(int, list(PLACES.values())[wrong]))}:
        corners = list(PLACES.values())
        corners[wrong] = other
        for mounting in MOUNTINGS:
            with pytest.raises(RefusedStepError) as refused:
                find_mounting(presses_on(mounting, corners), 'here')
            assert refused.value.mistake is Mistake.WRONG_CORNER


def test_a_taxel_is_faulty_only_if_its_neighbours_moved():
    frames = np.zeros((20, 8, 8))
    frames[5:, :4] = 0.5
    frames[:, 1, 1] = 0.1  # still among moving neighbours
    frames[:, 6, 6] = 0.1  # still where nothing moved
    found = survey([frames])
    assert found[1, 1] == TaxelFinding.FAULTY
    assert found[6, 6] == TaxelFinding.UNKNOWN
    assert np.count_nonzero(found == TaxelFinding.FAULTY) == 1
    assert (found[5:] == TaxelFinding.UNKNOWN).all()


def test_two_deviations_contain_the_mean_and_the_slope_as_often_as_stated():
    rng = np.random.default_rng(5)
    inside = []
    for _ in range(2000):
        mean = mean_of(rng.normal(3.0, 1.0, 4))
        slope, _ = line_through(np.arange(5.0), 2 * np.arange(5.0) + rng.standard_normal(5))
        inside.append((abs(mean.value - 3) <= 2 * mean.deviation, abs(slope.value - 2) <= 2 * slope.deviation))
    assert np.mean(inside, axis=0) == pytest.approx(0.9545, abs=0.015)


@pytest.mark.parametrize('period', [0.008, 0.02])
@pytest.mark.parametrize('jitter', [0.0, 0.3, 0.6])
def test_the_bound_of_a_latency_lies_above_the_truth_but_not_by_a_period(period, jitter):
    rng = np.random.default_rng(6)
    truth = 0.1
    bounds = np.array([upper_bound(truth - period * (rng.random(20) + jitter * rng.random(20)), period)
                       for _ in range(1000)])
    assert np.mean(bounds >= truth) >= 0.95
    assert (bounds < truth + period).all()


@pytest.mark.parametrize('period', [0.008, 0.02])
@pytest.mark.parametrize('jitter', [0.0, 0.3, 0.6])
@pytest.mark.parametrize('trials', [3, 20])
def test_three_new_trials_show_a_slower_controller_and_no_other(period, jitter, trials):
    rng = np.random.default_rng(12)

    def times(count, latency):
        return latency - period * (rng.random(count) + jitter * rng.random(count))
    false, seen = [], []
    for _ in range(400):
        stops = [times(trials, latency) for latency in (0.1, 0.05, 0.2)]  # three ways to stop
        limit = largest_expected(stops[0], stops, period, 3)
        false.append(times(3, 0.1).max() > limit)
        seen.append(times(3, 0.14).max() > limit)
    assert np.mean(false) <= 0.01
    assert np.mean(seen) >= 0.9


def test_a_time_that_changes_by_one_period_of_the_samples_is_no_change():
    stops = [[0.098, 0.099, 0.100] * 7, [0.098, 0.099] * 10]
    assert 0.118 < largest_expected(stops[0], stops, 0.02, 3) < 0.138


def test_three_blocks_show_the_arc_of_a_knuckle_and_two_do_not():
    angles, widths = (0.2, 0.4, 0.6), [0.05 * np.cos(0.7 + angle) - 0.01 for angle in (0.2, 0.4, 0.6)]
    onsets = [Estimate(angle, 1e-5) for angle in angles]
    found = find_law(onsets, widths, is_angle=True)
    assert found.is_of_knuckle
    assert found.opening(0.5).value == pytest.approx(0.05 * np.cos(1.2) - 0.01, abs=1e-6)
    assert find_law(onsets[:2], widths[:2], is_angle=True) is None
    assert find_law(onsets, widths, is_angle=False) is None  # a slide has no arc, so a block is wrong
    straight = find_law(onsets, [0.08 - 0.1 * angle for angle in angles], is_angle=False)
    assert not straight.is_of_knuckle
    assert chord_error(found)[1] > 1e-4


@pytest.mark.parametrize(('shifts', 'reason'), [
    ((0.004, 0.0056), '%'), ((0.004, -0.004), 'sign'), ((0.004,), 'two grips'), ((0.004, 0.0045), '')])
def test_a_shift_is_known_only_if_two_grips_agree(shifts, reason):
    found, why = shift_per_load(shifts)
    assert found.is_known == (not reason)
    assert reason in why


@pytest.mark.parametrize('scatter', [0.02, 0.08])
@pytest.mark.parametrize('stalls', [4, 12])
def test_the_force_to_aim_at_exceeds_the_limit_in_one_of_a_hundred_stalls_at_most(scatter, stalls):
    rng, limit = np.random.default_rng(13), 20.0
    forces = np.geomspace(0.6, 10.5, stalls)
    efforts = 2.5 + 1.25 * forces
    above = []
    for _ in range(1000):
        seen = forces * (1 + scatter * rng.standard_normal(stalls))
        known = map_effort(efforts, seen)
        if known.is_known:  # four stalls with much scatter may show no map
            stall = 0.8 * (known.effort(safe_force(efforts, seen, limit)) - 2.5) * (1 + scatter * rng.standard_normal())
            above.append(stall > limit)
    assert len(above) > 900
    assert np.mean(above) <= 0.01
    assert safe_force(efforts, forces, limit) == pytest.approx(limit)  # without scatter


# ---- the whole commissioning ----

def facts_of(truth, found):
    """Return the found and the true value of each discrete fact. None means that the commissioning refused to say."""
    facts = {'swapped': (found.is_swapped, truth.is_swapped)}
    for pad in range(2):
        facts[f'turn {pad}'] = found.mountings[pad][0], truth.mounts[pad][0]
        facts[f'mirrored {pad}'] = found.mountings[pad][1], truth.mounts[pad][1]
        faulty = np.argwhere(found.taxels[pad] == TaxelFinding.FAULTY).tolist()
        facts[f'faulty {pad}'] = sorted(faulty), sorted(map(list, truth.faulty[pad]))
    for way in StopWay:
        tried = found.tried(way)
        facts[f'stop by {way.value}'] = tried.is_reliable if tried.trials else None, way is not truth.failing
    if truth.failing is not StopWay.CANCEL:  # else a cancel may not reach the gripper
        kept = found.tried(StopWay.CANCEL).kept
        facts['lets go'] = bool(kept.value < KEPT_SHARE) if kept.is_known else None, truth.lets_go
    closing = fits_closing(found)
    step = truth.step * abs(truth.slope(found.law.middle)) * truth.stiffness * LONGEST  # [N]
    facts['fit'] = None if closing.verdict is Verdict.UNKNOWN else closing.verdict is Verdict.PASS, \
        (truth.failing is not StopWay.GOAL or not truth.lets_go) and step <= 20.0
    return facts


@pytest.mark.slow
def test_a_commissioning_finds_the_truth(finished):
    desk, plan, path = finished
    truth, found = desk.truth, Evaluation(CommissioningRecord(path), plan)
    assert [(name, *pair) for name, pair in facts_of(truth, found).items() if pair[0] != pair[1]] == []
    latencies = {'start': (found.start_latency, truth.latency + truth.jitter)}
    for way in (StopWay.CANCEL, StopWay.GOAL):
        latencies[way.value] = found.stop_latency(way), truth.latency + truth.jitter + truth.braking
    for name, (latency, true) in latencies.items():
        if name == truth.failing.value:
            assert np.isnan(latency)
        else:
            assert true <= latency <= true + 0.02
    readings = np.linspace(*found.law.readings, 11)
    assert max(abs(found.law.opening(each).value - truth.gap(each)) for each in readings) < 2e-4
    assert max(abs(found.law.slope(each).value / truth.slope(each) - 1) for each in readings) < 0.01
    wanted = *truth.offset, truth.turn, *truth.tilt
    for name, each, true in zip(('x', 'y', 'turn', 'tilt x', 'tilt y'), found.alignment, wanted, strict=True):
        assert abs(each.value - true) < (5e-4 if name in 'xy' else np.radians(1)), name


@pytest.mark.slow
def test_the_first_movement_is_small_and_the_effort_rises(finished):
    desk, plan, _ = finished
    first = list(itertools.takewhile(lambda command: command[2] < plan.travel / 10, desk.commands))
    efforts = [effort for _, effort, _ in first]
    assert len(first) > 2
    assert len({position for position, _, _ in first}) == 2  # there and back
    assert np.ptp([position for position, _, _ in first]) <= 1.01 * FIRST_SHARE * plan.travel
    start = desk.truth.low + (0.3 if desk.truth.closes_rising else 0.7) * desk.truth.span
    assert abs(first[0][0] - start) <= 1.01 * FIRST_SHARE * plan.travel
    assert efforts == sorted(efforts)
    assert efforts[0] <= 0.01 * plan.most_effort


@pytest.mark.slow
def test_each_series_is_consented_to_and_foam_comes_before_hard_blocks(finished):
    desk, *_ = finished
    acts = [question.act for question in desk.questions]
    assert acts[0] is Act.CONFIRM_STOP
    assert acts.index(Act.FOAM) < acts.index(Act.BLOCK)
    for question in desk.questions:
        if question.act is Act.CONSENT:
            assert all(word in question.text for word in (' movement', ' at ', 'effort of', ' N. Start?'))
            assert f' {desk.truth.unit}' in question.text.split(':')[0]  # the target
            assert 'upper limits' in question.text or 'with rising effort' not in question.text


def with_jig(path, folder, mistakes=()):
    """Return a desk with a jig, its plan, and a procedure whose other steps are finished."""
    desk, plan = desk_of(mistakes)
    plan = replace(plan, jig=desk.jig)
    (folder / 'record.json').write_text(path.read_text())
    record = CommissioningRecord(folder / 'record.json')
    return desk, plan, record, CommissioningProcedure(desk, desk, plan, record)


@pytest.mark.slow
def test_a_jig_shows_where_the_pads_are_in_the_frame_of_the_gripper(finished, tmp_path):
    desk, plan, record, procedure = with_jig(finished[2], tmp_path)
    assert procedure.unfinished() == ['jig']
    assert 'frame_id' in measured_parameters(Evaluation(record, plan), plan).nodes['grasp']
    procedure.run()
    found = Evaluation(record, plan)
    grasp = measured_parameters(found, plan).nodes['grasp']
    assert 'frame_id' not in grasp
    gripper = Gripper(*(PadPose(grasp[f'{pad}_xyz'], grasp[f'{pad}_rpy']) for pad in ('left', 'right')))
    truth = desk.truth
    centres = truth.place, truth.place + truth.axes[:, :2] @ truth.offset
    middle = (GRID.cols - 1) / 2 * GRID.pitch
    for pose, centre in zip((gripper.left, gripper.right), centres):
        np.testing.assert_allclose(pose.place((middle, middle), 0.0), centre, rtol=0, atol=5e-4)
    assert gripper.left.normal @ truth.axes[:, 2] > np.cos(np.radians(1))
    lines = {each.name: each.estimate for each in measurement_lines(found)}
    for axis, true in zip('xyz', truth.place):
        each = lines[f'left pad, {axis} in the frame of the gripper']
        assert abs(each.value - true) < 4 * each.deviation


@pytest.mark.slow
@pytest.mark.parametrize('mistake', [Mistake.BLOCK_MISSING, Mistake.BLOCK_ASKEW, 'turned'])
def test_a_jig_that_is_missing_askew_or_turned_is_noticed(finished, tmp_path, mistake):
    is_turned = mistake == 'turned'
    desk, _, record, procedure = with_jig(finished[2], tmp_path, () if is_turned else [mistake])
    insert = desk.ask

    def turned_once(question):
        answer = insert(question)
        if question.act is Act.JIG and is_turned and not procedure.refused:
            desk._object.angle += np.radians(10)
        return answer
    desk.ask = turned_once
    procedure.run()
    assert [error.mistake for error in procedure.refused] == [Mistake.BLOCK_ASKEW if is_turned else mistake]
    assert 'jig' in record


def test_the_jig_may_stand_at_any_pose_in_the_frame_of_the_gripper():
    alignment = PadAlignment(*[Estimate(0.0, 0.0)] * 5)
    faces = [BlockFace(np.array((x, -0.001)), 0.0, np.zeros(2)) for x in (0.002, -0.002)]
    plain = place_left_pad(faces, 1.0, alignment, (0.01, 0.0, 0.1, 0.0, 0.0, 0.0))
    # The block lies 2 mm to the right of the middle of the left skin and 1 mm below. The skin looks along y.
    np.testing.assert_allclose([each.value for each in plain[:3]], (0.012, 0.0, 0.101), atol=1e-12)
    along_x = (0.01, 0.0, 0.1, 0.0, 0.0, -np.pi / 2)  # a gripper that closes along x
    turned = place_left_pad(faces, 1.0, alignment, along_x)
    np.testing.assert_allclose([each.value for each in turned[:3]], (0.01, -0.002, 0.101), atol=1e-12)
    np.testing.assert_allclose(turned.pose(along_x).rotation[:, 2], (1, 0, 0), atol=1e-12)


PARTS = {
    Mistake.WRONG_PAD: 'pads', Mistake.WRONG_CORNER: 'pads', Mistake.TOO_LIGHT: 'pads', Mistake.LET_GO_EARLY: 'pads',
    Mistake.TWO_FINGERS: 'pads', Mistake.OTHER_BLOCK: 'block 25 mm', Mistake.BLOCK_ASKEW: 'block 25 mm',
    Mistake.BLOCK_SLID: 'block 25 mm', Mistake.BLOCK_MISSING: 'block 25 mm', Mistake.HAND_BETWEEN: 'stops',
    Mistake.SWITCHED_OFF: 'stops', Mistake.EMERGENCY_STOP: 'stops', Mistake.OTHER_CLIENT: 'stops',
    Mistake.OTHER_JOINT: 'stops', Mistake.WRONG_DIRECTION: 'first movement', Mistake.WEIGHT_MISSING: 'weight',
    Mistake.PULLED_OUT: 'proof'}


#: Mistakes whose part takes many seconds to compute.
LONG_PARTS = Mistake.BLOCK_SLID, Mistake.PULLED_OUT


@pytest.mark.slow
@pytest.mark.parametrize('mistake', [pytest.param(mistake, marks=pytest.mark.long if mistake in LONG_PARTS else ())
                                     for mistake in PARTS], ids=lambda mistake: mistake.value)
def test_a_mistake_is_explained_and_only_its_part_is_repeated(finished, tmp_path, mistake):
    record = without(finished[2], tmp_path, PARTS[mistake])
    desk, plan = desk_of([mistake])
    procedure = CommissioningProcedure(desk, desk, plan, record)
    procedure.run()
    assert [error.mistake for error in procedure.refused] == [mistake]
    explained = [question.text for question in desk.questions if question.act is Act.REPEAT]
    assert len(explained) == 1
    assert all(word in explained[0] for word in ('expected', 'got'))
    assert PARTS[mistake] in record
    acts = [question.act for question in desk.questions]
    assert acts.count(Act.CONFIRM_STOP) == 1
    if PARTS[mistake] != 'pads':
        assert not {Act.PRESS, Act.STROKE, Act.FOAM, Act.LEAVE} & set(acts)


@pytest.mark.slow
def test_a_touch_during_the_rest_is_noticed_and_the_rest_is_repeated(finished, tmp_path):
    desk, plan = desk_of([Mistake.HAND_BETWEEN])
    record = without(finished[2], tmp_path, 'rest')
    procedure = CommissioningProcedure(desk, desk, plan, record)
    procedure.run()
    assert [(error.where, error.mistake) for error in procedure.refused] == [('rest', Mistake.HAND_BETWEEN)]
    assert all(abs(pad['drift'][0]) < 1e-4 for pad in record['rest']['pads'])


@pytest.mark.parametrize(('press', 'steady', 'found'), [(0.0, 0.002, False), (0.1, 0.002, True), (0.1, 0.05, False)])
def test_a_touch_changes_several_taxels_at_once_and_drift_does_not(press, steady, found):
    """A pad of 8 x 8 taxels drifts by 0.2 N in 60 s. In the third case, the noise hides the touch."""
    rng, count = np.random.default_rng(50), 1200
    times = np.arange(count) / 20
    forces = rng.normal(0, steady, (count, 8, 8)) + 0.2 * times[:, np.newaxis, np.newaxis] / 60
    forces[400:440, 2:4, 2:4] += press
    forces[:, 7, 7] = np.nan
    forces[600, 5, 5] = 1.0  # a single taxel is no touch
    assert was_touched(PadFrames(times, np.arange(count), forces)) is found


@pytest.mark.slow
@pytest.mark.parametrize('mistake', [Mistake.EMERGENCY_STOP, Mistake.HAND_BETWEEN])
def test_the_gripper_is_stopped_in_both_ways_after_a_mistake(finished, tmp_path, mistake):
    desk, plan = desk_of([mistake])
    procedure = CommissioningProcedure(desk, desk, plan, without(finished[2], tmp_path, 'step'))
    before = []
    answer = desk.ask

    def ask(question):
        if question.act is Act.REPEAT:
            before.append((desk.cancels, *desk.commands[-1][:2]))
        return answer(question)
    desk.ask = ask
    procedure.run()
    (cancels, position, effort), = before
    assert cancels > 0
    assert plan.low - 0.1 * plan.travel <= position <= plan.high + 0.1 * plan.travel
    assert effort > desk.truth.idle_effort  # a smaller effort would not hold the gripper


def test_nothing_moves_while_another_client_commands_the_gripper(tmp_path):
    desk, plan = desk_of()
    desk.others = lambda: 'touch_gripper'
    with pytest.raises(RefusedStepError, match='touch_gripper'):
        CommissioningProcedure(desk, desk, plan, CommissioningRecord(tmp_path / 'record.json')).run()
    assert not desk.commands


def test_nothing_moves_without_an_emergency_stop_in_reach(tmp_path):
    desk, plan = desk_of()
    desk.ask = lambda question: 'no' if question.act is Act.CONFIRM_STOP else 'yes'
    with pytest.raises(RefusedStepError, match='emergency stop'):
        CommissioningProcedure(desk, desk, plan, CommissioningRecord(tmp_path / 'record.json')).run()
    assert not desk.commands


@pytest.mark.slow
def test_nothing_moves_without_consent(tmp_path):
    desk, plan = desk_of()
    answer = desk.ask
    desk.ask = lambda question: 'no' if question.act is Act.CONSENT else answer(question)
    with pytest.raises(RefusedStepError) as refused:
        CommissioningProcedure(desk, desk, plan, CommissioningRecord(tmp_path / 'record.json')).run()
    assert refused.value.mistake is Mistake.NO_CONSENT
    here = desk.truth.low + (0.3 if desk.truth.closes_rising else 0.7) * desk.truth.span
    assert all(abs(position - here) < 0.01 * plan.travel for position, _, _ in desk.commands)


@pytest.mark.slow
def test_a_gripper_that_still_holds_an_object_opens_only_with_consent(finished, tmp_path):
    """A person continues after a failure, with the object between the pads."""
    desk, plan = desk_of()
    record = without(finished[2], tmp_path, 'foam')
    held = len(desk.commands)
    answer = desk.ask
    desk.ask = lambda question: 'no' if question.text.startswith('opening') else answer(question)
    with pytest.raises(RefusedStepError) as refused:
        CommissioningProcedure(desk, desk, plan, record).run()
    assert refused.value.mistake is Mistake.NO_CONSENT
    assert all(abs(position - desk.truth.low - 0.3 * desk.truth.span) < 0.01 * plan.travel
               or abs(position - desk.truth.low - 0.7 * desk.truth.span) < 0.01 * plan.travel
               for position, _, _ in desk.commands[held:])


@pytest.mark.slow
def test_a_record_is_not_continued_at_another_frame_rate(finished, tmp_path):
    """The age of the frames depends on their rate, so the latency would be too short for the running driver."""
    desk, plan = desk_of()
    record = without(finished[2], tmp_path, 'step')
    for pad in record['rest']['pads']:
        pad['rate'] *= 3.0
    with pytest.raises(RefusedStepError) as refused:
        CommissioningProcedure(desk, desk, plan, record).run()
    assert refused.value.mistake is Mistake.OTHER_RATE
    assert not desk.commands


@pytest.mark.slow
@pytest.mark.parametrize('scatter', [0.0, 0.08])
def test_a_block_is_pressed_less_if_the_forces_on_the_foam_scatter(finished, tmp_path, scatter):
    desk, plan = desk_of()
    record = without(finished[2], tmp_path, 'block 40 mm')
    foam = record['foam']
    line = map_effort(foam['efforts'], foam['forces'])
    foam['forces'] = [(line.offset.value + line.slope.value * effort) * (1 + scatter * (-1) ** number)
                      for number, effort in enumerate(foam['efforts'])]
    plan = replace(plan, force_limit=8.0)  # below the force at which the block sinks in by the largest depth
    CommissioningProcedure(desk, desk, plan, record).run()
    share = desk.strongest / plan.force_limit
    assert share < 0.85 if scatter else 0.9 < share < 1


@pytest.mark.slow
def test_a_step_without_a_result_is_not_finished(finished, tmp_path, monkeypatch):
    monkeypatch.setattr(movement_steps, 'STEP_COMMANDS', 8)  # too few commands for five levels
    desk, plan = desk_of()
    record = without(finished[2], tmp_path, 'step')
    said = []
    desk.say = said.append
    steps = procedure_at(desk, desk, plan, record)
    steps.run()
    assert 'step' not in record
    assert said[-1] == '\nstep: nothing found, because the levels at which the gripper stays cannot be distinguished'
    assert steps.unfinished() == ['step'] and steps.unfinished(('step',)) == []


@pytest.mark.slow
def test_an_interruption_stops_the_gripper_and_keeps_the_finished_steps(finished, tmp_path):
    record = without(finished[2], tmp_path, 'foam')
    desk, plan = desk_of()
    answer = desk.ask

    def ask(question):
        if question.act is Act.CONSENT:
            raise KeyboardInterrupt
        return answer(question)
    desk.ask = ask
    with pytest.raises(KeyboardInterrupt):
        CommissioningProcedure(desk, desk, plan, record).run()
    assert desk.cancels == 1
    assert 'stops' in CommissioningRecord(tmp_path / 'record.json')


@pytest.mark.slow
def test_an_interrupted_check_says_what_was_stopped_and_what_is_unfinished(finished, tmp_path):
    desk, plan = desk_of()
    first = without(finished[2], tmp_path, 'proof')
    before, said = (tmp_path / 'record.json').read_bytes(), []
    desk.say = said.append

    def interrupt(question):
        raise KeyboardInterrupt
    desk.ask = interrupt
    with pytest.raises(KeyboardInterrupt):
        check_of(desk, desk, plan, first, tmp_path)
    assert 'cancelled its goals and commanded the present position' in said[-1]
    assert 'Not finished: rest, pads, first movement, stops.' in said[-1] and 'record of the' in said[-1]
    assert (tmp_path / 'record.json').read_bytes() == before


class SilentJoint:
    """A desk that sends no joint states from 0.2 s to 0.6 s after one command of the step `step`."""

    def __init__(self, desk, commands):
        self._desk, self._commands, self._since = desk, commands, math.inf

    def __getattr__(self, name):
        return getattr(self._desk, name)

    def command(self, *move):
        self._desk.command(*move)
        if len(self._desk.commands) == self._commands:
            self._since = self.now()

    def advance(self, seconds):
        recording = self._desk.advance(seconds)
        is_silent = 0.2 < self.now() - self._since < 0.6
        return recording._replace(joint=JointStates(np.zeros(0), np.zeros(0))) if is_silent else recording


@pytest.mark.slow
@pytest.mark.filterwarnings('error::RuntimeWarning')
def test_a_reading_of_the_step_waits_for_missing_joint_states(finished, tmp_path):
    commands = []
    for at in (math.inf, 30):
        desk, plan = desk_of()
        record = without(finished[2], tmp_path, 'step')
        CommissioningProcedure(SilentJoint(desk, at), desk, plan, record).run()
        commands.append(len(desk.commands))
        step, expected = (each['step']['step'] for each in (record, CommissioningRecord(finished[2])))
        assert abs(step[0] - expected[0]) < 3 * math.hypot(step[1], expected[1])
    assert abs(commands[0] - commands[1]) < 5  # a reading that is NaN would use all commands


# ---- files ----

@pytest.mark.slow
def test_the_parameter_file_sets_only_parameters_that_exist_and_are_in_range(finished, tmp_path):
    _, plan, path = finished
    parameters = measured_parameters(Evaluation(CommissioningRecord(path), plan), plan)
    write_parameters(tmp_path / 'parameters.yaml', parameters)
    read = yaml.safe_load((tmp_path / 'parameters.yaml').read_text())
    classes = {'grasp': settings.GraspNodeSettings, 'touch_gripper': GripperSettings,
               'classifier': settings.ClassifierSettings, 'skin_driver': settings.DriverSettings}
    assert read
    for node, content in read.items():
        settings_class = classes[node.removeprefix('/**/')]
        given = {name: tuple(value) if isinstance(value, list) else value
                 for name, value in content['ros__parameters'].items()}
        for row in table(settings_class):
            if isinstance(given.get(row.name), float):
                assert row.properties.low <= given[row.name] <= row.properties.high
        settings_class(**given)  # refuses an unknown name or limits that contradict each other


@pytest.mark.ros
@pytest.mark.slow
def test_the_launch_file_reads_the_parameter_file(finished, tmp_path, monkeypatch):
    """Both processes of the launch file get the file as it is, and their nodes read each value."""
    import rclpy

    from tactile_node.ros.parameters import declare, read
    put_stand_ins(monkeypatch)
    _, plan, path = finished
    parameters = measured_parameters(Evaluation(CommissioningRecord(path), plan), plan)
    write_parameters(tmp_path / 'parameters.yaml', parameters)
    bringup, gripper = processes_of(LAUNCH_FILE, pads='left,right', node_ids='32,64', gripper_action='gripper_cmd',
                                    params_file=str(tmp_path / 'parameters.yaml'))
    assert f'--params-file={tmp_path}/parameters.yaml' in bringup['arguments']
    rclpy.init(args=[*gripper['arguments'], '-r', '__ns:=/'])
    try:
        for name, kind in (('grasp', settings.GraspNodeSettings), ('touch_gripper', GripperSettings),
                           ('classifier', settings.ClassifierSettings)):
            node = rclpy.create_node(name)
            declare(node, kind)
            found = read(node, kind)
            node.destroy_node()
            for parameter, value in parameters.nodes[name].items():
                assert getattr(found, parameter) == (tuple(value) if isinstance(value, list) else value), parameter
    finally:
        rclpy.shutdown()


def test_an_empty_record_gives_no_parameter_and_no_value(tmp_path):
    _, plan = desk_of()
    found = Evaluation(CommissioningRecord(tmp_path / 'none.json'), plan)
    parameters = measured_parameters(found, plan)
    assert parameters.nodes == {}
    assert {'stop_by', 'latency', 'stiffness', 'shift_per_load'} <= parameters.absent.keys()
    data = report_data(found, parameters, {})
    assert {each['verdict'] for each in (*data['measurements'], *data['facts'])} == {'unknown'}
    assert all(each['value'] is None for each in data['measurements'])


def test_the_files_of_the_skin_become_parameters(tmp_path):
    _, plan = desk_of()
    record = CommissioningRecord(tmp_path / 'record.json')
    record.save('response', {'file': '/hand/skin.response.yaml', 'text': 'Radius of the disc'})
    record.save('assessment', {'file': '', 'text': 'As the model is'})
    found = Evaluation(record, plan)
    parameters = measured_parameters(found, plan)
    assert parameters.nodes == {'skin_driver': {'response_files': ['/hand/skin.response.yaml']}}
    assert parameters.absent['model'] == 'the model was not improved, or no unknown objects were touched'
    assert report_data(found, parameters, {})['skin'] == {'response': 'Radius of the disc',
                                                          'assessment': 'As the model is'}


@pytest.mark.slow
def test_the_report_contains_each_value_with_its_verdict(finished, tmp_path):
    _, plan, path = finished
    found = Evaluation(CommissioningRecord(path), plan)
    write_report(tmp_path / 'report.md', tmp_path / 'report.json', found, measured_parameters(found, plan),
                 {'date': '2026-01-02'})
    page, data = (tmp_path / 'report.md').read_text(), json.loads((tmp_path / 'report.json').read_text())
    assert len(data['measurements']) == len(measurement_lines(found))
    for line in (*measurement_lines(found), *fact_lines(found)):
        assert f'| {line.name} |' in page
    assert fits_closing(found).verdict is not Verdict.UNKNOWN


@pytest.mark.slow
def test_the_lines_after_a_step_give_its_values_and_name_what_is_unknown(finished, tmp_path):
    _, plan, path = finished
    record = without(path, tmp_path, 'stops')
    before = found_lines(Evaluation(record, plan))
    stops = CommissioningRecord(path)['stops']
    stopped = sum(trial[0] for trial in stops['trials']['goal'])
    next(trial for trial in stops['trials']['goal'] if trial[0])[0] = False
    record.save('stops', stops)
    new = [line for line in found_lines(Evaluation(record, plan)) if line not in before]
    assert any(line.startswith('stop by cancel: ') for line in new)
    failed, = (line for line in new if line.startswith('stop by goal: '))
    assert failed.startswith(f'stop by goal: {stopped - 1} of 6 stopped, FAIL (all must stop')
    assert 'unknown: time from a stop by goal to standstill (a stop failed)' in new
    assert not any('noise' in line or 'not finished' in line for line in new)


@pytest.mark.slow
def test_a_line_names_the_limit_the_remedy_and_only_what_is_missing(finished, tmp_path):
    _, plan, path = finished
    record = without(path, tmp_path, 'step')
    record['rest']['pads'][1] |= {'lost': 0.2, 'drift': (1e-3, 1e-6)}
    record['stops']['trials']['cancel'] = [(True, 0.1, 0.2, False)] * 6
    record['foam']['kept'] |= {'cancel': (0.9, 0.01), 'goal': (0.16, 0.01)}
    lines = found_lines(Evaluation(record, plan))
    by_name = dict(line.split(': ', 1) for line in lines if not line.startswith('unknown'))
    assert 'keeps 16 % of the force on foam, at least 70 % needed' in by_name['stop by goal']
    assert ' degrees' in by_name['right pad, turn']
    assert by_name['speed'].endswith(' mm/s') and ' ms (upper' in by_name['time from a command to the movement']
    for name, value in (('lost frames', '0.2, FAIL (at most 0.05. Reduce the load'), ('drift in 300 s', '0.3 +- ')):
        assert by_name[f'{plan.pads[1]}/taxels, {name}'].startswith(value)
        assert 'record.json' in by_name[f'{plan.pads[1]}/taxels, {name}']
        assert 'record.json' not in by_name[f'{plan.pads[0]}/taxels, {name}']
    assert 'unknown: fit for closing by touch (not known: step)' in lines


@pytest.mark.slow
def test_the_notes_state_the_remaining_limit_and_the_time_of_a_close(finished):
    desk, plan, path = finished
    parameters = measured_parameters(Evaluation(CommissioningRecord(path), plan), plan)
    effort, closing = parameters.notes
    assert f'gripper_effort {parameters.nodes["touch_gripper"]["gripper_effort"]:.3g} is' in effort
    widest = max(map(desk.truth.gap, (plan.low, plan.high)))
    speed = parameters.nodes['touch_gripper']['fast_speed']
    seconds = float(closing.split(' takes ')[1].split()[0])
    assert abs(seconds * speed - (widest - 0.025)) < 0.001 + 0.5 * speed


@pytest.mark.slow
def test_blocks_that_contradict_each_other_are_the_reason_for_an_unknown_law(finished, tmp_path):
    _, plan, path = finished
    content = json.loads(path.read_text())
    content['steps']['block 25 mm']['width'] = 0.027
    (tmp_path / 'record.json').write_text(json.dumps(content))
    plan = replace(plan, unit='m')  # a knuckle fits any three widths
    lines = found_lines(Evaluation(CommissioningRecord(tmp_path / 'record.json'), plan))
    line, = (line for line in lines if 'do not fit one law' in line)
    assert line.startswith('unknown: opening in the middle of the blocks, ') and 'tilt along x' in line


@pytest.mark.slow
def test_the_pictures_show_each_block_stop_close_and_pad(finished, tmp_path):
    desk, plan, path = finished
    found = Evaluation(CommissioningRecord(path), plan)
    pictures = {file: ElementTree.fromstring(drawing) for file, (_, drawing) in pictures_of(found, plan).items()}
    assert list(pictures) == ['opening.svg', 'opening_residuals.svg', 'stops.svg', 'proof.svg', 'left_pad.svg',
                              'right_pad.svg']

    def dots(name):
        return sum(each.get('d').count('h0') for each in pictures[name].iter() if each.get('class') == 'series')
    stopped = sum(found.tried(way).stopped for way in StopWay)
    assert [dots(name) for name in list(pictures)[:4]] == [3, 3, stopped, 3 * plan.closes]
    texts = {name: [each.text for each in picture.iter() if each.tag.endswith('text')]
             for name, picture in pictures.items()}
    assert {'time to standstill [ms]', '0', 'limit', 'cancel'} <= set(texts['stops.svg'])
    assert {f'position of the joint [{plan.unit}]', 'opening [mm]', 'gauge blocks'} <= set(texts['opening.svg'])
    for name, count in (('left_pad.svg', plan.grid.rows), ('right_pad.svg', plan.grid.rows)):
        assert texts[name].count('0') == texts[name].count(str(count - 1)) == 2  # a row and a column
    assert pictures_of(Evaluation(CommissioningRecord(tmp_path / 'none.json'), plan), plan) == {}


def test_a_record_of_another_kind_is_refused(tmp_path):
    path = tmp_path / 'record.json'
    path.write_text('{"version": 99, "steps": {}}')
    with pytest.raises(InputError, match='version 99'):
        CommissioningRecord(path)


def test_the_poses_of_the_pads_bring_the_prints_of_a_block_to_one_line():
    mountings = [MOUNTINGS[1], MOUNTINGS[2]]
    turn, offset = 0.04, np.array((0.003, -0.002))
    alignment = PadAlignment(*(Estimate(each, 0.0) for each in (*offset, turn, 0.0, 0.0)))
    poses = pad_poses(GRID, mountings, alignment)
    gripper = Gripper(PadPose(poses['left_xyz'], poses['left_rpy']), PadPose(poses['right_xyz'], poses['right_rpy']))
    point = np.array((0.002, 0.005))  # place of the block on the left pad, seen with the fingertip up
    cos, sin = np.cos(turn), np.sin(turn)
    across = np.array(((cos, sin), (-sin, cos))) @ (point - offset)
    seen = [point, across * (-1, 1)]  # the right pad is seen from the other side
    corner = -np.array((GRID.cols - 1, GRID.rows - 1)) * GRID.pitch / 2
    left, right = (np.linalg.inv(mounting.matrix) @ place - corner for mounting, place in zip(mountings, seen))
    assert contact_line(gripper, tuple(left), tuple(right), 0.02).offset == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize('mirrored', [('left',), ('right',), ('left', 'right')])
def test_a_mirrored_pad_gives_the_right_grasp_with_the_parameters_found(tmp_path, mirrored):
    """A block lies off the centre between two turned pads, of which one or both are mirrored."""
    mountings = [PadMounting(1, 'left' in mirrored), PadMounting(2, 'right' in mirrored)]
    record = CommissioningRecord(tmp_path / 'record.json')
    record.save('pads', {'order': [0, 1], 'mountings': mountings, 'taxels': np.ones((2, 16, 16), int)})
    found, plan = Evaluation(record, desk_of()[1]), desk_of()[1]
    assert found.mountings == mountings
    found.alignment = PadAlignment(*[Estimate(0.0, 0.0)] * 5)
    parameters = measured_parameters(found, plan).nodes
    assert parameters['skin_driver'] == {'mirrored_pads': list(mirrored)}
    gripper = Gripper(*(PadPose(parameters['grasp'][f'{pad}_xyz'], parameters['grasp'][f'{pad}_rpy'])
                        for pad in ('left', 'right')))
    point = np.array((0.006, 0.003))  # place of the block on the left pad, seen with the fingertip up
    device = TaxelCodec(load_layout('sim16x16.yaml'))
    payloads = [device.encode(1e4 * (np.hypot(*np.moveaxis(taxel_places(GRID, mounting) - place, -1, 0)) < 0.0045))
                for mounting, place in zip(mountings, (point, point * (-1, 1)))]

    def offset(names):
        """Return the distance between the two contacts across the closing direction [m]."""
        pads = driver_pads(settings.DriverSettings(pads=('left', 'right'), node_ids=(32, 64), mirrored_pads=names))
        values = [TaxelCodec(pad.layout).decode(payload, np.ones(32, bool))[0]
                  for pad, payload in zip(pads, payloads)]
        moments = [contact_moments(each, each > 0, GRID.pitch, 'Pa') for each in values]
        return contact_line(gripper, *(each.centre_of_pressure for each in moments), 0.02).offset
    assert offset(mirrored) == pytest.approx(0, abs=3e-4)
    assert offset(('',)) > 0.005


def test_a_way_to_stop_that_fails_once_is_never_chosen(tmp_path):
    _, plan = desk_of()
    record = CommissioningRecord(tmp_path / 'record.json')
    trials = {way.value: [(True, 0.05, 0.06, False)] * 20 for way in StopWay}
    record.save('foam', {'kept': {way.value: (1.0, 0.0) for way in StopWay}})
    record.save('stops', {'trials': trials, 'speed': (0.02, 1e-4), 'period': 0.01})
    assert Evaluation(record, plan).stop_by is StopWay.CANCEL
    trials['cancel'][7] = (False, 0.05, 0.06, False)
    record.save('stops', {'trials': trials, 'speed': (0.02, 1e-4), 'period': 0.01})
    assert Evaluation(record, plan).stop_by is StopWay.GOAL
    record.save('foam', {'kept': {way.value: (0.1, 0.0) for way in StopWay}})
    assert Evaluation(record, plan).stop_by is None


# ---- dangers ----

class BlindPads:
    """A desk whose pads still send frames, but without a value, for ``seconds`` after ``commands`` commands."""

    def __init__(self, desk, commands=1, seconds=math.inf):
        self._desk, self._commands, self._seconds = desk, commands, seconds
        self._since = math.nan  # time when the pads became blind [s]

    def __getattr__(self, name):
        return getattr(self._desk, name)

    def advance(self, seconds):
        recording = self._desk.advance(seconds)
        if len(self._desk.commands) < self._commands:
            return recording
        if math.isnan(self._since):
            self._since = self._desk.now()
        if self._desk.now() > self._since + self._seconds:
            return recording
        return recording._replace(pads=tuple(pad._replace(forces=np.full_like(pad.forces, np.nan))
                                             for pad in recording.pads))


@pytest.mark.slow
def test_pads_that_send_no_values_stop_the_gripper(finished, tmp_path):
    desk, plan = desk_of()
    record = without(finished[2], tmp_path, 'first movement')
    with pytest.raises(RefusedStepError) as refused:
        CommissioningProcedure(BlindPads(desk), desk, plan, record).run()
    assert refused.value.mistake is Mistake.PADS_SILENT
    assert desk.cancels


@pytest.mark.slow
@pytest.mark.parametrize(('step', 'commands'), [('first movement', 7), ('foam', 5)])
def test_pads_that_are_blind_for_a_second_change_no_result(finished, tmp_path, step, commands):
    """The part is refused after the gripper has moved."""
    desk, plan = desk_of()
    record = without(finished[2], tmp_path, step)
    procedure = CommissioningProcedure(BlindPads(desk, commands, 1.0), desk, plan, record)
    procedure.run()
    assert [error.mistake for error in procedure.refused] == [Mistake.PADS_SILENT]
    found, expected = record[step], CommissioningRecord(finished[2])[step]
    if step == 'first movement':
        assert (found['effort'], found['opens_rising']) == (expected['effort'], expected['opens_rising'])
        return
    # A gripper that already presses on the foam need not move at the smallest effort, which is no emergency stop.
    assert [question.act for question in desk.questions].count(Act.FOAM) == 2
    slopes = [map_effort(each['efforts'], each['forces']).slope for each in (found, expected)]
    assert abs(slopes[0].value - slopes[1].value) < 4 * math.hypot(*(each.deviation for each in slopes))


def test_a_command_never_leaves_the_limits_of_the_joint():
    desk, plan = desk_of()
    guarded = GuardedGripper(desk, desk, plan)
    for position in (plan.low - 1, plan.high + 1):
        guarded.command(Move(position, 1.0, 0.01))
    assert [position for position, *_ in desk.commands] == [plan.low, plan.high]


@pytest.mark.slow
def test_a_joint_without_noise_comes_to_rest(finished, tmp_path, monkeypatch):
    monkeypatch.setattr('commissioning_world.JOINT_NOISE', 0.0)
    desk, plan = desk_of()
    CommissioningProcedure(desk, desk, plan, without(finished[2], tmp_path, 'first movement')).run()
    assert desk.now() < 100 + 60  # a gripper that never counts as at rest waits for MOVE_LIMIT in each movement


@pytest.mark.slow
def test_a_step_that_needs_a_skipped_step_is_left_out(finished, tmp_path):
    content = json.loads(finished[2].read_text())
    content['steps'] = {name: content['steps'][name] for name in ('rest', 'pads', 'first movement', 'stops')}
    path = tmp_path / 'short.json'
    path.write_text(json.dumps(content))
    desk, plan = desk_of()
    record = CommissioningRecord(path)
    CommissioningProcedure(desk, desk, plan, record).run(('foam', 'step'))
    assert record.keys() == {'rest', 'pads', 'first movement', 'stops'}
    assert not desk.commands


# ---- the check ----


def truth_changed(**changes):
    def change(desk):
        desk.truth = replace(desk.truth, **{name: value(desk.truth) for name, value in changes.items()})
        desk._springs = [desk._springs_of(number) for number in (0, 1)]
    return change


def zero_changed(pad, value):
    def change(desk):
        desk._zero[pad] = value(desk._zero[pad])
    return change


def lose_taxel(truth):
    return (truth.faulty[0], (*truth.faulty[1], (8, 8)))


def turn_left_pad(truth):
    return ((truth.mounts[0][0] + 1) % 4, truth.mounts[0][1]), truth.mounts[1]


CHANGES = {
    'nothing': (truth_changed(), set()),
    'taxel': (truth_changed(faulty=lose_taxel), {Change.TAXEL_LOST}),
    'zero': (zero_changed(0, lambda zero: zero + 0.05), {Change.ZERO_DRIFTED}),
    'exchanged': (zero_changed(1, lambda zero: 0.01 * np.random.default_rng(9).standard_normal(zero.shape)),
                  {Change.PAD_EXCHANGED}),
    'turned': (truth_changed(mounts=turn_left_pad), {Change.PAD_TURNED}),
    'swapped': (truth_changed(is_swapped=lambda truth: not truth.is_swapped), {Change.PADS_SWAPPED}),
    'latency': (truth_changed(latency=lambda truth: truth.latency + 0.05), {Change.STARTS_LATER, Change.STOPS_LATER}),
    'speed': (truth_changed(speed_factor=lambda truth: 0.85 * truth.speed_factor), {Change.SPEED}),
    'stop': (truth_changed(failing=lambda truth: StopWay.GOAL if truth.failing is not StopWay.GOAL else StopWay.CANCEL,
                           failing_share=lambda truth: 1.0), {Change.STOP_FAILS})}


@pytest.mark.slow
@pytest.mark.parametrize('name', [pytest.param(name, marks=() if name == 'exchanged' else pytest.mark.long)
                                  for name in CHANGES])
def test_a_check_names_the_change_and_no_other(finished, tmp_path, name):
    change, expected = CHANGES[name]
    desk, plan = desk_of()
    change(desk)
    record = CommissioningRecord(tmp_path / 'check.json')
    CommissioningProcedure(desk, desk, replace(plan, stop_trials=3), record).run(OPTIONAL)
    found = find_changes(CommissioningRecord(finished[2]), record, plan)
    assert {each.change for each in found} == expected, list(map(str, found))


CHANGED_RECORDS = {
    'taxel': (('pads', 'taxels', 0, 3, 4), TaxelFinding.FAULTY, Change.TAXEL_LOST),
    'turned': (('pads', 'mountings', 0), [3, True], Change.PAD_TURNED),
    'direction': (('first movement', 'opens_rising'), None, Change.DIRECTION),
    'late stop': (('stops', 'trials', 'cancel', 0), (True, 0.01, 0.9, False), Change.STOPS_LATER),
    'late start': (('stops', 'trials', 'cancel', 0), (True, 0.9, 0.01, False), Change.STARTS_LATER),
    'failed stop': (('stops', 'trials', 'cancel', 0), (False, 0.01, 0.01, False), Change.STOP_FAILS),
    'speed': (('stops', 'speed'), (1.0, 1e-6), Change.SPEED),
    'rate': (('rest', 'pads', 0, 'rate'), 33.0, Change.FRAME_RATE)}


@pytest.mark.slow
@pytest.mark.parametrize('name', CHANGED_RECORDS)
def test_a_changed_record_shows_its_change(finished, tmp_path, name):
    path, value, change = CHANGED_RECORDS[name]
    first = CommissioningRecord(finished[2])
    content = json.loads(finished[2].read_text())
    part = content['steps']
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = not part[path[-1]] if value is None else value
    (tmp_path / 'check.json').write_text(json.dumps(content))
    found = find_changes(first, CommissioningRecord(tmp_path / 'check.json'), finished[1])
    assert [each.change for each in found] == [change]


@pytest.mark.slow
def test_a_tared_pad_is_not_taken_for_another_pad(finished, tmp_path):
    content = json.loads(finished[2].read_text())
    for number, pad in enumerate(content['steps']['rest']['pads']):
        pad['zero'] = (1e-5 * np.random.default_rng(number).standard_normal((GRID.rows, GRID.cols))).tolist()
    (tmp_path / 'check.json').write_text(json.dumps(content))
    found = find_changes(CommissioningRecord(finished[2]), CommissioningRecord(tmp_path / 'check.json'), finished[1])
    assert Change.PAD_EXCHANGED not in {each.change for each in found}


@pytest.mark.slow
def test_an_exchanged_pad_that_was_tared_is_found_by_its_serial_number(finished, tmp_path):
    content = json.loads(finished[2].read_text())
    for number, pad in enumerate(content['steps']['rest']['pads']):
        pad['zero'] = (1e-5 * np.random.default_rng(number).standard_normal((GRID.rows, GRID.cols))).tolist()
    first = CommissioningRecord(finished[2])
    assert content['steps']['rest']['serial_numbers'] == ['1001', '1002']
    content['steps']['rest']['serial_numbers'] = ['1001', '1003']
    (tmp_path / 'check.json').write_text(json.dumps(content))
    found = find_changes(first, CommissioningRecord(tmp_path / 'check.json'), finished[1])
    assert [str(each) for each in found if each.change is Change.PAD_EXCHANGED] == [
        f'pad 2 of the driver: {Change.PAD_EXCHANGED.value}: serial number 1003, was serial number 1002']


def test_a_plan_survives_its_record(tmp_path):
    _, plan = desk_of()
    CommissioningRecord(tmp_path / 'record.json').save('plan', asdict(plan))
    assert plan_from(CommissioningRecord(tmp_path / 'record.json')['plan']) == plan


def test_frames_with_missing_values_neither_hide_the_noise_nor_lower_the_mean():
    rng = np.random.default_rng(11)
    forces = 1.0 + 0.003 * rng.standard_normal((400, 4, 4))
    forces[7] = np.nan            # a frame without any value
    forces[100:103, 1] = np.nan   # a lost CAN frame carries a row
    forces[:, 3, 3] = np.nan      # a dead taxel
    found = measure_rest(PadFrames(0.02 * np.arange(400), np.arange(400), forces))
    assert found.noise.value == pytest.approx(0.003, rel=0.05)
    assert found.drift.is_known
    assert np.isnan(found.zero[3, 3]) and np.count_nonzero(np.isnan(found.zero)) == 1
    assert found.zero[1, 0] == pytest.approx(1.0, abs=0.001)


def test_a_lightly_held_object_is_no_emergency_stop():
    """The force of a small effort on many taxels is below the drift of each of them."""
    desk, plan = desk_of()
    desk.ask(Question(Act.FOAM, 'Hold the foam.'))
    guarded = GuardedGripper(desk, desk, plan)
    closed = plan.high if desk.truth.closes_rising else plan.low
    effort = desk.truth.idle_effort * 1.02
    guarded.move(Move(closed, effort, plan.travel / 4), 'here', may_touch=True)
    assert 0 < desk._force(guarded.reading) < 0.5
    guarded.move(Move(closed, 1.01 * effort, plan.travel / 4), 'here', may_touch=True)
    assert Act.DIRECTION not in [question.act for question in desk.questions]


def test_pads_whose_frames_arrive_apart_are_not_silent():
    desk, plan = desk_of()
    advance, calls = desk.advance, itertools.count()

    def one_pad_at_a_time(seconds):
        recording, number = advance(seconds), next(calls) % 2
        pads = [PadFrames(*(each[:len(each) * (pad == number)] for each in frames))
                for pad, frames in enumerate(recording.pads)]
        return recording._replace(pads=tuple(pads))
    desk.advance = one_pad_at_a_time
    GuardedGripper(desk, desk, plan).watch(2.0, 'here', may_touch=True)


@pytest.mark.parametrize('pad', [0, 1])
def test_one_silent_pad_stops_the_gripper(pad):
    desk, plan = desk_of()
    advance = desk.advance

    def without_pad(seconds):
        pads = list(advance(seconds).pads)
        pads[pad] = PadFrames(*(each[:0] for each in pads[pad]))
        return Recording(tuple(pads), advance(0.01).joint)
    desk.advance = without_pad
    with pytest.raises(RefusedStepError) as refused:
        GuardedGripper(desk, desk, plan).watch(2.0, 'here', may_touch=True)
    assert refused.value.mistake is Mistake.PADS_SILENT
