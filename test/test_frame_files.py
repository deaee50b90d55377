"""Tests that `classify` and `features` read other formats besides .npy."""

import io
import json
import re
import struct
import zlib
from pathlib import Path
from zipfile import ZIP_LZMA, ZipFile

import numpy as np
import pytest
from PIL import Image

from tactile_node.cli import frame_file
from tactile_node.cli.frame_file import TaxelFrames, read_frames
from tactile_node.cli.frame_png import Greys
from tactile_node.cli.main import main
from tactile_node.errors import InputError
from tactile_node.skin.layout import MAX_SIDE
from tactile_node.taxel_frame import TaxelStatus

ROOT = Path(__file__).resolve().parents[1]
LOG = Path(__file__).parent / 'data' / 'sim16x16_two_pads.log.gz'
SQUARE = np.zeros((12, 12))
SQUARE[3:9, 3:9] = 40e3


@pytest.fixture
def tactile(capsys):
    """Return a function that runs a command and returns the printed lines."""
    def run(*words):
        assert main([str(word) for word in words]) == 0
        return capsys.readouterr().out.splitlines()
    return run


def text(path, content):
    path.write_text(content, encoding='utf-8')
    return str(path)


def png(path, pixels, mode=None):
    Image.fromarray(pixels, mode).save(path)
    return str(path)


@pytest.mark.parametrize('content', [
    '1,2\n3,\n\n5,6\n7,8\n', '\ufeff1;2\r\n3;\r\n\r\n5;6\r\n7;8', '# a comment\n1\t2\n3\t\n\n\n5\t6\n7\t8\n\n',
    '1.0e0, 2\n3, nan\n\n5, 6\n7, 8\n', '1,2\n3,inf\n\n5,6\n7,8\n'])
def test_rows_of_a_csv_are_rows_of_taxels_and_an_empty_line_begins_a_frame(tmp_path, content):
    found = read_frames(text(tmp_path / 'x.csv', content))
    np.testing.assert_array_equal(found.values, [[[1, 2], [3, np.nan]], [[5, 6], [7, 8]]])
    assert found[1:] == TaxelFrames(found.values)[1:]


def test_a_row_of_empty_cells_is_a_row_without_values_and_not_the_end_of_a_frame(tmp_path):
    found = read_frames(text(tmp_path / 'x.csv', '1,2\n,\n5,6\n')).values
    np.testing.assert_array_equal(found, [[[1, 2], [np.nan, np.nan], [5, 6]]])


def test_numbers_as_numpy_writes_them_by_default(tmp_path):
    np.savetxt(tmp_path / 'x.csv', SQUARE)
    np.testing.assert_array_equal(read_frames(str(tmp_path / 'x.csv')).values, [SQUARE])


@pytest.mark.parametrize(('content', 'where'), [
    ('1,2\n3\n', 'line 2'), ('1,2\n3,4,5\n', 'line 2'), ('a,b\n1,2\n', 'line 1, cell 1'),
    ('1;2\n3;4,5\n', 'line 2, cell 2'), ('1,2\n\n3,4\n5,6\n', 'x.csv'), ('\n\n', 'x.csv'), ('', 'x.csv'),
    ('# 1,2\n', 'x.csv')])
def test_another_text_is_refused_by_line_and_cell(tmp_path, content, where):
    with pytest.raises(InputError) as refused:
        read_frames(text(tmp_path / 'x.csv', content))
    assert where in refused.value.where


@pytest.mark.parametrize(('shape', 'warns'), [((64, 16), True), ((2000, 256), True), ((63, 16), False),
                                              ((64, 15), False), ((16, 64), False), ((2, 64, 16), False)])
@pytest.mark.parametrize('name', ['x.csv', 'x.npy'])
def test_a_table_of_frames_that_is_read_as_one_frame_is_reported(tmp_path, capsys, name, shape, warns):
    frames = np.zeros(shape)
    if name == 'x.npy':
        np.save(tmp_path / name, frames)
    else:
        text(tmp_path / name, '\n'.join('\n'.join(','.join(map(str, row)) for row in frame) + '\n'
                                       for frame in frames.reshape(-1, *shape[-2:])))
    assert main(['classify', str(tmp_path / name)]) == 0
    assert ('docs/howto/without_ros.md' in capsys.readouterr().err) == warns


