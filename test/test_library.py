"""`import tactile_node as tn` exposes only a few names.

Each exposed name is documented, each example is correct, and the import loads nothing until a name is used.
"""

import doctest
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import tactile_node as tn

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


def test_at_most_23_names_each_of_them_documented():
    assert len(tn.__all__) == len(set(tn.__all__)) <= 23
    for name in tn.__all__:
        assert name in dir(tn)
        assert name == '__version__' or getattr(tn, name).__doc__
    with pytest.raises(AttributeError, match='no attribute'):
        tn.nothing  # noqa: B018


@pytest.mark.slow
def test_the_import_alone_loads_nothing_and_the_library_neither_ros_nor_can():
    program = ('import sys, tactile_node as tn; print("numpy" in sys.modules); [getattr(tn, n) for n in tn.__all__];'
               'print(sorted({"rclpy", "can", "canopen", "matplotlib"} & set(sys.modules)), "numpy" in sys.modules)')
    out = subprocess.run([sys.executable, '-c', program], check=True, capture_output=True, text=True).stdout
    assert out.split('\n')[:2] == ['False', '[] True']


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
    'a list of units': lambda: tn.find_contact(SQUARE, unit=np.array(['Pa', 'N'])),
    'a list of pitches': lambda: tn.ContactStream(pitch=np.array([0.004, 0.004])),
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


def test_the_members_of_an_npz_are_accepted_as_they_are(tmp_path):
    """np.load returns single values as arrays without dimensions."""
    np.savez(tmp_path / 'x.npz', values=[SQUARE], stamps=[0.5], unit='Pa', pitch=0.004)
    file = np.load(tmp_path / 'x.npz')
    stream = tn.ContactStream(unit=file['unit'], pitch=file['pitch'])
    assert stream.update(file['values'][0], np.array(0.5)).fused.recognition.shape == tn.Shape.SQUARE
    contact = tn.find_contact(file['values'][0], file['unit'])
    assert tn.fit_shape(contact, tn.Shape.SQUARE, file['pitch']).dimensions == pytest.approx([0.028], rel=0.05)
    assert tn.contact_box(contact, file['pitch']).lengths == pytest.approx([0.028, 0.028], rel=0.05)


@pytest.mark.parametrize('thresholds', [None, tn.PressThresholds.of_full_scale(1.0)])
def test_a_stream_without_a_unit_does_not_depend_on_its_first_frame(thresholds):
    stream = tn.ContactStream(unit=None, thresholds=thresholds, fusion=tn.FusionSettings())
    idle = 0.005 * np.random.default_rng(3).standard_normal(SQUARE.shape)
    found = [stream.update(frame, 0.02 * k) for k, frame in enumerate((idle, idle + SQUARE * 2e-5))]
    assert [one.fused.recognition.shape for one in found] == [tn.Shape.NONE, tn.Shape.SQUARE]
    with pytest.raises(tn.InputError, match='as before'):
        stream.update(SQUARE[:10], 0.04)


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


def test_a_stream_reports_an_unseen_frame_and_keeps_its_knowledge():
    stream, unseen = tn.ContactStream(pitch=0.004), np.full(SQUARE.shape, np.nan)
    before = [stream.update(SQUARE, 0.02 * k) for k in range(20)][-1]
    hidden = [stream.update(unseen, 0.4 + 0.02 * k) for k in range(5)][-1]
    after = stream.update(SQUARE, 0.5)
    assert (hidden.fused.recognition.shape, hidden.fused.recognition.reason.name) == (tn.Shape.UNKNOWN, 'NOT_SEEN')
    assert hidden.fused.held == 0 and hidden.fit is None and not hidden.found.pattern.pad_seen
    assert after.fused.recognition.shape is before.fused.recognition.shape is tn.Shape.SQUARE
    assert after.fused.recognition.confidence > 0.9 * before.fused.recognition.confidence and after.fused.frames == 1


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
