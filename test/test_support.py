"""The confidence of a class is never higher than the taxels allow.

For an unknown contact, the result states why it is none of the five shapes.
"""

import numpy as np
import pytest
from scipy import ndimage

from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.shape.methods import make_recogniser, why_unfamiliar
from tactile_node.shape.recognition import Recognition, Shape, UnknownReason
from tactile_node.shape.support import (
    as_far_as_it_fits,
    as_far_as_it_holds,
    as_far_as_it_is_filled,
    as_far_as_no_edge_shapes_it,
    low_outline,
)

DOUBTED = 0.85 * 0.95  # Confidence of a doubted class whose confidence was 0.95 before the doubt.
SURE_CIRCLE = Recognition.of({Shape.CIRCLE: 0.95, Shape.SQUARE: 0.04, Shape.UNKNOWN: 0.01})
Y, X = np.mgrid[:30, :40]


@pytest.mark.parametrize(('taxels', 'overlaps', 'expected', 'doubt'), [
    (60, (0.6, 0.7, 0.6, 0.8), (Shape.CIRCLE, 0.95), UnknownReason.NOT_UNKNOWN),
    # The circle covers too little of the contact.
    (60, (0.5, 0.5, 0.5, 0.6), (Shape.CIRCLE, DOUBTED), UnknownReason.UNFAMILIAR),
    # A square covers more of the contact than the circle.
    (60, (0.6, 0.8, 0.6, 0.7), (Shape.CIRCLE, DOUBTED), UnknownReason.UNFAMILIAR),
    # A square covers nearly as much as the circle.
    (100, (0.6, 0.7, 0.6, 0.71), (Shape.CIRCLE, DOUBTED), UnknownReason.UNFAMILIAR),
    (100, (0.6, 0.7, 0.6, 0.75), (Shape.CIRCLE, 0.95), UnknownReason.NOT_UNKNOWN),
    (100, (0.6, 0.8, 0.6, 0.7), (Shape.SQUARE, DOUBTED), UnknownReason.UNFAMILIAR),
    # With 20 taxels, the rim of the contact is too coarse to cause a doubt.
    (20, (0.6, 0.7, 0.6, 0.5), (Shape.CIRCLE, 0.95), UnknownReason.NOT_UNKNOWN)])
def test_a_sure_name_covers_a_large_contact_better_than_the_others(taxels, overlaps, expected, doubt):
    found = as_far_as_it_fits(SURE_CIRCLE, taxels, np.array(overlaps))
    assert (found.shape, found.confidence) == (expected[0], pytest.approx(expected[1])) and found.doubt is doubt
    assert sum(found.probabilities.values()) == pytest.approx(1.0)


def test_a_square_is_a_rectangle_too():
    square = Recognition.of({Shape.SQUARE: 0.95, Shape.UNKNOWN: 0.05})
    assert as_far_as_it_fits(square, 60, np.array((0.8, 0.75, 0.5, 0.7))) is square


@pytest.mark.parametrize(('shape', 'rows', 'cols', 'is_doubted'), [
    (Shape.RECTANGLE, (0, 8), (0, 5), True),
    (Shape.RECTANGLE, (2, 10), (11, 16), False),
    (Shape.RECTANGLE, (0, 12), (4, 8), False),  # Both long sides of the bar are visible.
    (Shape.SQUARE, (0, 12), (2, 14), True),
    (Shape.SQUARE, (0, 6), (0, 6), False),
    (Shape.RIGHT_TRIANGLE, (0, 8), (0, 5), False)])
def test_a_sure_name_has_no_sides_that_may_be_edges_of_the_pad(shape, rows, cols, is_doubted):
    mask = np.zeros((12, 16), bool)
    mask[slice(*rows), slice(*cols)] = True
    sure = Recognition.of({shape: 0.95, Shape.UNKNOWN: 0.05})
    found = as_far_as_no_edge_shapes_it(sure, mask)
    assert found.shape is shape and found.confidence == pytest.approx(DOUBTED if is_doubted else 0.95)
    assert found.doubt is (UnknownReason.CUT_BY_EDGE if is_doubted else UnknownReason.NOT_UNKNOWN)


