"""`import tactile_node as tn`: few names, each documented, each example true, and no cost before it is used."""

import doctest
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import tactile_node as tn
from tactile_node.shape.recognitions import RecognitionFusion

ROOT = Path(__file__).resolve().parents[1]
SQUARE = np.pad(np.full((7, 7), 50e3), 4)
EXAMPLES = sorted(path.relative_to(ROOT) for path in (ROOT / 'tactile_node').rglob('*.py') if '>>>' in path.read_text())


@pytest.mark.parametrize('path', EXAMPLES, ids=str)
def test_examples_in_docstrings_are_true(path):
    module = import_module('.'.join(path.with_suffix('').parts).removesuffix('.__init__'))
    result = doctest.testmod(module)
    assert result.attempted and not result.failed


def test_examples_in_the_readme_are_true():
    result = doctest.testfile(str(ROOT / 'README.md'), module_relative=False)
    assert result.attempted and not result.failed


def test_at_most_22_names_each_of_them_documented():
    assert len(tn.__all__) == len(set(tn.__all__)) <= 22
    for name in tn.__all__:
        assert name in dir(tn)
        assert name == '__version__' or getattr(tn, name).__doc__
    with pytest.raises(AttributeError, match='no attribute'):
        tn.nothing  # noqa: B018


def test_the_import_alone_loads_nothing_and_the_library_neither_ros_nor_can():
    program = ('import sys, tactile_node as tn; print("numpy" in sys.modules); [getattr(tn, n) for n in tn.__all__];'
               'print(sorted({"rclpy", "can", "canopen", "matplotlib"} & set(sys.modules)), "numpy" in sys.modules)')
    out = subprocess.run([sys.executable, '-c', program], check=True, capture_output=True, text=True).stdout
    assert out.split('\n')[:2] == ['False', '[] True']


def test_what_is_pressed_is_relative_unless_thresholds_are_given():
    frame = np.array([[29e3, 31e3, 12e3, 1e3]])
    for unit in ('Pa', None):
        assert tn.find_contact(frame, unit=unit).mask.tolist() == [[True, True, False, False]], 'half of the contact'
    assert tn.find_contact(frame, thresholds=tn.PressThresholds(30e3, 20e3)).mask.tolist() == [[False, True, False,
                                                                                               False]]
    assert not tn.find_contact(frame / 20, unit='Pa').contacts, 'below 2 kPa'
    assert not tn.find_contact(np.full((2, 2), np.nan), unit=None).contacts
    with pytest.raises(tn.ConfigurationError):
        tn.find_contact(frame, unit='psi')
    with pytest.raises(tn.InputError):
        tn.find_contact(np.zeros(3))


CONTACT = tn.find_contact(SQUARE)
WRONG = {
    'one dimension': lambda: tn.find_contact(np.zeros(3)),
    'a stack of frames': lambda: tn.find_contact(np.zeros((2, 3, 3))),
    'no taxel': lambda: tn.find_contact(np.zeros((0, 3)), unit=None),
    'rows of unequal length': lambda: tn.find_contact([[1, 2], [3]]),
    'text': lambda: tn.find_contact('frame.npy', unit=None),
    'complex numbers': lambda: tn.find_contact(SQUARE + 1j, unit=None),
    'objects': lambda: tn.find_contact(SQUARE.astype(object)),
    'on/off values as pascal': lambda: tn.find_contact((SQUARE > 0).astype(int)),
    'a picture of bytes as on/off': lambda: tn.find_contact((SQUARE > 0) * 255, unit='1'),
    'an unknown unit': lambda: tn.find_contact(SQUARE, unit='psi'),
    'thresholds of another type': lambda: tn.find_contact(SQUARE, thresholds=(3, 2)),
    'thresholds that are no numbers': lambda: tn.PressThresholds('a', 'b'),
    'a frame for a contact': lambda: tn.fit_shape(SQUARE, tn.Shape.SQUARE),
    'a frame to recognise': lambda: tn.Recogniser().recognise(SQUARE),
    'a frame for features': lambda: tn.paper_features(SQUARE),
    'groups by name': lambda: tn.paper_features(CONTACT, 'ALL'),
    'an unknown shape': lambda: tn.fit_shape(CONTACT, 'sqare'),
    'no shape': lambda: tn.fit_shape(CONTACT, None),
    'no contact': lambda: tn.fit_shape(tn.find_contact(SQUARE * 0), tn.Shape.SQUARE),
    'no pitch': lambda: tn.fit_shape(CONTACT, tn.Shape.SQUARE, pitch=0),
    'a pitch that is no number': lambda: tn.fit_shape(CONTACT, tn.Shape.SQUARE, pitch='4 mm'),
    'an unknown method': lambda: tn.Recogniser('cnn'),
    'a missing file': lambda: tn.Recogniser(file='missing.npz'),
    'a stream in an unknown unit': lambda: tn.ContactStream(unit='kPa'),
    'a stream without pitch': lambda: tn.ContactStream(pitch=np.nan),
    'a recogniser by name': lambda: tn.ContactStream('volf'),
    'fusion settings of another type': lambda: tn.ContactStream(fusion={}),
    'no stamp': lambda: tn.ContactStream().update(SQUARE, None),
    'a stamp that is no time': lambda: tn.ContactStream().update(SQUARE, np.nan),
    'a stamp as a date': lambda: tn.ContactStream().update(SQUARE, np.datetime64('2026-11-22')),
    'a stack of frames in a stream': lambda: tn.ContactStream().update(np.zeros((2, 3, 3)), 0.0)}


