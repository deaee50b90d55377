"""Tests for fusing the recognitions of successive frames.

Fusion evens out noise, never becomes surer than the frames, has a bounded latency, and starts again when nothing
touches the pad.
"""

import math

import numpy as np
import pytest

from tactile_node.errors import ConfigurationError
from tactile_node.shape.fusion import FusionSettings, RecognitionFusion
from tactile_node.shape.recognition import Recognition, Shape, TaughtShape, UnknownReason
from training.ground_truth.seeds import Purpose, generator

PERIOD = 0.01
SQUARE = {Shape.SQUARE: 0.6, Shape.CIRCLE: 0.3, Shape.UNKNOWN: 0.1}
CIRCLE = {Shape.SQUARE: 0.08, Shape.CIRCLE: 0.8, Shape.UNKNOWN: 0.08, Shape.RECTANGLE: 0.04}


def feed(fusion, frames, start=0.0, period=PERIOD):
    return [fusion.update(start + i * period, Recognition.of(frame)) for i, frame in enumerate(frames)]


def test_the_first_frame_is_taken_as_it_is():
    fused = RecognitionFusion().update(5.0, Recognition.of(SQUARE))
    assert fused.recognition.shape is Shape.SQUARE
    assert fused.recognition.confidence == pytest.approx(0.6)
    assert (fused.since, fused.held, fused.frames) == (5.0, 0.0, 1)


@pytest.mark.parametrize('period, kept', [(0.1 * math.log(1.25), 0.8), (0.4, 0.7)])
def test_frames_count_by_their_age_and_on_a_slow_skin_by_their_number(period, kept):
    first, second = feed(RecognitionFusion(), [{Shape.SQUARE: 0.8, Shape.CIRCLE: 0.2},
                                               {Shape.SQUARE: 0.6, Shape.CIRCLE: 0.4}], period=period)
    assert second.recognition.confidence == pytest.approx((kept * 0.8 + 0.6) / (kept + 1))


@pytest.mark.parametrize('period', [0.005, 0.01, 0.02, 0.1, 0.5])
def test_a_change_is_followed_within_the_stated_frames_and_not_by_one(period):
    settings = FusionSettings()
    fusion = RecognitionFusion(settings)
    feed(fusion, [SQUARE] * 300, period=period)
    after = feed(fusion, [CIRCLE] * 400, 300 * period, period)
    follows = [each.recognition.shape for each in after].index(Shape.CIRCLE) + 1
    assert 1 < follows <= settings.frames_to_follow(period, 10.0)
    assert after[follows - 1].since == pytest.approx((300 + follows - 1) * period)


def test_none_is_reported_at_once_and_forgets():
    fusion = RecognitionFusion()
    feed(fusion, [SQUARE] * 50)
    empty = fusion.update(0.5, Recognition.certain(Shape.NONE))
    again = fusion.update(0.51, Recognition.of(CIRCLE))
    assert empty.recognition.shape is Shape.NONE and empty.held == 0
    assert again.recognition.shape is Shape.CIRCLE and again.frames == 1


def test_an_empty_pad_counts_its_frames_like_a_shape():
    fusion = RecognitionFusion()
    feed(fusion, [SQUARE] * 5)
    empty = [fusion.update(0.5 + 0.25 * i, Recognition.certain(Shape.NONE)) for i in range(3)]
    assert [(each.since, each.held, each.frames) for each in empty] == [(0.5, 0.0, 1), (0.5, 0.25, 2), (0.5, 0.5, 3)]
    first = fusion.update(1.25, Recognition.of(SQUARE))
    assert first.frames == 1 and first.recognition.confidence == pytest.approx(0.6)
    assert fusion.update(1.5, Recognition.certain(Shape.NONE)).frames == 1


@pytest.mark.parametrize('stamp', [0.1, 9.0])
def test_a_stamp_that_jumps_starts_again(stamp):
    fusion = RecognitionFusion()
    feed(fusion, [SQUARE] * 50)
    assert fusion.update(stamp, Recognition.of(CIRCLE)).recognition.shape is Shape.CIRCLE


@pytest.mark.parametrize('wrong', [{'memory': 0.0}, {'switch': 0.9}, {'switch': 3.0}, {'max_gap': float('nan')}])
def test_settings_that_cannot_work_are_refused(wrong):
    with pytest.raises(ConfigurationError):
        FusionSettings(**wrong)


def test_an_unseen_frame_is_reported_at_once_and_adds_no_evidence():
    fusion, unseen = RecognitionFusion(), Recognition.unknown(UnknownReason.NOT_SEEN)
    before = feed(fusion, [SQUARE] * 50)[-1]
    for k in range(20):
        found = fusion.update(0.5 + k * PERIOD, unseen)
        assert (found.recognition, found.held, found.frames) == (unseen, 0.0, 0)
    after = fusion.update(0.7, Recognition.of(SQUARE))
    assert after.recognition.shape is Shape.SQUARE
    assert after.recognition.confidence > 0.9 * before.recognition.confidence
    assert (after.since, after.held, after.frames) == (0.7, 0.0, 1), 'an unseen contact does not count as held'