#: Header, frame title and shape of two exports from other systems. The CSV export has a title for each frame and one
#: line for each row of taxels. The text export has no titles and one line for each frame.
EXPORTS = {'export.csv': ('DATA_TYPE MOVIE\nROWS 44\nCOLS 36\nUNITS N/cm\xb2\nASCII_DATA @@\n', 'Frame {}\n', (44, 36)),
           'export.txt': ('file name: a\nsensor: 16 x 16\ntime[secs]\t1\t2\n', '', (16, 16))}


@pytest.mark.parametrize('name', EXPORTS)
def test_an_export_is_refused_with_the_place_of_a_remedy_that_works(tmp_path, monkeypatch, capsys, name):
    header, title, shape = EXPORTS[name]
    frames = np.arange(3 * shape[0] * shape[1]).reshape(3, *shape)
    body = [title.format(k + 1) + '\n'.join(','.join(map(str, row)) for row in frame) + '\n\n' if title else
            '\t'.join(map(str, (k / 10, *frame.ravel()))) + '\n' for k, frame in enumerate(frames)]
    monkeypatch.chdir(tmp_path)
    Path(name).write_text(header + ''.join(body), encoding='latin-1')
    assert main(['classify', name]) == 2
    page = 'docs/howto/without_ros.md'
    assert page in capsys.readouterr().err
    code, = (block for block in re.findall('```python\n(.*?)```', (ROOT / page).read_text(encoding='utf-8'), re.DOTALL)
             if name in block)
    exec(code)  # noqa: S102
    found = read_frames('frames.npy' if title else 'frames.npz')
    np.testing.assert_array_equal(found.values, frames)
    assert title or found.stamps.tolist() == [0, 0.1, 0.2]


def test_a_pixel_is_a_taxel_and_the_top_line_is_row_0(tmp_path):
    pixels = np.array([[0, 51], [102, 255], [0, 0]], np.uint8)
    found = read_frames(png(tmp_path / 'x.png', pixels)).values
    np.testing.assert_allclose(found, [[[0, 0.2], [0.4, 1], [0, 0]]])
    found = read_frames(str(tmp_path / 'x.png'), Greys(black=100e3, white=0)).values
    np.testing.assert_allclose(found, [[[100e3, 80e3], [60e3, 0], [100e3, 100e3]]])


def test_sixteen_bits_keep_their_resolution_and_transparent_pixels_have_no_value(tmp_path):
    deep = np.array([[0, 1], [65534, 65535]], np.uint16)
    np.testing.assert_allclose(read_frames(png(tmp_path / 'deep.png', deep)).values[0] * 65535, deep)
    clear = np.array([[[9, 9, 9, 255], [9, 9, 9, 0]]], np.uint8)
    np.testing.assert_allclose(read_frames(png(tmp_path / 'clear.png', clear)).values, [[[9 / 255, np.nan]]])