@pytest.mark.parametrize('wrong', WRONG)
def test_a_wrong_argument_is_refused_with_expected_got_and_remedy(wrong):
    with pytest.raises(tn.TactileError) as refused:
        WRONG[wrong]()
    assert refused.value.expected and refused.value.got and refused.value.remedy.endswith('.')


def test_odd_arrays_are_taken_as_what_they_are():
    patch = np.s_[4:11, 4:11]
    for frame in (SQUARE.astype(int), SQUARE.astype(np.uint16), SQUARE.tolist(), SQUARE * 1e100):
        assert tn.find_contact(frame, 'Pa').mask[patch].all() and tn.find_contact(frame, 'Pa').mask.sum() == 49
    assert tn.find_contact((SQUARE > 0).tolist()).mask.sum() == 49
    assert tn.find_contact((SQUARE > 0).astype(int), unit='1').mask.sum() == 49
    masked = tn.find_contact(np.ma.masked_array(SQUARE, mask=np.indices(SQUARE.shape).sum(0) == 8))
    assert masked.mask[patch].sum() == 48 and np.isnan(masked.values[4, 4]), 'a masked taxel has no valid value'
    single = tn.find_contact([[50e3]])
    assert single.contacts == 1 and tn.Recogniser().recognise(single).shape is tn.Shape.UNKNOWN
    assert tn.Recogniser().recognise(tn.find_contact(np.full((3, 3), np.nan))).shape is tn.Shape.UNKNOWN
    assert SQUARE.flags.writeable


def test_a_shape_may_be_given_by_its_name():
    by_name, fit = tn.fit_shape(CONTACT, 'square'), tn.fit_shape(CONTACT, tn.Shape.SQUARE)
    assert by_name.shape is tn.Shape.SQUARE and by_name.dimensions == fit.dimensions


@pytest.mark.parametrize('thresholds', [None, tn.PressThresholds.of_full_scale(1.0)])
def test_a_stream_without_a_unit_does_not_depend_on_its_first_frame(thresholds):
    stream = tn.ContactStream(unit=None, thresholds=thresholds, fusion=tn.FusionSettings())
    idle = 0.005 * np.random.default_rng(3).standard_normal(SQUARE.shape)
    found = [stream.update(frame, 0.02 * k) for k, frame in enumerate((idle, idle + SQUARE * 2e-5))]
    assert [one.fused.recognition.shape for one in found] == [tn.Shape.NONE, tn.Shape.SQUARE]
    with pytest.raises(tn.InputError, match='as before'):
        stream.update(SQUARE[:10], 0.04)


def test_a_pattern_of_ones_is_fitted_as_on_and_off():
    square = tn.fit_shape(tn.find_contact(SQUARE > 0), tn.Shape.SQUARE)
    assert square.dimensions[0] == pytest.approx(7, abs=0.3)
    assert tn.fit_shape(tn.find_contact(SQUARE), tn.Shape.UNKNOWN) is None