def test_a_triangle_of_on_off_taxels_in_the_corner_of_the_pad_is_not_a_sure_rectangle():
    """The triangle could also be the end of a rectangle that lies across the corner."""
    triangle = Y[:10, :12] < 9 - 9 * X[:10, :12] / 7
    found = make_recogniser().recognise(ContactPattern.of(triangle, triangle.astype(float)))
    assert found.confidence < 0.9


def test_a_name_holds_along_a_low_outline():
    assert as_far_as_it_holds(SURE_CIRCLE, SURE_CIRCLE) is SURE_CIRCLE
    other = as_far_as_it_holds(SURE_CIRCLE, Recognition.of({Shape.UNKNOWN: 0.6, Shape.CIRCLE: 0.4}))
    assert other.confidence == pytest.approx(DOUBTED)
    assert (other.shape, other.doubt) == (Shape.CIRCLE, UnknownReason.UNSTABLE)
    unsure = Recognition.of({Shape.CIRCLE: 0.8, Shape.UNKNOWN: 0.2})
    assert as_far_as_it_holds(unsure, Recognition.certain(Shape.UNKNOWN)) is unsure


def test_a_low_outline_has_the_weak_pressures_joined_to_the_contact():
    values = np.zeros((6, 9))
    values[2:4, 2:4] = 1.0
    values[2:4, 4:6] = 0.3
    values[0, 8] = 0.3  # This taxel belongs to another contact.
    mask = values > 0.5
    np.testing.assert_array_equal(low_outline(values, mask), (values > 0.2) & (X[:6, :9] < 7))
    assert low_outline(mask.astype(float), mask) is None, 'on/off taxels have no weak values'
    assert low_outline(np.full((6, 9), np.nan), mask) is None


def speckled_square(rng):
    """Return a block with blunt corners whose pressure falls towards the corners.

    The gains of the taxels differ by up to 3:1.
    """
    turn, side, corner = rng.uniform(0, np.pi), rng.uniform(11, 17), rng.uniform(1, 4)
    x, y = X - rng.uniform(17, 22), Y - rng.uniform(13, 16)
    u, v = abs(x * np.cos(turn) + y * np.sin(turn)), abs(y * np.cos(turn) - x * np.sin(turn))
    du, dv = u - side / 2 + corner, v - side / 2 + corner
    inside = np.hypot(np.maximum(du, 0), np.maximum(dv, 0)) + np.minimum(np.maximum(du, dv), 0) <= corner
    dome = 1 - rng.uniform(0.1, 0.7) * ((2 * u / side) ** 2 + (2 * v / side) ** 2) / 2
    return 200 * ndimage.gaussian_filter(inside * dome, 0.7) * np.exp(0.42 * rng.standard_normal(X.shape))


def fragment(rng):
    """Return the values under a wide foreign object that presses unevenly.

    An outline at half of the level would show only a fragment of this object.
    """
    pressed = 0.2 * (np.hypot((X - 19) / 11, (Y - 15) / 8) <= 1)
    for level in (1.0, *rng.uniform(0.15, 0.4, 5)):
        x, y, long, wide = rng.uniform((10, 8, 2.5, 2), (28, 22, 5, 4))
        pressed = np.maximum(pressed, level * (np.hypot((X - x) / long, (Y - y) / wide) <= 1))
    return 200 * ndimage.gaussian_filter(pressed, 0.8) * np.exp(0.2 * rng.standard_normal(X.shape))


@pytest.mark.parametrize(('draw', 'right'), [(speckled_square, {Shape.SQUARE}), (fragment, set())])
def test_confident_names_are_hardly_ever_wrong(draw, right):
    """At most one of 40 reported classes may be both confident and wrong.

    Without the check, the network reports 7 confident but wrong classes for the squares, and 6 for the fragments.
    """
    recogniser, wrong = make_recogniser(), 0
    for seed in range(40):
        found = recogniser.recognise(PatternExtractor().extract(np.round(draw(np.random.default_rng(seed)))))
        wrong += found.confidence >= 0.9 and found.shape not in right | {Shape.UNKNOWN}
    assert wrong <= 1


