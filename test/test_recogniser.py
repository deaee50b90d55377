"""The learned recogniser: what it must say whatever its weights, and that its weights say something."""

from zipfile import ZIP_LZMA, ZipFile

import numpy as np
import pytest

from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.errors import ConfigurationError
from tactile_node.helmholtz.features import Group, compute_features
from tactile_node.package_files import config_path
from tactile_node.shape import likeness
from tactile_node.shape.completion import completions
from tactile_node.shape.invariants import COUNT, ORDERS, describe
from tactile_node.shape.methods import METHODS, make_recogniser
from tactile_node.shape.network import Network
from tactile_node.shape.patch import ROOM, SIDE, join_pieces, joined, make_patch
from tactile_node.shape.recogniser import LOG_SIZES, Calibration, ShapeRecogniser
from tactile_node.shape.recognition import DEFAULT, LEARNED, VOLF, Shape, UnknownReason
from tactile_node.shape.volf import GROUPS
from tactile_node.simulator.world import CLASSES, Contact, Purpose, generator, random_contact
from training.field import NOMINAL_ON_OFF, NOMINAL_PRESSURE, Conditions, field_frame


@pytest.fixture(scope='module')
def recogniser():
    return ShapeRecogniser.from_file(config_path('recogniser.npz'))


def pattern_of(frame, press=0.3):
    return PatternExtractor(PressThresholds(press, 0.8 * press)).extract(np.asarray(frame, float))


def naive(network, image, geometry):
    """The network by definition: loops over places and taps."""
    flow = image
    for kernel, bias, taps in zip(network.kernels[:2], network.biases[:2], (4, 3)):
        padded = np.pad(flow, ((1, 1), (1, 1), (0, 0)))
        side = len(flow) // 2
        out = np.zeros((side, side, len(bias)))
        for row in range(side):
            for col in range(side):
                window = padded[2 * row:2 * row + taps, 2 * col:2 * col + taps]
                out[row, col] = np.maximum(window.reshape(-1) @ kernel + bias, 0)
        flow = out
    flow = np.concatenate((flow.reshape(-1), (geometry - network.middle) / network.spread))
    for kernel, bias in zip(network.kernels[2:-1], network.biases[2:-1]):
        flow = np.maximum(flow @ kernel + bias, 0)
    return flow @ network.kernels[-1] + network.biases[-1]


def test_network_is_the_documented_one():
    rng = np.random.default_rng(5)
    sizes = [(32, 4), (36, 6), (25 * 6 + 3, 7), (7, 6)]
    network = Network(tuple(rng.normal(size=size).astype(np.float32) for size in sizes),
                      tuple(rng.normal(size=size[1]).astype(np.float32) for size in sizes),
                      np.array([1.0, 2, 3]), np.array([1.0, 2, 4]))
    images, geometry = rng.random((3, SIDE, SIDE, 2)).astype(np.float32), rng.random((3, 3))
    for found, image, numbers in zip(network(images, geometry), images, geometry):
        np.testing.assert_allclose(found, naive(network, image, numbers), rtol=1e-3, atol=1e-3)


def test_calibration():
    """Equal logits share what is not foreign; at the size's bias foreign is as probable as not."""
    biases = np.append(3.0, np.ones(len(LOG_SIZES) - 1))
    even = Calibration(2.0, biases).probabilities(np.array([[7.0] * 5 + [3.0]]), LOG_SIZES[:1])
    np.testing.assert_allclose(even, [[0.1] * 5 + [0.5]])
    between = Calibration(2.0, biases).probabilities(np.array([[7.0] * 5 + [2.0]]), LOG_SIZES[:2].mean(keepdims=True))
    np.testing.assert_allclose(between, even)
    warm, hot = (Calibration(t, biases + 50).probabilities(np.array([[1.0, 0, 0, 0, 0, 0]]), LOG_SIZES[:1])
                 for t in (0.5, 2.0))
    assert warm[0, 0] == pytest.approx(np.e ** 2 / (np.e ** 2 + 4)) and hot[0, 0] < warm[0, 0]