@pytest.mark.parametrize('frame', [
    Recognition.of({Shape.SQUARE: 0.75, Shape.RECTANGLE: 0.25}),
    Recognition.mean_of((0.75, 0.25), [Recognition.certain(Shape.SQUARE), Recognition.certain(Shape.RECTANGLE)])])
def test_no_number_of_frames_makes_a_repeated_answer_surer(frame):
    """All frames show the same skin and the same hidden taxels, so most of their errors are the same."""
    fusion = RecognitionFusion()
    for k in range(200):
        found = fusion.update(k * PERIOD, frame)
    assert found.recognition.shape is Shape.SQUARE and found.recognition.confidence == pytest.approx(0.75, abs=0.01)


@pytest.mark.parametrize('second', [{Shape.SQUARE: 0.84, Shape.UNKNOWN: 0.16},
                                    {Shape.SQUARE: 0.84, Shape.CIRCLE: 0.16}])
def test_frames_that_differ_are_no_surer_than_the_surest(second):
    """The rest of the probability of each frame belongs to another class."""
    fusion, frames = RecognitionFusion(), [{Shape.SQUARE: 0.89, Shape.RECTANGLE: 0.11}, second]
    found = feed(fusion, frames * 100, period=0.02)
    assert all(each.recognition.shape is Shape.SQUARE and each.recognition.confidence < 0.8901 for each in found)


@pytest.mark.parametrize('period', [0.02, 0.1, 0.2, 0.4])
def test_one_wrong_frame_in_ten_neither_changes_the_name_nor_makes_another_sure(period):
    right, wrong = {Shape.SQUARE: 0.97, Shape.CIRCLE: 0.03}, {Shape.CIRCLE: 0.97, Shape.SQUARE: 0.03}
    found = feed(RecognitionFusion(), [*[right] * 10, *[wrong, *[right] * 9] * 20], period=period)
    assert {each.recognition.shape for each in found} == {Shape.SQUARE}


@pytest.mark.parametrize('is_doubted', [lambda k: False, lambda k: True, lambda k: k % 2 == 0, lambda k: k % 5 < 2])
def test_a_doubt_that_comes_and_goes_does_not_settle_a_disagreement(is_doubted):
    frame = Recognition.of({Shape.SQUARE: 0.85, Shape.RECTANGLE: 0.15})
    doubted = frame.no_surer_than(0.85, UnknownReason.UNFAMILIAR)
    fusion = RecognitionFusion()
    found = [fusion.update(k * PERIOD, doubted if is_doubted(k) else frame) for k in range(200)]
    assert found[-1].recognition.shape is Shape.SQUARE
    assert all(each.recognition.confidence < 0.9 for each in found)


def test_an_object_that_covers_the_pad_is_no_evidence():
    answers = Recognition.of({Shape.UNKNOWN: 0.7, Shape.SQUARE: 0.3}, UnknownReason.NOT_SEEN)
    assert answers.is_evidence and not answers._replace(reason=UnknownReason.COVERS_PAD).is_evidence
    assert not Recognition.unknown(UnknownReason.NOT_SEEN).is_evidence


def test_the_reason_of_unknown_is_that_of_the_frames():
    fusion = RecognitionFusion()
    for k, reason in enumerate([UnknownReason.TOO_SMALL] * 20):
        found = fusion.update(k * PERIOD, Recognition.unknown(reason))
        assert (found.recognition.shape, found.recognition.reason) == (Shape.UNKNOWN, reason)
    for k in range(20, 60):
        found = fusion.update(k * PERIOD, Recognition.certain(Shape.SQUARE))
    assert (found.recognition.shape, found.recognition.reason) == (Shape.SQUARE, UnknownReason.NOT_UNKNOWN)


def test_a_contact_that_has_become_too_small_ends_at_once():
    """After a release, a residue once kept the earlier shape until an equal number of frames outweighed that shape."""
    fusion = RecognitionFusion()
    for k in range(50):
        held = fusion.update(0.02 * k, Recognition.of({Shape.CIRCLE: 0.99, Shape.SQUARE: 0.01}))
    assert held.recognition.shape is Shape.CIRCLE
    small = fusion.update(1.0, Recognition.unknown(UnknownReason.TOO_SMALL))
    assert (small.recognition.shape, small.recognition.reason) == (Shape.UNKNOWN, UnknownReason.TOO_SMALL)
    again = fusion.update(1.02, Recognition.of({Shape.SQUARE: 0.9, Shape.CIRCLE: 0.1}))
    assert (again.recognition.shape, again.frames) == (Shape.SQUARE, 1)