def spiral(rng):
    """Return the on/off taxels of a strip that is wound into a spiral."""
    x, y = X - rng.uniform(18, 21), Y - rng.uniform(13, 16)
    turns, radius, width = rng.uniform(1.3, 2.2), rng.uniform(7, 11), rng.uniform(1.8, 3)
    turned = (np.arctan2(y, x) - rng.uniform(0, 2 * np.pi)) % (2 * np.pi) + 2 * np.pi * np.arange(3)[:, None, None]
    arm = radius * (0.1 + 0.9 * turned / (2 * np.pi * turns))
    return ((abs(np.hypot(x, y) - arm) <= width / 2) & (turned <= 2 * np.pi * turns)).any(0)


def test_a_spiral_of_on_off_taxels_is_hardly_ever_a_sure_name():
    """At most 3 of 40 spirals may have a sure name. Without the check, 23 have one."""
    recogniser = make_recogniser()
    found = [recogniser.recognise(of(spiral(np.random.default_rng(seed)))) for seed in range(40)]
    assert sum(each.confidence >= 0.9 and each.shape is not Shape.UNKNOWN for each in found) <= 3
    doubted = [each for each in found if each.doubt is UnknownReason.UNFAMILIAR]
    assert doubted and all(each.confidence <= 0.85 for each in doubted)


DISC = np.hypot(Y - 15, X - 20) <= 8
RING = DISC & (np.hypot(Y - 15, X - 20) >= 4.8)