@pytest.mark.parametrize('turned', [lambda a: a[::-1], lambda a: a[:, ::-1], lambda a: a.T, np.rot90])
def test_patch_of_turned_and_moved_contact_is_the_same(turned):
    contact = Contact('right_triangle', (11.0, 6.0, 1.0), x=14.3, y=15.1, angle=0.4)
    frame = contact.pattern(36, 40).astype(float)
    patch = make_patch(frame, frame > 0)
    for other in (turned(frame), np.roll(turned(frame), (3, 2), (0, 1))):
        found = make_patch(other, other > 0)
        np.testing.assert_array_equal(found.level, patch.level)
        np.testing.assert_allclose(describe(found), describe(patch))
    assert patch.level.sum() == frame.sum() and not patch.graded and patch.scale == 1


def test_patch_of_pressures_has_level_one_and_fills_dead_taxels():
    frame = 40e3 * Contact('rectangle', (8.0, 6.0), x=9.5, y=9.5).pattern(20, 20)
    frame[6, 6] = frame[9, 9] = np.nan
    frame[0, 0] = 20e3
    patch = make_patch(frame, frame > 30e3)
    inside = patch.level > 0.01
    np.testing.assert_allclose(patch.level[inside & (patch.unseen == 0)], 1, rtol=1e-6)
    frame[9, 4] = 20e3  # at the rim, half covered
    assert make_patch(frame, frame > 30e3).graded
    assert np.isclose(make_patch(frame, frame > 30e3).level, 0.5, atol=0.02).any()


def test_wide_contact_is_scaled_into_the_patch():
    mask = np.ones((5, 2 * ROOM), bool)
    patch = make_patch(np.pad(mask, 4).astype(float), np.pad(mask, 4))
    assert patch.scale == 2 and patch.level.sum() * 4 == pytest.approx(mask.sum())
    assert (patch.level > 0.01).any(0).sum() == ROOM


def test_torn_contact_is_joined_and_a_second_one_is_not():
    torn = np.zeros((12, 20), bool)
    torn[2:9, 2:5] = torn[2:9, 7:10] = True  # two silent columns between
    assert joined(pattern_of(torn)).sum() == 42
    apart = np.zeros((12, 20), bool)
    apart[2:9, 2:5] = apart[2:9, 8:10] = True  # three taxels between
    assert joined(pattern_of(apart)).sum() == 21


def test_pieces_that_are_joined_are_one_contact_in_mask_labels_and_counts():
    frame = np.zeros((14, 30), bool)
    frame[2:9, 2:5] = frame[2:9, 7:10] = True  # two silent columns between
    frame[2:6, 20:25] = frame[12, 2:4] = True  # others
    pattern = PatternExtractor(PressThresholds(0.5, 0.4)).extract(frame)
    assert (pattern.contacts, pattern.sizes) == (4, (21, 21, 20, 2))
    whole = join_pieces(pattern)
    assert (whole.contacts, whole.sizes) == (3, (42, 20, 2))
    np.testing.assert_array_equal(whole.mask, joined(pattern))
    assert whole.labels[3, 3] == whole.labels[3, 8] == 1 and whole.labels[3, 22] == 2 and whole.labels[12, 2] == 3
    alone = join_pieces(pattern_of(frame[:, 15:]))
    assert (alone.contacts, alone.sizes) == (1, (20,)), 'nothing to join'


def test_a_recognition_reports_whether_it_is_of_joined_pieces(recogniser):
    frame = np.zeros((14, 20), bool)
    frame[2:10, 2:5] = frame[2:10, 7:10] = True
    assert recogniser.recognise(pattern_of(frame)).joined
    assert not recogniser.recognise(pattern_of(frame[:, :6])).joined
    frame[2, 5:7] = True
    assert not recogniser.recognise(pattern_of(frame)).joined, 'in one piece'


def test_hull_numbers_of_a_square_and_a_strip():
    """Fill of the least box about 1, its sides' ratio as drawn (box of taxel centres, widened by a taxel)."""
    square, strip = (np.zeros((20, 20), bool) for _ in range(2))
    square[5:13, 5:13], strip[9:11, 2:18] = True, True
    for mask, ratio in ((square, 8 / (7 * 2 ** 0.5 + 1)), (strip, 2 / np.hypot(15, 1))):
        numbers = describe(make_patch(mask.astype(float), mask))
        assert numbers.shape == (COUNT,) and np.isfinite(numbers).all()
        fill, widths = numbers[4 + 9 + 1], numbers[4 + 9 + 2]
        assert fill == pytest.approx(1, abs=1e-3)
        assert widths == pytest.approx(ratio, rel=0.1)
        assert numbers[0] == pytest.approx(np.log(mask.sum()))