def png_with_a_transparent_grey(path, depth, row, grey):
    """Write a PNG file with one line of pixels, colour type 0 and a tRNS chunk, as defined by the PNG specification."""
    def chunk(kind, content):
        return struct.pack('>I', len(content)) + kind + content + struct.pack('>I', zlib.crc32(kind + content))
    header = struct.pack('>IIBBBBB', len(row) * 8 // depth, 1, depth, 0, 0, 0, 0)
    path.write_bytes(b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', header) + chunk(b'tRNS', struct.pack('>H', grey))
                     + chunk(b'IDAT', zlib.compress(b'\0' + row)) + chunk(b'IEND', b''))
    return str(path)


@pytest.mark.parametrize(('depth', 'row', 'grey'), [(8, b'\x09\xff', 255), (16, b'\x00\x09\xff\xff', 65535)])
def test_a_transparent_grey_has_no_value(tmp_path, depth, row, grey):
    """If the reader treated this grey as opaque, the pixel would be the brightest and count as the hardest press."""
    found = read_frames(png_with_a_transparent_grey(tmp_path / 'x.png', depth, row, grey)).values
    np.testing.assert_allclose(found, [[[9 / (2 ** depth - 1), np.nan]]])


def no_png(path):
    path.write_bytes(b'\x89PNG\r\n\x1a\nnothing more')
    return str(path)


@pytest.mark.parametrize('make', [
    lambda path: png(path, np.array([[[255, 0, 0]]], np.uint8)),
    lambda path: png(path, np.zeros((2, MAX_SIDE + 1), np.uint8)),
    lambda path: png(path, np.array([[[9, 9, 9, 128]]], np.uint8)),
    lambda path: png_with_a_transparent_grey(path, 4, b'\x0f', 15), no_png],
    ids=['red', 'wide', 'half', 'few bits', 'broken'])
def test_a_picture_without_one_value_per_pixel_is_refused(tmp_path, make):
    with pytest.raises(InputError):
        read_frames(make(tmp_path / 'x.png'))


@pytest.fixture(scope='module')
def replayed(tmp_path_factory):
    path = tmp_path_factory.mktemp('replayed') / 'frames.npz'
    assert main(['replay', str(LOG), '--output', str(path)]) == 0
    return path


@pytest.mark.slow
def test_replay_keeps_stamps_sequence_pad_pitch_and_unit(replayed):
    found, values = read_frames(str(replayed)), np.load(replayed)['values']
    np.testing.assert_array_equal(found.values, values)
    assert (found.pad, found.pitch, found.unit) == ('pad32', 0.002, 'Pa')
    assert len(values) == len(found.stamps) == len(found.sequence) == 120
    assert np.all(np.diff(found.stamps) > 0) and np.all(np.diff(found.sequence) > 0)
    assert set(np.unique(found.status)) <= {1, 2, 3, 4, 5, 6} and found.status.shape == values.shape


@pytest.mark.slow
def test_classify_reports_stamps_and_measures_by_the_pitch_of_the_file(replayed, tactile):
    lines = list(map(json.loads, tactile('classify', replayed)))
    found = read_frames(str(replayed))
    assert [line['stamp'] for line in lines] == found.stamps.tolist()
    assert {line['pad'] for line in lines} == {'pad32'} and {line['file'] for line in lines} == {str(replayed)}
    assert any(0.01 < line['dimensions'].get('long', 0) < 0.06 for line in lines if 'dimensions' in line)


@pytest.mark.slow
def test_frames_are_fused_by_their_stamps(replayed, tactile, tmp_path):
    fused = list(map(json.loads, tactile('classify', replayed, '--fuse')))
    assert max(line['fused_frames'] for line in fused) > 5 and max(line['held'] for line in fused) > 0.1
    arrays = dict(np.load(replayed))
    later = np.arange(len(arrays['stamps'])) * 10.0  # This interval is longer than fusion waits for the next frame.
    np.savez(tmp_path / 'slow.npz', **{**arrays, 'stamps': later})
    slow = list(map(json.loads, tactile('classify', tmp_path / 'slow.npz', '--fuse')))
    assert max(line['fused_frames'] for line in slow) == 1


def test_fusion_without_stamps_needs_the_period(tmp_path, tactile, capsys):
    np.save(tmp_path / 'x.npy', np.stack(3 * [SQUARE]))
    assert main(['classify', str(tmp_path / 'x.npy'), '--fuse']) == 2
    assert '--period' in capsys.readouterr().err
    held = [json.loads(line)['held'] for line in tactile('classify', tmp_path / 'x.npy', '--fuse', '--period', 0.02)]
    assert held == pytest.approx([0, 0.02, 0.04])


@pytest.mark.parametrize('change', [
    {'stamps': np.zeros(3)}, {'stamps': np.array([0.0, np.nan])}, {'stamps': np.array(['a', 'b'])},
    {'unit': np.array('psi')}, {'pitch': np.array(-1.0)}, {'status': np.zeros((2, 1, 1), int)},
    {'status': np.full((2, 4, 4), 200)}, {'status': np.full((2, 4, 4), TaxelStatus.STALE)},
    {'unit': np.array(['Pa', 'Pa'])}, {'pad': np.array(1)}, {'values': np.zeros(3)}], ids=str)
def test_an_archive_whose_parts_do_not_fit_together_is_refused(tmp_path, change):
    np.savez(tmp_path / 'x.npz', **{'values': np.zeros((2, 4, 4)), 'stamps': np.arange(2.0), **change})
    with pytest.raises(InputError):
        read_frames(str(tmp_path / 'x.npz'))


def test_archives_of_others(tmp_path):
    np.savez(tmp_path / 'one.npz', whatever=SQUARE)
    np.testing.assert_array_equal(read_frames(str(tmp_path / 'one.npz')).values, [SQUARE])
    np.savez(tmp_path / 'two.npz', a=SQUARE, b=SQUARE)
    with pytest.raises(InputError):
        read_frames(str(tmp_path / 'two.npz'))


def other_member(path):
    with ZipFile(path, 'w') as archive:
        archive.writestr('values.txt', '1,2')


def no_array(path):
    with ZipFile(path, 'w') as archive:
        archive.writestr('values.npy', '1,2')


def other_compression(path):
    """The limit on the unpacked size does not hold for this compression, so even a valid array is refused."""
    stream = io.BytesIO()
    np.save(stream, SQUARE)
    with ZipFile(path, 'w', ZIP_LZMA) as archive:
        archive.writestr('values.npy', stream.getvalue())


def encrypted(path):
    np.savez(path, values=SQUARE)
    content = bytearray(path.read_bytes())
    # Set bit 0 of the general purpose flag, which marks an encrypted file (PKWARE APPNOTE 4.4.4).
    content[content.find(b'PK\x01\x02') + 8] |= 1
    path.write_bytes(content)


@pytest.mark.parametrize('make', [other_member, no_array, other_compression, encrypted])
def test_an_archive_that_numpy_has_not_written_is_refused(tmp_path, make):
    make(tmp_path / 'x.npz')
    with pytest.raises(InputError):
        read_frames(str(tmp_path / 'x.npz'))


def test_an_archive_is_refused_by_its_size_before_it_is_unpacked(tmp_path, monkeypatch):
    np.savez_compressed(tmp_path / 'x.npz', values=np.zeros((100, 16, 16)))
    # The limit equals the size of the values, so the file with its header exceeds the limit.
    monkeypatch.setattr(frame_file, 'MOST_UNPACKED', 100 * 16 * 16 * 8)
    monkeypatch.setattr(np, 'load', lambda *_, **__: pytest.fail('unpacked'))
    with pytest.raises(InputError):
        read_frames(str(tmp_path / 'x.npz'))


@pytest.mark.parametrize('make', [
    lambda stream: np.save(stream, SQUARE), lambda stream: np.savez(stream, values=[SQUARE]),
    lambda stream: np.savetxt(stream, SQUARE, delimiter=',')], ids=['npy', 'npz', 'csv'])
def test_a_file_with_another_suffix_is_known_by_its_first_bytes(make, tmp_path):
    with (tmp_path / 'x.dat').open('wb') as stream:
        make(stream)
    np.testing.assert_array_equal(read_frames(str(tmp_path / 'x.dat')).values, [SQUARE])


def test_a_unit_that_contradicts_the_file_or_its_values_is_refused(tmp_path, replayed, capsys):
    assert main(['classify', str(replayed), '--unit', 'N']) == 2
    assert main(['classify', text(tmp_path / 'x.csv', '0,1\n1,0\n'), '--unit', 'Pa']) == 2
    assert capsys.readouterr().err.count('\n') == 2


def test_groups_limit_the_features(tmp_path, tactile):
    np.save(tmp_path / 'x.npy', SQUARE > 0)
    line = json.loads(tactile('features', tmp_path / 'x.npy', '--groups', 'gravity9')[0])
    assert {'N', 'P05', 'P09', 'alpha9'} < set(line) and not {'lambda5', 'alpha5'} & set(line)
    assert line['rotated'] == {}
    line = json.loads(tactile('features', tmp_path / 'x.npy', '--groups', 'information5,rotated')[0])
    every = json.loads(tactile('features', tmp_path / 'x.npy')[0])
    assert line['rotated']['info_norm5']['dif'] == every['rotated']['info_norm5']['dif']


@pytest.mark.parametrize('words', [('features', '--groups', 'size'), ('classify', '--white', '0'),
                                   ('classify', '--white', 'nan'), ('classify', '--fuse', '--period', '0')])
def test_bad_options_are_one_line(tmp_path, capsys, words):
    np.save(tmp_path / 'x.npy', SQUARE)
    assert main([words[0], str(tmp_path / 'x.npy'), *words[1:]]) == 2
    assert capsys.readouterr().err.count('\n') == 1


def test_an_output_that_is_one_of_several_inputs_is_refused(tmp_path, capsys):
    paths = [text(tmp_path / name, '0,0\n0,0\n') for name in ('a.csv', 'b.csv')]
    assert main(['classify', *paths, '--output', paths[1]]) == 2
    assert Path(paths[1]).read_text() == '0,0\n0,0\n'


def test_replay_does_not_write_an_array_under_the_name_of_another_format(tmp_path):
    assert main(['replay', str(LOG), '--output', str(tmp_path / 'x.csv')]) == 2
    assert list(tmp_path.iterdir()) == []
