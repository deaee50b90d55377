"""The learned recogniser: results that must hold for any weights, and a check that the trained weights are useful."""

from zipfile import ZIP_LZMA, ZipFile

import numpy as np
import pytest

from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.contact.visibility import visibility_of
from tactile_node.errors import ConfigurationError
from tactile_node.helmholtz.features import Group, compute_features
from tactile_node.package_files import config_path
from tactile_node.shape.fusion import RecognitionFusion
from tactile_node.shape.invariants import describe_all
from tactile_node.shape.methods import METHODS, completions, make_recogniser
from tactile_node.shape.network import Network
from tactile_node.shape.patch import SIDE, join_pieces, joined, make_patch
from tactile_node.shape.recogniser import LOG_SIZES, OUTPUTS, Calibration, ShapeRecogniser
from tactile_node.shape.recognition import DEFAULT_METHOD, LEARNED, VOLF, Recognition, Shape, UnknownReason
from tactile_node.shape.support import as_far_as_supported
from tactile_node.shape.volf import VolfClassifier
from tactile_node.simulator.world import CLASSES, Contact, random_contact
from training.field import NOMINAL_ON_OFF, NOMINAL_PRESSURE, field_frame
from training.ground_truth.seeds import Purpose, generator


def describe(patch):
    return describe_all(patch.level[None], patch.unseen[None], np.array([patch.scale]))[0]


@pytest.fixture(scope='module')
def recogniser():
    return ShapeRecogniser.from_file(config_path('recogniser.npz'))


def pattern_of(frame, press=0.3):
    return PatternExtractor(PressThresholds(press, 0.8 * press)).extract(np.asarray(frame, float))


def naive(network, image, geometry):
    """Compute the network from its definition, with loops over positions and kernel taps."""
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
    for found, image, numbers in zip(network.logits(network.embedding(images, geometry)), images, geometry):
        np.testing.assert_allclose(found, naive(network, image, numbers), rtol=1e-3, atol=1e-3)


def test_calibration():
    """Classes with equal logits share the probability that the shape is not foreign.

    If the logit equals the bias for the size, a foreign shape is as probable as a known one.
    """
    biases = np.append(3.0, np.ones(len(LOG_SIZES) - 1))
    even = Calibration(2.0, biases).probabilities(np.array([[7.0] * 5 + [3.0]]), LOG_SIZES[:1])
    np.testing.assert_allclose(even, [[0.1] * 5 + [0.5]])
    between = Calibration(2.0, biases).probabilities(np.array([[7.0] * 5 + [2.0]]), LOG_SIZES[:2].mean(keepdims=True))
    np.testing.assert_allclose(between, even)
    warm, hot = (Calibration(t, biases + 50).probabilities(np.array([[1.0, 0, 0, 0, 0, 0]]), LOG_SIZES[:1])
                 for t in (0.5, 2.0))
    assert warm[0, 0] == pytest.approx(np.e ** 2 / (np.e ** 2 + 4)) and hot[0, 0] < warm[0, 0]


class OneAnswer:
    """A network that always gives the same shape a probability of almost 1."""

    width = 1

    def __init__(self, shape):
        self._logits = np.array([30.0 * (output is shape) for output in OUTPUTS])

    def embedding(self, images, geometry):
        return np.zeros((len(images), 1))

    def logits(self, embedding):
        return np.tile(self._logits, (len(embedding), 1))


@pytest.mark.parametrize('side, share', [(2, 0.0), (4, 16 / (80 + 16)), (8, 64 / (80 + 64)), (12, 0.5)])
def test_pressures_are_recognised_by_both_networks_and_the_outline_of_a_larger_contact_has_more_weight(side, share):
    both = ShapeRecogniser({'graded': OneAnswer(Shape.CIRCLE), 'on_off': OneAnswer(Shape.SQUARE)},
                           dict.fromkeys(('graded', 'on_off'), Calibration(1.0, np.full(len(LOG_SIZES), 50.0))))
    frame = np.zeros((20, 20))
    frame[4:4 + side, 4:4 + side] = np.linspace(0.8, 1.0, side)
    found = both.recognise(ContactPattern.of(frame > 0, frame)).probabilities
    assert found[Shape.SQUARE] == pytest.approx(share, abs=1e-4)
    assert found[Shape.CIRCLE] == pytest.approx(1 - share, abs=1e-4)
    fusion = RecognitionFusion()
    for number in range(50):
        fused = fusion.update(0.1 * number, both.recognise(ContactPattern.of(frame > 0, frame))).recognition
    assert fused.probabilities[Shape.SQUARE] == pytest.approx(share, abs=0.01), 'frames do not settle a disagreement'
    pressed = (frame > 0).astype(float)
    on_off = both.recognise(ContactPattern.of(frame > 0, pressed))
    assert on_off.shape is (Shape.UNKNOWN if side == 2 else Shape.SQUARE), 'on/off taxels have no second answer'
    assert side == 2 or on_off.probabilities[Shape.CIRCLE] < 1e-4


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


