"""Shapes that users teach, and ways in which a taught file could mislead. No other test draws the cross."""

import json
import shutil
from queue import SimpleQueue

import numpy as np
import pytest
from taught_cross import (
    LOADS,
    PAD,
    cross,
    disc,
    examples,
    held,
    rng_of,
    third_of_background,
    write_taught_cross,
)

from tactile_node import Recogniser, find_contact, fit_shape
from tactile_node.bus.skin_bus import SkinBus
from tactile_node.cli.main import main
from tactile_node.cli.touch_sources import _guide
from tactile_node.errors import ConfigurationError, InputError
from tactile_node.learning.teach import LEAST_RIGHT, Rate, teach
from tactile_node.learning.touches import TouchFinder, Unused
from tactile_node.package_files import config_path
from tactile_node.shape.methods import make_recogniser
from tactile_node.shape.recogniser import ShapeRecogniser, read_arrays
from tactile_node.shape.recognition import Shape, TaughtShape, UnknownReason
from tactile_node.skin.layout_file import load_layout

pytestmark = pytest.mark.slow


@pytest.fixture(scope='module')
def background():
    return third_of_background()


@pytest.fixture(scope='module')
def base():
    return ShapeRecogniser.from_file(config_path('recogniser.npz'))


@pytest.fixture(scope='module')
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp('taught') / 'own.npz'
    write_taught_cross(path)
    return path


@pytest.fixture(scope='module')
def arrays(file):
    return read_arrays(file)


@pytest.mark.parametrize('options', [[], ['--fuse', '--period', '0.02']], ids=['single', 'fused'])
def test_classify_has_the_taught_shapes_too(file, tmp_path, capsys, options):
    np.save(tmp_path / 'x.npy', held(rng_of(20), cross, 1))
    assert main(['classify', str(tmp_path / 'x.npy'), '--model', str(file), *options]) == 0
    lines = list(map(json.loads, capsys.readouterr().out.splitlines()))
    assert 'cross' in {line['shape'] for line in lines} and all('cross' in line['probabilities'] for line in lines)


def test_a_cross_is_recognised_in_touches_that_were_not_taught(file):
    recogniser, rng = Recogniser(file=file), rng_of(10)
    found = [recogniser.recognise(find_contact(50e3 * cross(rng))) for _ in range(60)]
    assert sum(each.shape == TaughtShape('cross') for each in found) >= 57
    assert all(list(each.probabilities) == [*Shape, TaughtShape('cross')] for each in found)
    assert all(sum(each.probabilities.values()) == pytest.approx(1) for each in found)
    assert fit_shape(find_contact(50e3 * cross(rng)), found[0].shape) is None
    assert Recogniser().recognise(find_contact(50e3 * cross(rng))).shape is Shape.UNKNOWN


@pytest.mark.parametrize('values', [np.zeros((PAD, PAD)), np.full((PAD, PAD), np.nan), np.pad([[9e4]], 7)])
def test_every_answer_has_a_probability_of_every_class(file, values):
    found = make_recogniser(file=str(file)).recognise(find_contact(values))
    assert TaughtShape('cross') in found.probabilities and found.shape in (Shape.NONE, Shape.UNKNOWN)
    assert (found.shape is Shape.UNKNOWN) is (found.reason is not UnknownReason.NOT_UNKNOWN)


def test_discs_under_another_name_are_not_good_enough(base, background):
    held_out = teach(base, background, [examples(20, disc)]).held_out
    assert not held_out.is_good and held_out.taught[0].value < LEAST_RIGHT
    before, after = held_out.five
    assert before.right - after.right <= 0.003 * before.total


def test_too_few_touches_are_refused(base, background):
    with pytest.raises(InputError):
        teach(base, background, [examples(21, count=5)])