def test_a_stream_keeps_what_is_pressed_and_fuses_as_the_core_does():
    thresholds = tn.PressThresholds(30e3, 24e3)
    stream, alone, fusion = tn.ContactStream(pitch=0.004, thresholds=thresholds), tn.Recogniser(), RecognitionFusion()
    frames = [SQUARE, SQUARE * 0.5, SQUARE * 0.4, SQUARE * 0]  # 25 kPa: still held; 20 kPa: released at 24 kPa
    found = [stream.update(frame, 0.02 * k) for k, frame in enumerate(frames)]
    assert [bool(one.contact.mask.any()) for one in found] == [True, True, False, False]
    for k, one in enumerate(found):
        assert one.recognition == alone.recognise(one.contact)
        assert one.fused == fusion.update(0.02 * k, one.recognition)
    assert found[1].fit.dimensions[0] == pytest.approx(0.028, abs=0.001)
    assert found[3].fit is None and found[3].recognition.shape is tn.Shape.NONE


def test_a_pad_that_is_not_seen_is_not_taken_for_an_empty_one():
    hidden = np.zeros((16, 16))
    hidden[4:11] = np.nan
    contact = tn.find_contact(hidden)
    assert (contact.contacts, contact.pad_seen) == (0, False)
    found = tn.Recogniser().recognise(contact)
    assert (found.shape, found.reason.name) == (tn.Shape.UNKNOWN, 'NOT_SEEN')
    unmapped = np.isnan(hidden)
    assert tn.find_contact(hidden, unmapped=unmapped).pad_seen
    assert tn.Recogniser().recognise(tn.find_contact(hidden, unmapped=unmapped)).shape is tn.Shape.NONE
    masked = np.ma.masked_array(np.zeros((16, 16)), mask=unmapped)
    assert not tn.find_contact(masked).pad_seen


def test_a_stream_reports_a_frame_that_is_not_seen_and_goes_on_with_what_it_knew():
    stream, unseen = tn.ContactStream(pitch=0.004), np.full(SQUARE.shape, np.nan)
    before = [stream.update(SQUARE, 0.02 * k) for k in range(20)][-1]
    hidden = [stream.update(unseen, 0.4 + 0.02 * k) for k in range(5)][-1]
    after = stream.update(SQUARE, 0.5)
    assert (hidden.fused.recognition.shape, hidden.fused.recognition.reason.name) == (tn.Shape.UNKNOWN, 'NOT_SEEN')
    assert hidden.fused.held == 0 and hidden.fit is None and not hidden.contact.pad_seen
    assert after.fused.recognition.shape is before.fused.recognition.shape is tn.Shape.SQUARE
    assert after.fused.recognition.confidence > 0.9 * before.fused.recognition.confidence and after.fused.frames == 1


def test_a_stream_fits_a_torn_contact_as_a_whole():
    torn = np.pad(np.full((9, 9), 50e3), 5)
    torn[10:12] = 0
    found = tn.ContactStream().update(torn, 0.0)
    assert found.recognition.joined and found.contact.contacts == 1 and found.contact.mask.sum() == 63
    assert found.fit.centre[1] == pytest.approx(9, abs=0.5)
    saturated = tn.ContactStream().update(torn, 0.0, saturated=torn > 0).contact
    assert saturated.saturated.sum() == 63


def test_a_picture_shows_the_frame_and_its_outline_in_metres():
    figure = pytest.importorskip('matplotlib.figure').Figure()
    fit = tn.fit_shape(tn.find_contact(SQUARE), tn.Shape.SQUARE, pitch=0.004)
    axes = tn.plot_frame(SQUARE, fit, pitch=0.004, axes=figure.subplots())
    outline = axes.lines[0].get_xydata()
    np.testing.assert_array_equal(outline[:-1], fit.outline)
    np.testing.assert_array_equal(outline[-1], fit.outline[0])
    assert axes.images[0].get_extent() == pytest.approx([-0.002, 0.058, -0.002, 0.058])


def test_a_taxel_without_a_value_is_drawn_in_a_colour_that_no_value_has():
    axes = tn.plot_frame(np.array([[0.0, np.nan, 1.0]]),
                         axes=pytest.importorskip('matplotlib.figure').Figure().subplots())
    red, green, blue, _ = axes.images[0].cmap.get_bad()
    assert red == green == blue
    assert not any(r == g == b for r, g, b, _ in axes.images[0].cmap(np.linspace(0.05, 0.95)))


def test_without_matplotlib_the_error_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, 'matplotlib', None)
    with pytest.raises(tn.ConfigurationError) as refused:
        tn.plot_frame(SQUARE)
    assert 'tactile-skin[picture]' in refused.value.remedy