def test_pieces_that_are_joined_are_one_contact_in_mask_labels_and_counts():
    frame = np.zeros((14, 30), bool)
    frame[2:9, 2:5] = frame[2:9, 7:10] = True  # Two columns without pressed taxels lie between the two pieces.
    frame[2:6, 20:25] = frame[12, 2:4] = True  # These taxels belong to other contacts.
    pattern = PatternExtractor(PressThresholds(0.5, 0.4)).extract(frame)
    assert (pattern.contacts, pattern.sizes) == (4, (21, 21, 20, 2))
    whole = join_pieces(pattern)
    assert (whole.contacts, whole.sizes) == (3, (42, 20, 2))
    np.testing.assert_array_equal(whole.mask, joined(pattern))
    assert whole.labels[3, 3] == whole.labels[3, 8] == 1 and whole.labels[3, 22] == 2 and whole.labels[12, 2] == 3
    alone = join_pieces(pattern_of(frame[:, 15:]))
    assert (alone.contacts, alone.sizes) == (1, (20,)), 'a single contact has nothing to join'


def test_a_recognition_reports_whether_it_is_of_joined_pieces(recogniser):
    frame = np.zeros((14, 20), bool)
    frame[2:10, 2:5] = frame[2:10, 6:9] = True
    assert recogniser.recognise(pattern_of(frame)).joined
    assert not recogniser.recognise(pattern_of(frame[:, :5])).joined
    frame[2, 5] = True
    assert not recogniser.recognise(pattern_of(frame)).joined, 'a contact in one piece is not joined'


@pytest.mark.slow
@pytest.mark.parametrize('shape', CLASSES)
def test_large_clean_contacts_are_recognised(recogniser, shape):
    """In on/off and in pressure frames, contacts of 100 taxels are large enough that hardly any is misclassified."""
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


def test_methods_have_one_interface():
    mask = random_contact(generator(Purpose.TEST, 42), 'circle', 100).pattern()
    pattern = pattern_of(mask)
    assert set(METHODS) == {LEARNED, VOLF} and DEFAULT_METHOD == LEARNED
    assert make_recogniser(LEARNED).recognise(pattern).shape is Shape.CIRCLE
    classifier = VolfClassifier.from_file(config_path('volf_curves.yaml'))
    assert make_recogniser(VOLF).recognise(pattern) == classifier.classify(
        compute_features(pattern.mask, Group.CLASSIFIER))
    with pytest.raises(ConfigurationError, match="one of learned, volf, got 'magic'"):
        make_recogniser('magic')


BAD_ARRAYS = {
    'wrong sizes': {'on_off_bias0': np.zeros(3)}, 'NaN': {'graded_bias0': np.full(24, np.nan)},
    'inf': {'graded_bias0': np.full(24, np.inf)}, 'no spread': {'graded_spread': np.zeros(40)},
    'negative temperature': {'on_off_temperature': np.float64(-1)}, 'bomb': {'more': np.zeros(1 << 25, np.uint8)}}


@pytest.mark.parametrize('content', [*BAD_ARRAYS, 'nothing', 'text', 'other arrays', 'cut', 'other compression'])
def test_files_without_weights_are_refused(tmp_path, content):
    path, weights = tmp_path / 'weights.npz', config_path('recogniser.npz')
    if content in BAD_ARRAYS:
        np.savez_compressed(path, **dict(np.load(weights)) | BAD_ARRAYS[content])
    elif content == 'text':
        path.write_text('planes: {}')
    elif content == 'other arrays':
        np.savez(path, a=np.zeros(3))
    elif content == 'cut':
        path.write_bytes(weights.read_bytes()[:5000])
    # LZMA raises different errors from those of zipfile and zlib.
    elif content == 'other compression':
        with ZipFile(path, 'w', ZIP_LZMA) as archive:
            archive.writestr('on_off_kernel0.npy', bytes(range(256)))
        packed = bytearray(path.read_bytes())
        packed[60:90] = b'\1' * 30
        path.write_bytes(packed)
    with pytest.raises(ConfigurationError, match='weights of the recogniser'):
        ShapeRecogniser.from_file(path)


