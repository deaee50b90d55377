"""What is damaged within a log that this package writes is counted; what was recorded whole is read."""

import gzip
import time

import can
import numpy as np
import pytest
from test_logs import tiny_log

from tactile_node.errors import LogError
from tactile_node.logs.bag_log import McapCanWriter
from tactile_node.logs.log_reader import CanLogReader


def half(line):
    return line[:len(line) // 2]


#: what may become of a line: its half, a digit less in the data, another byte, another word, nothing that is a log
DAMAGES = {'half': half, 'digit': lambda line: line.replace(b'55', b'5', 1), 'byte': lambda line: half(line) + b'\xff',
           'word': lambda line: line.replace(b'#', b'?', 1), 'rubbish': lambda line: b'@@@@'}


@pytest.mark.parametrize('damage', DAMAGES)
@pytest.mark.parametrize('suffix', ['.log', '.log.gz'])
def test_a_damaged_line_costs_its_own_frame(tmp_path, suffix, damage):
    plain = tmp_path / 'x.log'
    with can.Logger(str(plain)) as writer:
        for n in range(20):
            writer(can.Message(1.7e9 + n / 10, 0x181, False, data=[n, *7 * [0x55]], channel=0))
    lines = plain.read_bytes().splitlines()
    lines[10] = DAMAGES[damage](lines[10])
    damaged = tmp_path / f'damaged{suffix}'
    content = b'\n'.join(lines) + b'\n'
    damaged.write_bytes(gzip.compress(content) if suffix.endswith('.gz') else content)
    reader = CanLogReader(damaged)
    assert [message.data[0] for message in reader] == [n for n in range(20) if n != 10] and reader.unread == 1


@pytest.mark.parametrize('suffix', ['.asc', '.trc', '.csv', '.blf'])
def test_of_a_format_that_python_can_reads_it_is_said_that_losses_are_not_counted(tmp_path, caplog, suffix):
    path = tmp_path / f'x{suffix}'
    with can.Logger(str(path)) as writer:
        writer(can.Message(1.7e9, 0x181, False, data=b'AB', channel=0))
    assert [bytes(message.data) for message in CanLogReader(path)] == [b'AB']
    assert f'{path} is read by python-can' in caplog.text


def other_makers(folder, suffix):
    """Logs with all that these formats hold beside CAN frames; three frames each."""
    text = {'.asc': """date Wed Nov 15 10:00:00.000 am 2023
base hex  timestamps absolute
internal events logged
// version 9.0.0
Begin Triggerblock Wed Nov 15 10:00:00.000 am 2023
   0.000000 Start of measurement
   0.001000 CAN 1 Status:chip status error active
   0.010000 1  181             Rx   d 2 0A 0B  Length = 122000 BitCount = 63 ID = 385
   0.015000 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%
   0.020000 1  281             TxRq d 2 0A 0B
   0.025000 1  ErrorFrame
   0.026000 J1939TP FEE3p 6 0 0 - Rx d 23 A0 0F A6
   0.027000 log trigger event
   0.030000 1  381             Tx   r
End TriggerBlock
""", '.trc': """;$FILEVERSION=1.1
;$STARTTIME=45245.4166666667
;
     1)         1.2  Rx         0181  2  0A 0B
     2)         1.5  Warng  FFFFFFFF  4  00 00 00 08  BUSLIGHT
     3)         2.2  Tx         0281  2  0A 0B
     4)         3.2  Rx         0381  0  RTR

"""}[suffix]
    path = folder / f'other{suffix}'
    path.write_text(text)
    return path


@pytest.mark.parametrize(('suffix', 'ids'), [('.asc', [0x181, 0x281, 0x381]), ('.trc', [0x181, 0x281, 0x381])])
def test_what_is_no_can_frame_in_another_makers_log_is_not_taken_for_damage(tmp_path, suffix, ids):
    reader = CanLogReader(other_makers(tmp_path, suffix))
    assert [message.arbitration_id for message in reader if not message.is_error_frame] == ids
    assert not reader.unread


@pytest.mark.parametrize('suffix', ['.mcap', '.db'])
def test_damage_within_a_binary_log_is_reported(tmp_path, suffix):
    path = tmp_path / f'x{suffix}'
    writer, random = McapCanWriter(path) if suffix == '.mcap' else can.Logger(str(path)), np.random.default_rng(1)
    for n in range(6000):
        writer.on_message_received(can.Message(1.7e9 + n / 1000, 0x181, False, data=random.bytes(8), channel=0))
    while suffix == '.db' and writer.num_frames < 6000:  # python-can's writer loses what waits when it is stopped
        time.sleep(0.01)
    writer.stop()
    content = bytearray(path.read_bytes())
    first = 0x7000 if suffix == '.db' else content.index(b'\4\0\0\0zstd', 200)
    content[first + 300:first + 340] = 40 * b'\xC6'
    path.write_bytes(content)
    reader = CanLogReader(path)
    assert len(list(reader)) < 6000 and reader.unread


def test_a_header_without_which_no_line_can_be_read_is_an_error(tmp_path):
    """python-can refuses it again and again, also when there is no line left."""
    lines = [';$FILEVERSION=2.1', ';$STARTTIME=45245.4', *(f'{n} {n}.000 DT 1 0181 Rx - 2 0A 0B' for n in range(1, 5))]
    with pytest.raises(LogError, match='no column information'):
        list(CanLogReader(tiny_log(tmp_path, *lines, name='x.trc')))