@pytest.mark.parametrize('taxels', [
    DISC, RING, DISC & (X // 2 != 9), RING & (X // 2 != 9), RING & (Y // 2 != 7), DISC & ((X + 2 * Y) % 7 != 0)],
    ids=['solid', 'rim', 'silent columns', 'rim, silent columns', 'rim, silent rows', 'silent taxels'])
def test_a_solid_contact_and_a_rim_keep_a_sure_name(taxels):
    assert as_far_as_it_is_filled(SURE_CIRCLE, taxels.astype(float), taxels) is SURE_CIRCLE


def test_a_gap_causes_a_doubt_and_a_taxel_without_a_value_is_no_gap():
    gaps = (X < 22) & (Y % 3 != 0)
    taxels, values = DISC & ~gaps, DISC.astype(float)
    assert as_far_as_it_is_filled(SURE_CIRCLE, np.where(gaps, np.nan, values), taxels) is SURE_CIRCLE
    found = as_far_as_it_is_filled(SURE_CIRCLE, np.where(gaps, 0.0, values), taxels)
    assert (found.confidence, found.doubt) == (pytest.approx(DOUBTED), UnknownReason.UNFAMILIAR)


def of(taxels):
    return ContactPattern.of(taxels, np.where(taxels, 1.0, 0.0))


@pytest.mark.parametrize(('taxels', 'reason'), [
    ((Y > 3) | (X > 3), UnknownReason.COVERS_PAD),
    ((abs(Y - 15) < 3) & (abs(X - 15) < 9) & (X % 6 != 0), UnknownReason.SEVERAL_PARTS),
    (abs(np.hypot(Y - 15, X - 15) - 7) < 1.5, UnknownReason.HOLLOW),
    (np.hypot(Y, X - 15) < 8, UnknownReason.CUT_BY_EDGE),
    ((abs(Y - 15) < 2) & (abs(X - 15) < 9) | (abs(X - 15) < 2) & (abs(Y - 15) < 9), UnknownReason.UNFAMILIAR)])
def test_a_contact_of_an_unknown_shape_has_a_reason(taxels, reason):
    if reason is UnknownReason.SEVERAL_PARTS:
        labels = ndimage.label(taxels)[0]
        pattern = of(taxels)._replace(mask=labels == 1, contacts=int(labels.max()))
    else:
        pattern = of(taxels)
    assert why_unfamiliar(pattern) is reason


def test_the_answer_has_the_reason():
    recogniser = make_recogniser()
    racket = (abs(np.hypot(Y - 15, X - 10) - 6) < 1.5) | (abs(Y - 15) < 1.5) & (X > 15) & (X < 36)
    found = recogniser.recognise(PatternExtractor().extract(racket.astype(bool)))
    assert (found.shape, found.reason) == (Shape.UNKNOWN, UnknownReason.HOLLOW)
    assert found.as_json()['reason'] == 'hollow'
    y, x = np.mgrid[:6, :6]
    covered = np.round(10 + 5 * np.exp(-((y - 2.4) ** 2 + (x - 2.8) ** 2) / 12), 2)
    found = recogniser.recognise(PatternExtractor().extract(covered))
    assert (found.shape, found.reason, found.is_evidence) == (Shape.UNKNOWN, UnknownReason.COVERS_PAD, False)


def test_a_first_frame_without_a_taxel_near_0_is_not_taken_for_an_empty_pad():
    recogniser, rng = make_recogniser(), np.random.default_rng(3)
    unlike = rng.normal(15.0, 1.5, (6, 6))
    extractor = PatternExtractor()
    first = recogniser.recognise(extractor.extract(unlike))
    assert (first.shape, first.reason) == (Shape.UNKNOWN, UnknownReason.COVERS_PAD)
    # The first frame has shown the rest values of this array.
    at_rest = extractor.extract(rng.normal(15.0, 1.5, (6, 6)))
    assert recogniser.recognise(at_rest).shape is Shape.NONE
    assert recogniser.recognise(PatternExtractor().extract(rng.normal(0.0, 1.5, (6, 6)))).shape is Shape.NONE


#: Readings of a 6x6 array under a block of 6x5 taxels, whose gains differ. No group of taxels stands out.
COVERED = np.array([[28, 60, 48, 57, 52, 22], [54, 63, 88, 71, 65, 39], [42, 77, 89, 81, 70, 35],
                    [43, 50, 71, 87, 95, 37], [42, 66, 56, 62, 71, 33], [22, 55, 50, 54, 55, 22]], float)


def shapes_of(frames):
    recogniser, extractor = make_recogniser(), PatternExtractor()
    return [recogniser.recognise(extractor.extract(frame)).shape for frame in frames]


def test_a_small_array_is_not_empty_while_an_object_covers_it():
    rng = np.random.default_rng(4)
    held = [COVERED + rng.normal(0, 1, COVERED.shape) for _ in range(10)]
    fading = [level * COVERED + rng.normal(0, 1, COVERED.shape) for level in (0.8, 0.6, 0.4, 0.3)]
    rest = [rng.normal(5, 1, COVERED.shape) for _ in range(5)]
    found = shapes_of([*held, *fading, *rest])
    assert Shape.NONE not in found[:14] and set(found[15:]) == {Shape.NONE}


def test_a_small_array_that_is_covered_after_a_loss_is_not_empty():
    lost = COVERED.copy()
    lost[2, 3] = np.nan
    assert Shape.NONE not in shapes_of([lost, COVERED, COVERED])[1:]


@pytest.mark.parametrize('frames', [
    np.random.default_rng(5).normal(9, 3, (20, 6, 6)),          # noise that rarely reaches 0
    np.tile(2.0 + np.arange(36).reshape(6, 6) * 7 % 3, (20, 1, 1)),  # levels at rest that differ by two counts
    np.random.default_rng(6).normal(np.random.default_rng(7).normal(100, 12, (6, 6)), 1, (20, 6, 6))],
    ids=['noise', 'counts', 'offsets'])
def test_a_small_array_at_rest_is_empty_from_the_second_frame_on(frames):
    assert set(shapes_of(frames)[1:]) == {Shape.NONE}