@pytest.mark.parametrize('method', ['learned', 'volf'])
def test_a_pad_that_cannot_be_seen_is_not_called_untouched(method):
    extractor, recogniser = PatternExtractor(PressThresholds(0.5, 0.4)), make_recogniser(method)
    frame = np.zeros((16, 16))
    assert recogniser.recognise(extractor.extract(frame)).shape is Shape.NONE
    frame[4:11] = np.nan  # An object could lie in these seven hidden rows.
    found = recogniser.recognise(extractor.extract(frame))
    assert (found.shape, found.reason, found.confidence) == (Shape.UNKNOWN, UnknownReason.NOT_SEEN, 1.0)
    frame[5::2] = 0  # Only single rows remain hidden, and each of them could hide a bar.
    assert recogniser.recognise(extractor.extract(frame)).reason is UnknownReason.NOT_SEEN
    frame[:, 3::4] = 0  # The hidden rows are now cut into pieces of three taxels.
    assert recogniser.recognise(extractor.extract(frame)).shape is Shape.NONE


def test_the_smallest_contact_decides_how_much_of_a_pad_must_be_seen():
    frame = np.zeros((8, 8))
    frame[2:4, 2:4] = np.nan
    pattern, recogniser = pattern_of(frame), make_recogniser()
    assert recogniser.recognise(pattern).shape is Shape.UNKNOWN
    assert recogniser.recognise(pattern, visibility_of(pattern, smallest_contact=5)).shape is Shape.NONE


@pytest.mark.parametrize('method', ['learned', 'volf'])
def test_an_unknown_shape_has_a_reason(method):
    recogniser = make_recogniser(method)
    few = np.zeros((9, 9))
    few[4, 3:6] = 1
    assert recogniser.recognise(pattern_of(few)).reason is UnknownReason.TOO_SMALL
    few[3, 4:6] = np.nan  # The contact may be larger than its visible part.
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
    assert make_recogniser().recognise(pattern_of(frame)).reason is UnknownReason.UNFAMILIAR, 'despite hidden taxels'


@pytest.mark.parametrize(('hidden', 'most'), [(6, 0.84), (5, 0.84), (0, 1.0)])
def test_an_answer_that_depends_on_hidden_rows_is_not_confident(recogniser, hidden, most):
    """The object is a rectangle of 8x14 taxels. With its last rows hidden, the rectangle looks like a square."""
    frame = np.zeros((24, 24))
    frame[4:18, 8:16] = 1
    seen = frame.copy()
    seen[18 - hidden:] = 0
    frame[18 - hidden:24] = np.nan if hidden else 0
    found = make_recogniser().recognise(pattern_of(frame))
    assert found.confidence <= most
    if hidden:
        # The plain recogniser does not consider other possible contents of the hidden rows.
        assert recogniser.recognise(pattern_of(frame)).confidence > found.confidence, 'hidden rows must lower it'
        assert sum(found.probabilities.values()) == pytest.approx(1)
    else:
        assert found.shape is Shape.RECTANGLE


def test_a_dead_taxel_within_a_contact_changes_nothing(recogniser):
    frame = np.zeros((16, 16))
    frame[4:11, 4:11] = 1
    frame[6, 7] = frame[1, 1] = np.nan
    found = make_recogniser().recognise(pattern_of(frame))
    assert found == recogniser.recognise(pattern_of(frame))
    frame[6, 8] = np.nan  # Two adjacent taxels without a value may conceal a hole in the object.
    found = make_recogniser().recognise(pattern_of(frame))
    assert found != recogniser.recognise(pattern_of(frame)), 'the guard considers other possible contents'


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


def test_only_a_circle_is_certain_with_few_taxels():
    few, more = np.zeros((2, 10, 10), bool)
    few[4:6, 3:7] = True
    more[4:6, 2:8] = True
    found = Recognition.of({Shape.RECTANGLE: 0.97, Shape.CIRCLE: 0.02, Shape.UNKNOWN: 0.01})
    bounded = as_far_as_supported(found, ContactPattern.of(few, few.astype(float)))
    assert bounded.shape is Shape.RECTANGLE
    assert bounded.confidence < 0.9
    assert sum(bounded.probabilities.values()) == pytest.approx(1.0)
    assert as_far_as_supported(found, ContactPattern.of(more, more.astype(float))) is found
    circle = Recognition.certain(Shape.CIRCLE)
    assert as_far_as_supported(circle, ContactPattern.of(few, few.astype(float))) is circle


def test_an_object_on_most_of_a_small_array_is_unknown_and_never_none():
    y, x = np.mgrid[:6, :6]
    frame = np.round(10 + 5 * np.exp(-((y - 2.4) ** 2 + (x - 2.8) ** 2) / 12), 2)
    pattern = PatternExtractor().extract(frame)
    assert pattern.contacts == 0
    assert make_recogniser().recognise(pattern).shape is Shape.UNKNOWN
    noise = np.random.default_rng(5).normal(10, 0.3, (6, 6))
    assert make_recogniser().recognise(PatternExtractor().extract(noise)).shape is Shape.NONE