def test_a_touch_ends_with_a_lift_and_not_with_frames_that_are_not_seen():
    frames = held(rng_of(22), cross, 3)
    frames[len(LOADS) + 3] = np.nan  # This frame lies in the middle of the second touch.
    found = TouchFinder('Pa').find(frames)
    assert [len(touch.frames) for touch in found.touches] == [4, 3, 4]
    assert not TouchFinder('Pa').find(held(rng_of(23), lambda rng: np.roll(cross(rng), 6, 0), 2)).touches


def test_frames_that_show_no_shape_are_counted_by_reason():
    def cut(rng):
        return np.roll(disc(rng), 6, 0) * (np.arange(PAD)[:, None] > 6)
    assert set(TouchFinder('Pa').find(held(rng_of(24), cut, 2)).unused) == {Unused.AT_EDGE}
    assert set(TouchFinder('Pa').find(held(rng_of(25), lambda rng: disc(rng, 1.0), 2)).unused) == {Unused.TOO_SMALL}


def test_a_live_touch_counts_once_it_was_steady_and_lifted():
    frames, rng = SimpleQueue(), rng_of(26)
    for _ in range(25):
        frames.put(1e3 + 100 * rng.standard_normal((PAD, PAD)))  # These frames show the values of the skin at rest.
    for frame_count in (3, 20, 20):  # The first of these touches is too short.
        covered = cross(rng)
        for _ in range(frame_count):
            frames.put(1e3 + 50e3 * covered + 100 * rng.standard_normal((PAD, PAD)))
        for _ in range(3):
            frames.put(1e3 + 100 * rng.standard_normal((PAD, PAD)))
    found = _guide('cross', 2, load_layout('sim16x16.yaml'), frames, [])
    assert len(found.touches) == 2 and frames.qsize() == 2  # The guide stops at the lift after the third touch.
    assert all(abs(np.median(frame.values)) < 200 for touch in found.touches for frame in touch.frames)


def test_the_interval_is_wilsons():
    """The expected values are from Newcombe, Statistics in Medicine 17 (1998), 857: 81/263, 15/148, 0/20 and 1/29."""
    expected = {(81, 263): (0.2553, 0.3662), (15, 148): (0.0624, 0.1605), (0, 20): (0.0, 0.1611),
                (1, 29): (0.0061, 0.1718)}
    for (right, total), interval in expected.items():
        assert Rate(right, total).interval == pytest.approx(interval, abs=1e-4)


def changed(name, value):
    return lambda arrays: arrays | {name: np.array(value) if not callable(value) else value(arrays[name])}


HOSTILE = {
    'version': changed('taught_version', 2), 'version of text': changed('taught_version', 'one'),
    'name of a shape': changed('taught_names', ['circle']), 'empty name': changed('taught_names', ['']),
    'no name': changed('taught_names', np.zeros(0, str)), 'name as number': changed('taught_names', [7]),
    'control characters': changed('taught_names', ['a\nb']), 'two names of one': changed('taught_names', ['a', 'a']),
    'more names than heads': changed('taught_names', ['a', 'b']),
    'too many names': changed('taught_names', [f'n{k}' for k in range(17)]),
    'NaN': changed('graded_taught_weights', lambda array: array * np.nan),
    'number beyond float32': changed('graded_taught_weights', lambda array: array.astype(float) + 1e300),
    'text as weights': changed('graded_taught_weights', [['a']]),
    'another width': changed('graded_taught_weights', lambda array: array[1:]),
    'no spread': changed('graded_taught_spread', lambda array: array * 0),
    'sizes of one number': changed('graded_taught_sizes', [1.0]),
    'another base': changed('graded_bias4', lambda array: array + 1),
    'no digest': lambda arrays: {name: array for name, array in arrays.items() if name != 'taught_base'},
    'no head': lambda arrays: {name: array for name, array in arrays.items() if not name.startswith('graded_taught')},
    'half a head': lambda arrays: {name: array for name, array in arrays.items() if name != 'graded_taught_biases'},
    'objects': changed('taught_names', np.array([{}], object)),
}