def test_silent_lines_inside_leave_the_hull():
    """A square with two silent columns: the hull's moments stay, the contact's own do not; coverage drops to 3/4."""
    whole = np.zeros((20, 20))
    whole[5:13, 5:13] = 1
    torn = whole.copy()
    torn[:, 8:10] = 0
    solid, split = (describe(make_patch(frame, frame > 0)) for frame in (whole, torn))
    end = COUNT - likeness.COUNT
    hull, own = slice(end - len(ORDERS), end), slice(4, 4 + len(ORDERS))
    np.testing.assert_allclose(split[hull], solid[hull], atol=1e-6)
    assert np.abs(split[own] - solid[own]).max() > 0.01
    covered = end - len(ORDERS) - 1
    assert split[covered] == pytest.approx(0.75 * solid[covered]) and solid[covered] == pytest.approx(1, abs=0.02)


def test_nothing_and_next_to_nothing(recogniser):
    assert recogniser.recognise(pattern_of(np.zeros((9, 9)))).shape is Shape.NONE
    few = np.zeros((9, 9))
    few[4, 3:7] = 1
    assert recogniser.recognise(pattern_of(few)).shape is Shape.UNKNOWN
    assert recogniser.recognise(pattern_of(np.full((9, 9), np.nan))).shape is Shape.NONE


@pytest.mark.parametrize('shape', CLASSES)
def test_large_clean_contacts_are_recognised(recogniser, shape):
    """100 taxels: hardly any contact can be mistaken, in either kind of frame; whatever the unit."""
    rng = generator(Purpose.TEST, 40)
    for conditions in (NOMINAL_ON_OFF, NOMINAL_PRESSURE):
        found = []
        for _ in range(20):
            frame = field_frame(rng, shape, 100, conditions)
            recognition = recogniser.recognise(pattern_of(frame))
            found.append(recognition.shape.value)
            assert sum(recognition.probabilities.values()) == pytest.approx(1)
            scaled = recogniser.recognise(pattern_of(frame * 80e3, 0.3 * 80e3))
            assert scaled.probabilities[scaled.shape] == pytest.approx(recognition.confidence, abs=1e-3)
        assert found.count(shape) >= 19


def test_torn_ring_is_a_circle_and_two_contacts_are_the_larger(recogniser):
    y, x = np.indices((40, 40), float)
    radius = np.hypot(x - 19.2, y - 18.7)
    ring = (radius < 9) & (radius > 6.5)
    ring[:, [15, 16]] = False
    assert recogniser.recognise(pattern_of(ring)).shape is Shape.CIRCLE
    two = Contact('square', (9.0,), x=12.3, y=12.1, angle=0.3).pattern(40, 40)
    two |= Contact('circle', (3.0,), x=27.3, y=27.1).pattern(40, 40)
    assert recogniser.recognise(pattern_of(two)).shape is Shape.SQUARE


def test_works_from_the_mask_alone(recogniser):
    mask = random_contact(generator(Purpose.TEST, 41), 'rectangle', 80).pattern()
    nothing_else = ContactPattern.of(mask, mask.astype(float))
    assert recogniser.recognise(nothing_else).shape is Shape.RECTANGLE


def test_methods_have_one_interface():
    mask = random_contact(generator(Purpose.TEST, 42), 'circle', 100).pattern()
    pattern = pattern_of(mask)
    assert set(METHODS) == {LEARNED, VOLF} and DEFAULT == LEARNED
    learned, volf = make_recogniser(LEARNED), make_recogniser(VOLF)
    assert learned.groups is Group.NONE and volf.groups is GROUPS
    assert learned.recognise(pattern).shape is Shape.CIRCLE
    given = volf.recognise(pattern, compute_features(pattern.mask, GROUPS))
    assert given == volf.recognise(pattern)
    with pytest.raises(ConfigurationError, match="one of learned, volf, got 'magic'"):
        make_recogniser('magic')