def test_flicker_between_two_classes_is_quietened():
    rng = generator(Purpose.TEST, 4)
    share = rng.uniform(0.25, 0.8, 400)  # The true class leads in roughly three out of four frames.
    frames = [{Shape.SQUARE: p, Shape.CIRCLE: 1 - p} for p in share]
    fused = [each.recognition.shape for each in feed(RecognitionFusion(), frames)]
    single = [max(frame, key=frame.get) for frame in frames]

    def changes(shapes):
        return sum(a is not b for a, b in zip(shapes, shapes[1:]))

    assert changes(single) > 100 and changes(fused) <= 2


def test_unknown_is_reported_as_soon_as_it_leads():
    fusion = RecognitionFusion()
    feed(fusion, [{Shape.SQUARE: 1.0}] * 50)
    found = feed(fusion, [{Shape.UNKNOWN: 1.0}] * 20, 0.5)
    for each in found:
        leads = each.recognition.probabilities[Shape.UNKNOWN] > each.recognition.probabilities[Shape.SQUARE]
        assert (each.recognition.shape is Shape.UNKNOWN) == leads


def test_probabilities_sum_to_one_and_survive_certain_frames():
    fused = feed(RecognitionFusion(), [{Shape.SQUARE: 1.0}, {Shape.CIRCLE: 1.0}, {Shape.UNKNOWN: 1.0}] * 20)
    for each in fused:
        total = math.fsum(each.recognition.probabilities.values())
        assert total == pytest.approx(1) and np.isfinite(total)


def test_after_a_long_time_unseen_it_starts_again():
    fusion, settings = RecognitionFusion(), FusionSettings()
    feed(fusion, [SQUARE] * 50)
    for k in range(60):
        fusion.update(0.5 + k * PERIOD, Recognition.unknown(UnknownReason.NOT_SEEN))
    assert 1.1 - 0.49 > settings.max_gap
    assert fusion.update(1.1, Recognition.of(CIRCLE)).recognition.shape is Shape.CIRCLE


def test_two_contacts_with_an_unseen_time_between_them_share_no_evidence():
    fusion = RecognitionFusion()
    feed(fusion, [SQUARE] * 50)
    fusion.update(0.5, Recognition.certain(Shape.NONE))
    fusion.update(0.51, Recognition.unknown(UnknownReason.NOT_SEEN))
    assert fusion.update(0.52, Recognition.of(CIRCLE)).recognition.shape is Shape.CIRCLE


def doubted():
    return Recognition.of({Shape.RIGHT_TRIANGLE: 0.97, Shape.CIRCLE: 0.03}).no_surer_than(0.85, UnknownReason.TOO_SMALL)


def test_no_number_of_frames_makes_a_name_sure_that_the_taxels_do_not_support():
    fusion = RecognitionFusion()
    for k in range(300):
        fused = fusion.update(k * PERIOD, doubted())
        assert fused.recognition.shape is Shape.RIGHT_TRIANGLE and fused.recognition.confidence < 0.851
    assert fused.recognition.confidence > 0.8


def test_a_doubt_of_a_taught_shape_world_has_all_of_its_classes():
    cup = TaughtShape('cup')
    found = Recognition.of({Shape.SQUARE: 0.95, cup: 0.05}).no_surer_than(0.85, UnknownReason.UNFAMILIAR)
    fused = RecognitionFusion().update(0.0, found.over((*Shape, cup)))
    assert cup in fused.recognition.probabilities and fused.recognition.confidence < 0.85


def test_a_hidden_part_and_a_doubt_are_both_kept_by_the_fusion():
    readings = [doubted(), Recognition.of({Shape.RIGHT_TRIANGLE: 0.9, Shape.SQUARE: 0.1}), doubted()]
    frame = Recognition.mean_of((0.5, 0.25, 0.25), readings)
    assert sum(frame.probabilities.values()) == pytest.approx(1)
    fusion = RecognitionFusion()
    fused = [fusion.update(k * PERIOD, frame) for k in range(300)][-1]
    assert 0.8 < fused.recognition.confidence < 0.25 + 0.75 * 0.851


def test_a_new_doubt_lowers_an_earlier_high_confidence():
    fusion = RecognitionFusion()
    for k in range(100):
        sure = fusion.update(k * PERIOD, Recognition.of({Shape.RIGHT_TRIANGLE: 0.97, Shape.CIRCLE: 0.03}))
    for k in range(100, 200):
        fused = fusion.update(k * PERIOD, doubted())
    assert sure.recognition.confidence > 0.95 and fused.recognition.confidence < 0.851