@pytest.mark.parametrize('change', HOSTILE.values(), ids=HOSTILE)
def test_a_file_without_taught_shapes_is_refused_with_our_error(arrays, change, tmp_path):
    path = tmp_path / 'hostile.npz'
    with np.errstate(all='ignore'):
        np.savez(path, **change(arrays))
        with pytest.raises(ConfigurationError):
            make_recogniser(file=str(path))


@pytest.fixture(scope='module')
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp('touches')
    np.save(folder / 'discs.npy', held(rng_of(27), disc, 12))
    return folder


def test_the_command_refuses_poor_recognition_unless_it_is_accepted(recordings, capsys, monkeypatch, background):
    found = []

    def teach_once(*given, **options):  # Both runs teach the same touches.
        found[:] = found or [teach(*given, **options)]
        return found[0]
    monkeypatch.setattr('tactile_node.cli.teach.teach', teach_once)
    monkeypatch.setattr('tactile_node.cli.teach.load_background', lambda kind: background)
    output, picture = recordings / 'own.npz', recordings / 'confusion.png'
    given = ['teach', '--name', 'coin', '--from', str(recordings / 'discs.npy'), '--output', str(output)]
    assert main(given) == 1 and not output.exists()
    assert main([*given, '--accept-poor', '--picture', str(picture)]) == 0
    assert picture.read_bytes().startswith(b'\x89PNG')
    assert [each.value for each in ShapeRecogniser.from_file(output).classes][len(Shape):] == ['coin']
    assert main([*given, '--model', str(output)]) == 2  # The recordings of the shape coin are not in the file.
    assert 'in one run' in capsys.readouterr().err


def test_the_command_refuses_to_overwrite_an_input_before_any_touch_is_recorded(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr('tactile_node.cli.touch_sources._live_touches',
                        lambda *given: pytest.fail('touches were recorded'))
    model = shutil.copy(config_path('recogniser.npz'), tmp_path)
    assert main(['teach', '--name', 'coin', '--model', model, '--output', model, '--force']) == 2
    assert 'recogniser.npz' in capsys.readouterr().err


def test_the_recording_that_a_live_session_reports_is_the_one_that_was_written(tmp_path, monkeypatch):
    """The log of an earlier session keeps its file name.

    A new session must not use the earlier log, even after Ctrl-C.
    """
    earlier, said = tmp_path / 'coin_touches.log', []
    earlier.write_text('of another object')

    def interrupted(*given):
        raise KeyboardInterrupt
    monkeypatch.setattr('tactile_node.cli.touch_sources._guide', interrupted)
    monkeypatch.setattr('tactile_node.cli.touch_sources._say', said.append)
    monkeypatch.setattr(SkinBus, 'configure', lambda bus: None)
    monkeypatch.setattr(SkinBus, 'start', lambda bus: None)
    assert main(['teach', '--name', 'coin', '--interface', 'virtual', '--channel', 'teach', '--output',
                 str(tmp_path / 'own.npz')]) == 130
    written, = (path for path in tmp_path.iterdir() if path != earlier)
    assert earlier.read_text() == 'of another object' and any(str(written) in text for text in said)


@pytest.mark.parametrize('given', [('--method', 'volf', '--model'), ('--curves',)])
def test_classify_refuses_a_file_that_its_method_does_not_read(given, recordings, file):
    """The paper's method would silently report a taught cross as a square."""
    assert main(['classify', *given, str(file), str(recordings / 'discs.npy')]) == 2


@pytest.mark.parametrize('name', ['circle', 'unknown', 'other', 'not_known', 'My plug', ''])
def test_the_command_refuses_names_that_would_mislead(name, recordings, tmp_path):
    assert main(['teach', '--name', name, '--from', str(recordings / 'discs.npy'), '--output',
                 str(tmp_path / 'own.npz')]) == 2