@pytest.mark.parametrize('content', ['nothing', 'text', 'other arrays', 'cut', 'wrong sizes', 'NaN', 'inf',
                                     'no spread', 'negative temperature', 'bomb', 'other compression'])
def test_files_that_are_no_weights_are_refused(tmp_path, content):
    path, weights = tmp_path / 'weights.npz', config_path('recogniser.npz')
    with np.load(weights) as data:
        arrays = dict(data)
    if content == 'text':
        path.write_text('planes: {}')
    elif content == 'other arrays':
        np.savez(path, a=np.zeros(3))
    elif content == 'cut':
        path.write_bytes(weights.read_bytes()[:5000])
    elif content == 'wrong sizes':
        np.savez(path, **arrays | {'on_off_bias0': np.zeros(3)})
    elif content in ('NaN', 'inf'):
        np.savez(path, **arrays | {'graded_bias0': np.full(24, float(content))})
    elif content == 'no spread':
        np.savez(path, **arrays | {'graded_spread': np.zeros(40)})
    elif content == 'negative temperature':
        np.savez(path, **arrays | {'on_off_temperature': np.float64(-1)})
    elif content == 'bomb':
        np.savez_compressed(path, **arrays | {'more': np.zeros(1 << 25, np.uint8)})
    elif content == 'other compression':  # whose errors are neither zipfile's nor zlib's
        with ZipFile(path, 'w', ZIP_LZMA) as archive:
            archive.writestr('on_off_kernel0.npy', bytes(range(256)))
        packed = bytearray(path.read_bytes())
        packed[60:90] = b'\1' * 30
        path.write_bytes(packed)
    with pytest.raises(ConfigurationError, match='weights of the recogniser'):
        ShapeRecogniser.from_file(path)


