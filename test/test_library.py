"""`import tactile_node as tn`: few names, each documented, each example true, and no cost before it is used."""

import doctest
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import tactile_node as tn
from tactile_node.fusion.recognitions import RecognitionFusion

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


def test_at_most_twenty_names_each_of_them_documented():
    assert len(tn.__all__) == len(set(tn.__all__)) <= 20
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


def test_thresholds_are_those_of_the_unit_or_fractions_of_the_largest_value():
    frame = np.array([[29e3, 31e3]])
    assert tn.find_contact(frame).mask.tolist() == [[False, True]]
    assert tn.find_contact(frame, unit=None).mask.tolist() == [[True, True]]
    assert tn.find_contact(frame, thresholds=tn.PressThresholds(28e3, 20e3)).mask.all()
    assert not tn.find_contact(np.full((2, 2), np.nan), unit=None).contacts
    with pytest.raises(tn.ConfigurationError):
        tn.find_contact(frame, unit='psi')
    with pytest.raises(tn.InputError):
        tn.find_contact(np.zeros(3))


def test_a_pattern_of_ones_is_fitted_as_on_and_off():
    square = tn.fit_shape(tn.find_contact(SQUARE > 0), tn.Shape.SQUARE)
    assert square.dimensions[0] == pytest.approx(7, abs=0.3)
    assert tn.fit_shape(tn.find_contact(SQUARE), tn.Shape.UNKNOWN) is None


def test_a_stream_keeps_what_is_pressed_and_fuses_as_the_core_does():
    stream, alone, fusion = tn.ContactStream(pitch=0.004), tn.Recogniser(), RecognitionFusion()
    frames = [SQUARE, SQUARE * 0.5, SQUARE * 0.4, SQUARE * 0]  # 25 kPa: still held; 20 kPa: released at 24 kPa
    found = [stream.update(frame, 0.02 * k) for k, frame in enumerate(frames)]
    assert [bool(one.contact.mask.any()) for one in found] == [True, True, False, False]
    for k, one in enumerate(found):
        assert one.recognition == alone.recognise(one.contact)
        assert one.fused == fusion.update(0.02 * k, one.recognition.probabilities)
    assert found[1].fit.dimensions[0] == pytest.approx(0.028, abs=0.001)
    assert found[3].fit is None and found[3].recognition.shape is tn.Shape.NONE


def test_a_picture_shows_the_frame_and_its_outline_in_metres():
    figure = pytest.importorskip('matplotlib.figure').Figure()
    fit = tn.fit_shape(tn.find_contact(SQUARE), tn.Shape.SQUARE, pitch=0.004)
    axes = tn.plot_frame(SQUARE, fit, pitch=0.004, axes=figure.subplots())
    outline = axes.lines[0].get_xydata()
    np.testing.assert_array_equal(outline[:-1], fit.outline)
    np.testing.assert_array_equal(outline[-1], fit.outline[0])
    assert axes.images[0].get_extent() == pytest.approx([-0.002, 0.058, -0.002, 0.058])
