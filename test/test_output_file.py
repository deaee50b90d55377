"""A command either writes a complete output file or leaves the file unchanged, and never writes to its input file."""

import os
import stat
import subprocess
import sys
import threading

import numpy as np
import pytest

from tactile_node.cli.main import main
from tactile_node.errors import InputError
from tactile_node.output_file import output_file

KEPT = np.zeros((2, 8, 8))


@pytest.fixture
def kept(tmp_path):
    np.save(tmp_path / 'keep.npy', KEPT)
    return tmp_path / 'keep.npy'


def is_kept(path):
    return np.array_equal(np.load(path), KEPT) and os.listdir(path.parent) == [path.name]


def test_a_log_that_cannot_be_played_leaves_the_output_as_it_was(kept, capsys):
    kept = kept.rename(kept.with_suffix('.npz'))  # np.load knows the array by its first bytes
    assert main(['replay', 'nosuch.log', '--output', str(kept), '--force']) == 2
    assert 'nosuch.log' in capsys.readouterr().err
    assert is_kept(kept)


@pytest.mark.parametrize('command', ['features', 'classify'])
@pytest.mark.parametrize('name', ['keep.npy', 'link.npy'])
def test_the_results_for_an_array_never_overwrite_the_array(command, name, kept, capsys):
    """A link to the array, or the option --force, must not overwrite the array."""
    if name != kept.name:
        kept.with_name(name).symlink_to(kept)
    assert main([command, str(kept), '-o', str(kept.with_name(name)), '--force']) == 2
    assert 'another' in capsys.readouterr().err and np.array_equal(np.load(kept), KEPT)
    assert set(os.listdir(kept.parent)) == {kept.name, name}


def test_an_error_while_writing_leaves_the_old_file_and_nothing_else(kept):
    with pytest.raises(RuntimeError), output_file(kept) as stream:
        stream.write(b'half')
        raise RuntimeError
    assert is_kept(kept)


def test_the_old_file_stays_until_the_new_one_is_whole(tmp_path):
    path = tmp_path / 'x'
    path.write_bytes(b'old')
    path.chmod(0o640)
    with output_file(path) as stream:
        stream.write(b'new')
        stream.flush()
        assert path.read_bytes() == b'old'
    assert path.read_bytes() == b'new' and stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_new_file_has_the_permissions_of_the_umask(tmp_path):
    before = os.umask(0o027)
    try:
        with output_file(tmp_path / 'x') as stream:
            stream.write(b'new')
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / 'x').stat().st_mode) == 0o640


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / 'link').symlink_to('target')
    with output_file(tmp_path / 'link') as stream:
        stream.write(b'new')
    assert (tmp_path / 'link').is_symlink() and (tmp_path / 'target').read_bytes() == b'new'


@pytest.mark.skipif(not os.path.exists('/dev/full'), reason='no /dev/full')
@pytest.mark.parametrize('words', [('classify', '{}', '-o', '/dev/full'), ('features', '{}', '-o', '/dev/full')])
def test_a_full_disk_is_reported_in_one_line(words, tmp_path, capsys):
    np.save(tmp_path / 'a.npy', np.ones((4000, 8, 8), bool))
    assert main([word.format(tmp_path / 'a.npy') for word in words]) == 2
    assert 'No space left' in capsys.readouterr().err


def test_a_folder_that_is_not_there_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(InputError), output_file(tmp_path / 'nowhere' / 'x'):
        pytest.fail('opened')


def test_a_pipe_is_written(tmp_path):
    os.mkfifo(tmp_path / 'pipe')
    received = []
    reader = threading.Thread(target=lambda: received.append((tmp_path / 'pipe').read_bytes()))
    reader.start()
    with output_file(tmp_path / 'pipe') as stream:
        stream.write(b'new')
    reader.join(60)
    assert received == [b'new']
    result = subprocess.run([sys.executable, '-c', 'from tactile_node.output_file import output_file\n'
                             'with output_file("/dev/stdout") as stream: stream.write(b"new")'],
                            capture_output=True, check=True)
    assert result.stdout == b'new'