def test_frames_of_the_field_have_their_faults():
    rng = generator(Purpose.TEST, 43)
    dead = field_frame(rng, 'circle', 60, Conditions(dead=0.2))
    assert np.isnan(dead).mean() == pytest.approx(0.2, abs=0.05)
    cut = [np.nansum(field_frame(rng, 'square', 60, Conditions(on_off=True, cut=1 / 3))) for _ in range(20)]
    assert all(60 * 2 / 3 - 5 <= taxels < 60 for taxels in cut)
    hollow = field_frame(rng, 'circle', 150, Conditions(on_off=True, wall=0.3))
    assert hollow[len(hollow) // 2 - 1:, len(hollow) // 2 - 1:][:2, :2].sum() == 0
    two = pattern_of(field_frame(rng, 'square', 60, Conditions(on_off=True, second=0.5)))
    assert two.contacts == 2
    assert set(np.unique(field_frame(rng, 'square', 60, Conditions(on_off=True, noise=0.05)))) == {0, 1}


@pytest.mark.parametrize('method', ['learned', 'volf'])
def test_a_pad_that_cannot_be_seen_is_not_called_untouched(method):
    extractor, recogniser = PatternExtractor(PressThresholds(0.5, 0.4)), make_recogniser(method)
    frame = np.zeros((16, 16))
    assert recogniser.recognise(extractor.extract(frame)).shape is Shape.NONE
    frame[4:11] = np.nan  # an object of seven rows may lie there
    found = recogniser.recognise(extractor.extract(frame))
    assert (found.shape, found.reason, found.confidence) == (Shape.UNKNOWN, UnknownReason.NOT_SEEN, 1.0)
    frame[5::2] = 0  # only single rows are left: each may hide a bar
    assert recogniser.recognise(extractor.extract(frame)).reason is UnknownReason.NOT_SEEN
    frame[:, 3::4] = 0  # of three taxels each
    assert recogniser.recognise(extractor.extract(frame)).shape is Shape.NONE


def test_the_smallest_contact_decides_how_much_of_a_pad_must_be_seen():
    frame = np.zeros((8, 8))
    frame[2:4, 2:4] = np.nan
    assert make_recogniser().recognise(pattern_of(frame)).shape is Shape.UNKNOWN
    assert make_recogniser(smallest_contact=5).recognise(pattern_of(frame)).shape is Shape.NONE


@pytest.mark.parametrize('method', ['learned', 'volf'])
def test_why_a_shape_is_unknown(method):
    recogniser = make_recogniser(method)
    few = np.zeros((9, 9))
    few[4, 3:6] = 1
    assert recogniser.recognise(pattern_of(few)).reason is UnknownReason.TOO_SMALL
    few[3, 4:6] = np.nan  # it may be larger than it looks
    found = recogniser.recognise(pattern_of(few))
    assert found.reason is UnknownReason.NOT_SEEN and not found.is_evidence
    assert recogniser.recognise(pattern_of(np.zeros((9, 9)))).reason is UnknownReason.NOT_UNKNOWN


def test_a_foreign_shape_is_unfamiliar():
    y, x = np.indices((36, 36))
    cross = (abs(x - 17) < 14) & (abs(y - 18) < 2) | (abs(y - 18) < 14) & (abs(x - 17) < 2)
    found = make_recogniser().recognise(pattern_of(cross))
    assert (found.shape, found.reason) == (Shape.UNKNOWN, UnknownReason.UNFAMILIAR) and found.is_evidence
    assert found.as_json()['reason'] == 'unfamiliar'
    cross[17:19, 24] = False
    frame = np.where(np.isin(x * 100 + y, (2417, 2418)), np.nan, cross)
    assert make_recogniser().recognise(pattern_of(frame)).reason is UnknownReason.UNFAMILIAR, 'whatever is hidden'


@pytest.mark.parametrize(('hidden', 'most'), [(6, 0.84), (5, 0.84), (0, 1.0)])
def test_an_answer_that_depends_on_hidden_rows_is_not_confident(recogniser, hidden, most):
    """A rectangle of 8x14 taxels, whose last rows are hidden, looks like a square."""
    frame = np.zeros((24, 24))
    frame[4:18, 8:16] = 1
    seen = frame.copy()
    seen[18 - hidden:] = 0
    frame[18 - hidden:24] = np.nan if hidden else 0
    found = make_recogniser().recognise(pattern_of(frame))
    assert found.confidence <= most
    if hidden:
        assert recogniser.recognise(pattern_of(frame)).confidence > found.confidence, 'without other ways'
        assert len(found.alternatives) == 4 and sum(weight for weight, _ in found.alternatives) == pytest.approx(1)
        assert sum(found.probabilities.values()) == pytest.approx(1)
    else:
        assert (found.shape, found.alternatives) == (Shape.RECTANGLE, ())


def test_a_dead_taxel_within_a_contact_changes_nothing(recogniser):
    frame = np.zeros((16, 16))
    frame[4:11, 4:11] = 1
    frame[6, 7] = frame[1, 1] = np.nan
    found = make_recogniser().recognise(pattern_of(frame))
    assert found == recogniser.recognise(pattern_of(frame)) and not found.alternatives
    frame[6, 8] = np.nan  # two together may be a hole
    assert make_recogniser().recognise(pattern_of(frame)).alternatives


def test_hidden_taxels_are_read_as_empty_as_pressed_beside_and_as_pressed_straight_on():
    frame = np.zeros((9, 8))
    frame[1:4, 2:6] = 8
    frame[4:7] = np.nan
    empty, beside, straight = completions(pattern_of(frame))
    assert [int(each.mask.sum()) for each in (empty, beside, straight)] == [12, 18, 24]
    assert beside.mask[4].tolist() == [False, True, True, True, True, True, True, False]
    assert straight.mask[1:7, 2:6].all() and straight.values[6, 2] == 8 and straight.values[6, 1] == 0
    for each in (empty, beside, straight):
        assert not each.hidden.any() and not np.isnan(each.values).any()


def test_a_torn_contact_read_as_empty_is_its_largest_piece():
    frame = np.zeros((10, 8))
    frame[1:4, 2:6] = frame[5:9, 2:6] = 8
    frame[4] = np.nan
    empty, _, straight = completions(pattern_of(frame))
    assert (empty.mask.sum(), empty.contacts, straight.mask.sum(), straight.contacts) == (16, 2, 32, 1)
