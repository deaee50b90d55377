"""When a recording rotates, no CAN frame is lost between two files.

On a full disk, the recording counts the lost CAN frames exactly.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from numbered_frames import numbered
from test_can_commands import run

from tactile_node.cli import record
from tactile_node.errors import ConfigurationError
from tactile_node.logs.log_reader import CanLogReader
from tactile_node.logs.log_writer import CanLogWriter

SUFFIXES = ['.log', '.log.gz', '.mcap']
FRAMES = 1500
ROOT = Path(__file__).resolve().parents[1]


def numbers(path):
    return [int.from_bytes(message.data[:4], 'little') for message in CanLogReader(path)]


@pytest.mark.slow
@pytest.mark.parametrize('suffix', SUFFIXES)
def test_a_recording_that_rotates_loses_no_frame_and_each_file_can_be_read(tmp_path, suffix):
    writer = CanLogWriter(tmp_path / f'x{suffix}', largest=4_000)
    for message in numbered(FRAMES):
        writer.write(message)
    writer.close()
    files = [tmp_path / f'x{part}{suffix}' for part in ('', *(f'_part{n}' for n in range(2, writer.parts + 1)))]
    assert sorted(files) == sorted(tmp_path.iterdir()) and writer.parts > 1
    assert numbers(files[0]) == list(range(FRAMES))  # Reading the first file reads the whole recording.
    alone = [file.rename(tmp_path / f'{n}{suffix}') for n, file in enumerate(files)]
    found = [numbers(file) for file in alone]
    assert sum(found, []) == list(range(FRAMES)) and all(found)
    assert (writer.can_frames, writer.unwritten, writer.failure) == (FRAMES, 0, '')
    assert all(4_000 <= file.stat().st_size < 60_000 for file in alone[:-1])


def test_the_parts_of_two_recordings_are_never_mixed(tmp_path):
    (tmp_path / 'x_part3.log').touch()  # This file belongs to a recording whose first files were moved away.
    paths = []
    for _ in range(2):
        writer = CanLogWriter(tmp_path / 'x.log', largest=1)
        for message in numbered(257):
            writer.write(message)
        writer.close()
        paths.append(writer.path.name)
    assert paths == ['x-2.log', 'x-3.log']
    assert {path.name for path in tmp_path.iterdir()} == {'x_part3.log', 'x-2.log', 'x-2_part2.log', 'x-3.log',
                                                          'x-3_part2.log'}


def test_a_next_file_that_cannot_be_made_ends_the_recording(tmp_path):
    """The first file keeps all its CAN frames, and later CAN frames are counted as unwritten."""
    writer = CanLogWriter(tmp_path / 'x.log', largest=1)
    (tmp_path / 'x_part2.log').touch()
    for message in numbered(300):
        writer.write(message)
    writer.close()
    assert (writer.can_frames, writer.unwritten) == (256, 44) and 'x.log' in writer.failure
    assert numbers(tmp_path / 'x.log') == list(range(256)) and not (tmp_path / 'x_part2.log').stat().st_size


FULL = '''
import resource, sys, time
from numbered_frames import numbered
from tactile_node.logs import log_writer
log_writer.FLUSH_PERIOD = 0.01
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]),) * 2)
writer = log_writer.CanLogWriter(sys.argv[1], largest=int(sys.argv[2]))
messages = numbered(1500)
for n, message in enumerate(messages):
    writer.write(message)
    if n % 100 == 99:
        time.sleep(0.03)
writer.close()
print(writer.can_frames, writer.unwritten, bool(writer.failure), writer.parts)
'''


@pytest.mark.slow
@pytest.mark.parametrize(('suffix', 'largest'), [*((suffix, 0) for suffix in SUFFIXES), ('.log', 5_000)])
def test_a_full_disk_loses_exactly_the_counted_frames(tmp_path, suffix, largest):
    """A file size limit simulates the full disk.

    Files that rotate at 5,000 bytes never reach the limit.
    """
    path, room = tmp_path / f'x{suffix}', 12_000 if suffix == '.log.gz' else 40_000
    # With -B, Python writes no bytecode, because the size limit would truncate the bytecode cache of other programs.
    environment = os.environ | {'PYTHONPATH': f'{ROOT}:{ROOT / "test"}'}
    done = subprocess.run([sys.executable, '-B', '-c', FULL, str(path), str(largest), str(room)], text=True,
                          env=environment, capture_output=True, timeout=120, check=True)
    kept, lost, has_failed, parts = done.stdout.split()
    found = numbers(path)
    if largest:
        assert (int(kept), lost, has_failed) == (FRAMES, '0', 'False') and int(parts) > 1
        return
    assert has_failed == 'True' and found == list(range(int(kept))) and int(kept) > 0
    assert int(kept) + int(lost) == FRAMES and path.stat().st_size <= room


@pytest.mark.parametrize('size', ['-1', 'nan', 'inf'])
def test_record_refuses_an_impossible_size(tmp_path, size):
    with pytest.raises(ConfigurationError, match='--rotate-mb'):
        run(record, '--interface', 'virtual', '--rotate-mb', size, tmp_path / 'x.log')
    assert not list(tmp_path.iterdir())
