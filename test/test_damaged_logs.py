"""Tests that the reader counts the damaged parts of a log from this package and reads all intact frames."""

import gzip
import itertools
import re
import sqlite3
import struct
from datetime import datetime
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import can
import numpy as np
import pytest
from test_logs import tiny_log, write_database

from tactile_node.cli.main import main
from tactile_node.errors import LogError
from tactile_node.logs.damage import DamageKind
from tactile_node.logs.log_reader import CanLogReader


def half(line):
    return line[:len(line) // 2]


#: Ways to damage a line: cut it in half, remove a digit of the data, or replace a byte, a word or the whole line.
DAMAGES = {'half': half, 'byte': lambda line: half(line) + b'\xff',
           'digit': lambda line: line.replace(b'55', b'5', 1) if b'55' in line else line.replace(b'VV', b'V', 1),
           'word': lambda line: line.replace(b'#', b'?', 1).replace(b'181', b'18?', 1), 'rubbish': lambda line: b'@@@@'}
TEXTS = ('.log', '.log.gz', '.asc', '.asc.gz', '.trc', '.csv')


def text_log(folder, suffix, change):
    """Write a log of 20 numbered frames with python-can, with its frame lines altered by ``change``."""
    plain = folder / f'whole{suffix.removesuffix(".gz")}'
    with can.Logger(str(plain)) as writer:
        for n in range(20):
            writer(can.Message(1.7e9 + n / 10, 0x181, False, data=[n, *7 * [0x55]], channel=0))
    lines = plain.read_bytes().splitlines(keepends=True)
    begin = next(k for k, line in enumerate(lines) if b'181' in line)
    content = b''.join(lines[:begin]) + change(lines[begin:])
    path = folder / f'x{suffix}'
    path.write_bytes(gzip.compress(content) if suffix.endswith('.gz') else content)
    return path


def numbers(reader):
    return [message.data[0] for message in reader]


@pytest.mark.parametrize('damage', DAMAGES)
@pytest.mark.parametrize('suffix', TEXTS)
def test_a_damaged_line_costs_its_own_frame(tmp_path, suffix, damage):
    def change(lines):
        damaged = DAMAGES[damage](lines[10].rstrip())
        assert damaged != lines[10].rstrip()
        return b''.join([*lines[:10], damaged + b'\n', *lines[11:]])
    reader = CanLogReader(text_log(tmp_path, suffix, change))
    assert numbers(reader) == [n for n in range(20) if n != 10] and reader.unread == 1


@pytest.mark.parametrize('suffix', TEXTS)
def test_two_lines_that_have_run_into_each_other_cost_their_frames(tmp_path, suffix):
    """The first line has lost its last digit and its line break, so the second line continues it."""
    reader = CanLogReader(text_log(tmp_path, suffix, lambda lines: b''.join(
        [*lines[:10], lines[10].rstrip()[:-1], *lines[11:]])))
    assert numbers(reader) == [n for n in range(20) if n not in (10, 11)] and reader.unread == 1


@pytest.mark.parametrize('suffix', TEXTS)
def test_only_the_incomplete_line_of_a_truncated_text_is_lost(tmp_path, suffix):
    reader = CanLogReader(text_log(tmp_path, suffix, lambda lines: b''.join(lines[:10]) + half(lines[10])))
    assert numbers(reader) == list(range(10)) and reader.unread == 1 and 'cut short' in reader.problem


def test_a_warning_says_that_losses_in_formats_of_python_can_are_not_counted(tmp_path, caplog, monkeypatch):
    monkeypatch.setattr(can, 'LogReader', can.CanutilsLogReader)
    path = tiny_log(tmp_path, '(1.0) can0 181#4142', name='x.xyz')
    # Without the blank line, the reader would recognise a candump log by its first bytes.
    path.write_text('\n' + path.read_text())
    assert [bytes(message.data) for message in CanLogReader(path)] == [b'AB']
    assert f'{path} is read by python-can' in caplog.text


def other_makers(folder, suffix):
    """Return logs with three frames each and with every other kind of record that their formats allow."""
    text = {'.asc': """date Wed Nov 15 10:00:00.000 am 2023
base hex  timestamps absolute
internal events logged
// version 9.0.0
Begin Triggerblock Wed Nov 15 10:00:00.000 am 2023
   0.000000 Start of measurement
   0.001000 CAN 1 Status:chip status error active
   0.010000 1  181             Rx   d 2 0A 0B  Length = 122000 BitCount = 63 ID = 385
   0.015000 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%
   0.015500 CANFD   1 Statistic: D 10 R 0 XD 0
   0.015600 CANFD   Start of measurement
   0.020000 1  281             TxRq d 2 0A 0B
   0.025000 1  ErrorFrame
   0.025500 CANFD   5 Tx ErrorFrame Not Acknowledge error, dominant error flag  fffe c7 31ca Arb. 556 44 0 0
   0.026000 J1939TP FEE3p 6 0 0 - Rx d 23 A0 0F A6
   0.026500 1  J1939TP FEE3p 6 0 0 - Rx d 23 A0 0F A6
   0.027000 log trigger event
   0.030000 1  381             Tx   r
End TriggerBlock
""", '.trc': """;$FILEVERSION=1.1
;$STARTTIME=45245.4166666667
;
     1)         1.2  Rx         0181  2  0A 0B
     2)         1.5  Warng  FFFFFFFF  4  00 00 00 08  BUSLIGHT
     3)         2.2  Tx         0281  2  0A 0B
;   a comment
     4)         3.2  Rx         0381  0  RTR

"""}[suffix]
    path = folder / f'other{suffix}'
    path.write_text(text)
    return path


@pytest.mark.parametrize(('suffix', 'ids'), [('.asc', [0x181, 0x281, 0x381]), ('.trc', [0x181, 0x281, 0x381])])
def test_other_records_in_a_makers_log_do_not_count_as_damage(tmp_path, suffix, ids):
    reader = CanLogReader(other_makers(tmp_path, suffix))
    assert [message.arbitration_id for message in reader if not message.is_error_frame] == ids
    assert not reader.unread


@pytest.mark.parametrize('lines', [
    ['date Wed Nov 15 10:00:00.000 am 2023'], ['date Wed Nov 15 10:00:00.000 2023', 'base hex  timestamps absolute'],
    ['date Wed Nov 15 10:00:00.000 2023', 'base dec  timestamps absolute', 'no internal events logged']])
def test_the_first_frame_after_the_header_of_an_asc_is_read(tmp_path, lines):
    """If the line about internal events is missing, python-can skips the next line instead."""
    frame = '1  385  Rx   d 2 10 11' if 'base dec' in ''.join(lines) else '1  181  Rx   d 2 0A 0B'
    reader = CanLogReader(tiny_log(tmp_path, *lines, f'   0.5 {frame}', f'   1.5 {frame}', name='x.asc'))
    assert [(message.arbitration_id, bytes(message.data)) for message in reader] == 2 * [(0x181, b'\x0A\x0B')]
    assert not reader.unread


@pytest.mark.parametrize(('date', 'time'), [
    ('Wed Nov 15 10:30:00.000 pm 2023', '22:30:00'), ('Wed Nov 15 22:30:00.000 pm 2023', '22:30:00'),
    ('Wed Nov 15 10:13:20.000 PM 2023', '22:13:20'), ('Wed Nov 15 12:00:00 am 2023', '00:00:00'),
    ('Wed Nov 15 22:30:00 2023', '22:30:00'), ('Wed Nov 15 00:30:00.000 am 2023', '00:30:00'),
    ('Mit M\xe4r 15 09:30:00.000 2023', '09:30:00')])
@pytest.mark.parametrize('what', ['date', 'Begin Triggerblock'])
def test_the_date_of_an_asc_is_read_as_it_is_written(tmp_path, what, date, time):
    path = tmp_path / 'x.asc'
    path.write_bytes(f'{what} {date}\nbase hex  timestamps absolute\n   1.5 1  181  Rx  d 1 0A\n'.encode('cp1252'))
    reader = CanLogReader(path)
    message, = reader
    assert datetime.fromtimestamp(message.timestamp - 1.5).strftime('%d %H:%M:%S') == f'15 {time}'
    assert not reader.unread


@pytest.mark.parametrize('date', ['yesterday', 'Wed Nov 31 10:00:00.000 2023', 'Wed Nov 15 25:00:00.000 2023'])
def test_a_date_that_cannot_be_read_costs_the_date_alone(tmp_path, date):
    reader = CanLogReader(tiny_log(tmp_path, f'date {date}', 'base hex  timestamps absolute',
                                   '   1.5 1  181  Rx   d 1 0A', '   2.5 1  181  Rx   d 1 0B', name='x.asc'))
    assert [(message.timestamp, message.data[0]) for message in reader] == [(1.5, 10), (2.5, 11)]
    assert reader.unread == 1 and date.split()[-1] in reader.problem


@pytest.mark.slow
def test_damage_within_a_database_is_reported(tmp_path):
    random = np.random.default_rng(1)
    path = write_database(tmp_path / 'x.db', [
        can.Message(1.7e9 + n / 1000, 0x181, False, data=random.bytes(8), channel=0) for n in range(6000)])
    content = bytearray(path.read_bytes())
    content[0x7000 + 300:0x7000 + 340] = 40 * b'\xC6'
    path.write_bytes(content)
    reader = CanLogReader(path)
    assert len(list(reader)) < 6000 and reader.unread


@pytest.mark.parametrize('damage', ['ts = NULL', "ts = 'x'", 'ts = -1.0', 'arbitration_id = NULL',
                                    'arbitration_id = 4096', 'arbitration_id = 385.5', 'dlc = NULL', 'dlc = 7',
                                    'data = NULL', 'data = 8'])
def test_a_damaged_row_of_a_database_costs_its_own_frame(tmp_path, damage):
    path = write_database(tmp_path / 'x.db', [
        can.Message(1.7e9 + n / 10, 0x181, False, data=[n, *7 * [0x55]], channel=0) for n in range(20)])
    with sqlite3.connect(path) as base:
        base.execute(f'UPDATE messages SET {damage} WHERE rowid = 11')
    base.close()
    reader = CanLogReader(path)
    assert numbers(reader) == [n for n in range(20) if n != 10] and reader.unread == 1


def test_a_header_without_which_no_line_can_be_read_is_an_error(tmp_path):
    """python-can raises this error repeatedly, even when no line is left."""
    lines = [';$FILEVERSION=2.1', ';$STARTTIME=45245.4', *(f'{n} {n}.000 DT 1 0181 Rx - 2 0A 0B' for n in range(1, 5))]
    with pytest.raises(LogError, match='no column information'):
        list(CanLogReader(tiny_log(tmp_path, *lines, name='x.trc')))


BLF_FRAMES = 6000  # This number of frames fills several containers.


@cache
def blf_bytes(compression):
    """Return the bytes of a BLF file with numbered frames, written by python-can."""
    random = np.random.default_rng(1)
    with TemporaryDirectory() as folder:
        path = Path(folder, 'x.blf')
        with can.BLFWriter(str(path), compression_level=compression) as writer:
            for n in range(BLF_FRAMES):
                data = n.to_bytes(2, 'big') + random.bytes(6)
                writer(can.Message(1.7e9 + n / 1000, 0x181, False, data=data, channel=0))
        return path.read_bytes()


def blf_log(folder, change=lambda content: content, compression=-1):
    """Write a BLF file to ``folder``, with its bytes altered by ``change``."""
    path = folder / 'x.blf'
    path.write_bytes(change(blf_bytes(compression)))
    return path


def places(content, kind):
    """Return the positions of all objects of ``kind`` in a BLF file.

    Kind 1 is a CAN frame, and kind 10 is a container.
    """
    head = struct.Struct('<4sHHLL')
    found = (match.start() for match in re.finditer(b'LOBJ', content))
    return [at for at in found if len(content) >= at + head.size and head.unpack_from(content, at)[-1] == kind]


def with_size(size, number, kind=1):
    """Return a change that writes a wrong size into the header of object ``number`` of ``kind``."""
    def change(content):
        at = places(content, kind)[number] + 8
        return content[:at] + struct.pack('<L', size) + content[at + 4:]
    return change


def counted(reader):
    return [int.from_bytes(message.data[:2], 'big') for message in itertools.islice(reader, 2 * BLF_FRAMES)]


def test_a_blf_is_read_whole(tmp_path):
    reader = CanLogReader(blf_log(tmp_path))
    assert counted(reader) == list(range(BLF_FRAMES)) and not reader.unread


@pytest.mark.parametrize('size', [0, 1, 16, 47, 49, 1000, 2 ** 32 - 1])
def test_an_object_of_a_blf_with_another_size_costs_its_own_frame(tmp_path, size):
    """After an object of size 0, python-can's reader once returned the previous frame for ever."""
    reader = CanLogReader(blf_log(tmp_path, with_size(size, 100), compression=0))
    assert counted(reader) == [n for n in range(BLF_FRAMES) if n != 100]
    damage, = reader.damages
    assert damage.kind is DamageKind.RECORDS and damage.size == 48
    assert damage.begin == pytest.approx(1.7e9 + 0.099, abs=1e-6)
    assert damage.end == pytest.approx(1.7e9 + 0.101, abs=1e-6)


def test_a_damaged_container_of_a_blf_costs_its_frames_and_those_that_cross_its_ends(tmp_path):
    def change(content):
        at = places(content, 10)[1] + 5000
        return content[:at] + bytes(byte ^ 0xFF for byte in content[at:at + 10]) + content[at + 10:]
    reader = CanLogReader(blf_log(tmp_path, change))
    found = counted(reader)
    lost = sorted(set(range(BLF_FRAMES)) - set(found))
    assert found == sorted(set(found)) and lost == list(range(lost[0], lost[-1] + 1)) and lost[0] > 1000
    assert len(lost) <= 131072 // 48 + 2 and reader.damages[0].kind is DamageKind.CHUNK


@pytest.mark.parametrize('number', [0, 1])
@pytest.mark.parametrize('size', [0, 15])
def test_a_container_of_a_blf_that_cannot_have_its_size_ends_the_log_and_the_rest_is_counted(tmp_path, number, size):
    path = blf_log(tmp_path, with_size(size, number, kind=10))
    reader = CanLogReader(path)
    if not number:
        with pytest.raises(LogError):
            counted(reader)
    else:
        found = counted(reader)
        assert found == list(range(len(found))) and 1000 < len(found) < BLF_FRAMES
        assert f'{len(found)} of {BLF_FRAMES} objects' in reader.problem
    damage, = reader.damages
    assert damage.kind is DamageKind.CUT_SHORT and damage.size > 0


@pytest.mark.parametrize('part', [0.3, 0.62, 0.99])
@pytest.mark.parametrize('compression', [-1, 0])
def test_a_blf_cut_short_says_how_many_objects_are_missing(tmp_path, part, compression):
    reader = CanLogReader(blf_log(tmp_path, lambda content: content[:int(part * len(content)) + 1], compression))
    found = counted(reader)
    assert found == list(range(len(found))) and 0 < len(found) < BLF_FRAMES
    damage, = reader.damages
    assert damage.kind is DamageKind.CUT_SHORT and f'{len(found)} of {BLF_FRAMES} objects' in damage.detail
    assert reader.unread == 1


@pytest.mark.parametrize('begun', range(0, 45, 4))
def test_a_blf_cut_at_the_begin_of_a_container_is_missing_the_objects_that_its_header_counts(tmp_path, begun):
    reader = CanLogReader(blf_log(tmp_path, lambda content: content[:places(content, 10)[1] + begun]))
    found = counted(reader)
    assert reader.unread == 1 and f'{len(found)} of {BLF_FRAMES} objects' in reader.problem


def test_a_blf_that_was_not_ended_is_read_up_to_its_end(tmp_path):
    """The writer completes the header last, so the header of an unfinished file counts no objects."""
    count = slice(32, 36)
    def change(content):
        assert int.from_bytes(content[count], 'little') == BLF_FRAMES
        return content[:count.start] + bytes(4) + content[count.stop:-1000]
    reader = CanLogReader(blf_log(tmp_path, change))
    found = counted(reader)
    assert found == list(range(len(found))) and len(found) > 4000 and reader.unread == 1


def test_an_empty_mcap_is_called_empty(tmp_path, capsys):
    (tmp_path / 'x.mcap').write_bytes(b'')
    for command in (['replay'], ['view', '--terminal']):
        assert main([*command, str(tmp_path / 'x.mcap')]) == 2
        assert '(the file is empty)). Record it again' in capsys.readouterr().err
