"""Tests that run `tactile features` and `tactile classify` as a user would."""

import io
import json
import subprocess
import sys

import by_definition
import numpy as np
import pytest
from patterns import assorted

from tactile_node.cli.main import main
from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.simulator.figures import Skin, pressure_frame
from tactile_node.simulator.world import random_contact
from training.ground_truth.seeds import Purpose, generator


@pytest.fixture
def tactile(tmp_path, capsys):
    """Return a function that runs a subcommand on an array and returns the printed JSON records."""
    def run(command, array, *options):
        np.save(tmp_path / 'frames.npy', array)
        assert main([command, str(tmp_path / 'frames.npy'), *options]) == 0
        return [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    return run


@pytest.mark.slow
def test_features_of_every_active_taxel(tactile):
    for mask in assorted().values():
        line = tactile('features', mask)[0]
        for name, value in by_definition.of_pattern(mask).items():
            expected = None if np.isnan(value) else pytest.approx(value, rel=1e-9, abs=1e-12)
            assert line[name] == expected, name


def test_each_frame_becomes_one_line(tactile):
    frames = np.zeros((3, 8, 8), bool)
    frames[1, 2:5, 2:7] = True
    assert [line['N'] for line in tactile('features', frames)] == [0, 15, 0]
    assert [line['frame'] for line in tactile('classify', frames)] == [0, 1, 2]
    assert [line['shape'] for line in tactile('classify', frames)][::2] == ['none', 'none']
    assert tactile('features', frames[:0]) == []


def test_classify_takes_the_largest_contact_and_features_only_on_request(tactile):
    mask = np.zeros((9, 9), bool)
    mask[0, :2] = mask[4:8, 4:8] = True
    assert tactile('classify', mask)[0]['N'] == 16 and tactile('classify', mask)[0]['contacts'] == 2
    assert tactile('features', mask)[0]['N'] == 18
    assert tactile('features', mask, '--largest-contact')[0]['N'] == 16


def test_classify_gives_the_reason_of_an_unknown_shape(tactile):
    frames = np.zeros((4, 16, 16))
    frames[0, 4:11] = np.nan
    frames[1, 5, 5:8] = frames[2, 4:11, 4:11] = 1
    found = tactile('classify', frames)
    assert [each['shape'] for each in found] == ['unknown', 'unknown', 'square', 'none']
    assert [each.get('reason') for each in found] == ['not_seen', 'too_small', None, None]


def test_pressures_in_any_unit_go_through_the_nodes_extraction(tactile):
    rng = generator(Purpose.TEST, 9)
    contact = random_contact(rng, 'square', 60)
    frames = np.array([pressure_frame(contact, rng, skin=Skin(noise=0.01, dead=0.02)) for _ in range(3)])
    top = np.nanmax(frames)
    extractor, fixed = PatternExtractor(), PatternExtractor(PressThresholds(0.3 * top, 0.2 * top))
    expected = [int(extractor.extract(frame).mask.sum()) for frame in frames]
    assert [line['N'] for line in tactile('classify', frames)] == expected
    assert [line['N'] for line in tactile('classify', frames / 1000)] == expected
    assert [line['N'] for line in tactile('classify', frames, '--full-scale', str(top))] == [
        int(fixed.extract(frame).mask.sum()) for frame in frames]
    assert tactile('classify', frames, '--full-scale', '1e9')[0]['shape'] == 'none'


def test_frames_of_a_file_follow_each_other(tactile):
    frames = np.full((3, 4, 4), 1.0)
    frames[1], frames[2] = 0.25, 0.1
    fixed = '--full-scale', '1'
    assert [line['N'] for line in tactile('features', frames, *fixed)] == [16, 16, 0]
    assert [line['N'] for line in tactile('features', frames, *fixed, '--release', '0.3')] == [16, 0, 0]


@pytest.mark.parametrize(('shape', 'names', 'turn'), [
    ('circle', ('radius',), None), ('rectangle', ('long', 'short'), np.pi),
    ('right_triangle', ('long_leg', 'short_leg'), 2 * np.pi)])
def test_classify_fits_pose_and_size_with_the_pitch(tactile, shape, names, turn):
    rng, pitch = generator(Purpose.TEST, 11), 0.004
    contact = random_contact(rng, shape, 80)
    frame = pressure_frame(contact, rng, skin=Skin(noise=0.01))
    empty, line = tactile('classify', np.array([np.zeros_like(frame), frame]), '--pitch', str(pitch))
    assert not {'x', 'dimensions', 'sd', 'box', 'hollow'} & set(empty)
    assert line['shape'] == shape
    assert [line['x'] / pitch, line['y'] / pitch] == pytest.approx(contact.outline().mean(0), abs=0.1)
    assert tuple(line['dimensions']) == names
    lengths = np.sort(contact.dimensions[:len(names)]) * pitch
    assert sorted(line['dimensions'].values()) == pytest.approx(lengths, rel=0.05)
    assert tuple(line['sd']) == ('x', 'y', 'angle', *names)
    if turn is None:
        assert line['angle'] is None and line['sd']['angle'] is None
    else:
        away = (line['angle'] - contact.angle + turn / 2) % turn - turn / 2
        assert abs(away) < 0.05 and 0 < line['sd']['angle'] < 0.05
    assert all(0 < line['sd'][name] < 0.1 * pitch for name in ('x', 'y', *names))
    assert not any(line['is_bound'][name] for name in names)
    assert not {'x', 'box'} & set(tactile('classify', frame)[0])


@pytest.mark.parametrize('pitch', ['0', '-0.004', 'nan'])
def test_a_pitch_that_is_not_a_length_is_refused(tmp_path, capsys, pitch):
    np.save(tmp_path / 'frames.npy', np.zeros((2, 2)))
    assert main(['classify', str(tmp_path / 'frames.npy'), f'--pitch={pitch}']) == 2
    assert 'pitch' in capsys.readouterr().err


@pytest.mark.parametrize('option', ['--press', '--release'])
def test_fractions_need_the_full_scale(tmp_path, capsys, option):
    np.save(tmp_path / 'frames.npy', np.zeros((2, 2)))
    assert main(['classify', str(tmp_path / 'frames.npy'), option, '0.3']) == 2
    assert '--full-scale' in capsys.readouterr().err


def test_an_output_file_gets_the_lines(tactile, tmp_path):
    assert tactile('classify', np.ones((4, 5), bool), '--output', str(tmp_path / 'lines.json')) == []
    assert json.loads((tmp_path / 'lines.json').read_text())['N'] == 20


@pytest.mark.bus
def test_a_reader_that_disconnects_is_not_an_error(tmp_path):
    np.save(tmp_path / 'many.npy', np.zeros((3000, 4, 4), bool))
    command = f'{sys.executable} -m tactile_node.cli.main classify {tmp_path}/many.npy | head -n 1'
    result = subprocess.run(['bash', '-o', 'pipefail', '-c', command],
                            capture_output=True, text=True, check=False)
    assert result.returncode == 0 and result.stderr == '' and len(result.stdout.splitlines()) == 1


@pytest.mark.bus
def test_neither_ros_nor_can_is_imported():
    code = ('import sys; from tactile_node.cli.main import main; import tactile_node.cli.classified, '
            'tactile_node.cli.frame_patterns; sys.exit(bool({"rclpy", "can", "canopen"} & set(sys.modules)))')
    assert subprocess.run([sys.executable, '-c', code], check=False).returncode == 0


def saved(array, **options):
    buffer = io.BytesIO()
    np.save(buffer, array, **options)
    return buffer.getvalue()


def archived(array):
    buffer = io.BytesIO()
    np.savez(buffer, array)
    return buffer.getvalue()


BAD = {'missing': None, 'empty': b'', 'text': b'1 2 3\n', 'cut short': saved(np.ones((5, 5)))[:-9],
       'objects': saved(np.array([{}], object)), 'archive': archived(np.ones((2, 2))),
       'broken archive': b'PK\x03\x04...',
       'one axis': saved(np.ones(5)), 'four axes': saved(np.ones((1, 1, 2, 2))),
       'no taxels': saved(np.ones((2, 0, 3))),
       'complex': saved(np.ones((2, 2), complex)), 'strings': saved(np.array([['a']])),
       'dates': saved(np.array([['2020-01-01']], 'M8[D]'))}


@pytest.mark.parametrize('command', ['features', 'classify'])
@pytest.mark.parametrize('content', BAD.values(), ids=BAD)
def test_bad_input_is_one_line_and_exit_code_2(tmp_path, capsys, command, content):
    path = tmp_path / 'frames.npy'
    if content is not None:
        path.write_bytes(content)
    assert main([command, str(path)]) == 2
    out, err = capsys.readouterr()
    assert out == '' and err.count('\n') == 1 and err.startswith('tactile: error: ') and str(path) in err


@pytest.mark.parametrize('options', [['--press', '-1'], ['--release', '0.9'], ['--full-scale', 'nan'],
                                     ['--output', '/no/such/folder/x']])
def test_bad_options(tmp_path, capsys, options):
    np.save(tmp_path / 'frames.npy', np.ones((3, 3)))
    assert main(['features', str(tmp_path / 'frames.npy'), *options]) == 2
    assert capsys.readouterr().err.count('\n') == 1
