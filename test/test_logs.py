"""Recorded logs can be read, written and played. Every CAN frame is accounted for."""

import gzip
import logging
import subprocess
import sys
import threading

import can
import numpy as np
import pytest
from can_bench import tiny_layout
from candump import DATA, read_candump
from waiting import until

from tactile_node.assembly.facts import LossReason
from tactile_node.assembly.health import BusFault, TpdoOrder
from tactile_node.cli.main import main
from tactile_node.errors import LogError
from tactile_node.logs.log_reader import CanLogReader
from tactile_node.logs.log_writer import CanLogWriter
from tactile_node.skin.layout_file import load_layout
from tactile_node.skin.pads import PadSettings
from tactile_node.sources.log_source import LogSource

RING = DATA / 'nus_ring_session.log.gz'


def play(path, pads, **options):
    """Play a log and return all pairs of pad and frame, and the source."""
    frames = []
    source = LogSource(str(path), pads, lambda name, frame: frames.append((name, frame)),
                       **{'pace': None} | options)
    source.open()
    source.start()
    assert source.finished.wait(60)
    source.close()
    return frames, source


def nus_pad():
    return (PadSettings('pad', (32,), load_layout('nus_sinapse_64x64.yaml')),)


def test_ring_session_accounts_for_every_can_frame():
    frames, source = play(RING, nus_pad())
    with gzip.open(RING, 'rt') as log:
        ids = [int(line.split()[2].split('#')[0], 16) for line in log]
    pad, counted = source.facts().pad('pad'), source.facts().can_frames
    syncs, tpdos = ids.count(0x80), sum(0x180 < i < 0x500 for i in ids)
    assert (syncs, tpdos) == (77, 77 * 64)  # The log contains every poll of the recording, with 64 rows per poll.
    assert pad.frames_complete == len(frames) == syncs and pad.tpdos_used == pad.tpdos_received == tpdos
    assert sum(pad.losses.values()) == pad.tpdos_pending == pad.frames_incomplete == 0
    assert source.facts().unread_log_lines == 0
    assert counted == {'nmt': ids.count(0), 'sdo': sum(i in (0x620, 0x5A0) for i in ids), 'sync': syncs,
                       'heartbeat': ids.count(0x720), 'tpdo': tpdos}
    assert sum(counted.values()) == len(ids)


def test_ring_session_has_the_bits_of_each_sweep():
    """The test decodes the log without the code under test.

    The TPDO of row r holds the 64 taxels of that row, and bit 0 is the first taxel.
    """
    frames, _ = play(RING, nus_pad())
    stamps, sweeps = [], []
    for line in read_candump(RING.name):
        if line.can_id == 0x080:
            stamps.append(line.stamp)
            sweeps.append({})
        elif 0x180 < line.can_id < 0x500:
            sweeps[-1][line.can_id] = int.from_bytes(line.data, 'little')
    assert [frame.stamp for _, frame in frames] == pytest.approx(stamps, abs=1e-6)
    assert [frame.sequence for _, frame in frames] == list(range(len(stamps)))
    for (_, frame), sweep in zip(frames, sweeps, strict=True):
        rows = [row for _, row in sorted(sweep.items())]
        np.testing.assert_array_equal(frame.values, [[row >> bit & 1 for bit in range(64)] for row in rows])


def test_ring_session_shows_the_ring():
    """The README of the recording states that a ring is visible while it is pressed.

    After the release, 9 to 29 taxels remain on.
    """
    frames, _ = play(RING, nus_pad())
    stamps = np.array([frame.stamp for _, frame in frames])
    values = np.array([frame.values for _, frame in frames])
    # The ring is pressed from 12.3 s to 20.1 s. The first frame is at 4.3 s, so the frame 15 s later shows the ring.
    held = values[stamps - stamps[0] < 15][-1]
    row, col = np.nonzero(held)
    centre, radius = (row.mean(), col.mean()), np.hypot(row - row.mean(), col - col.mean())
    assert held.sum() > 50 and set(np.unique(values)) == {0.0, 1.0}
    # A pressed ring does not touch the centre of the contact.
    assert held[round(centre[0]), round(centre[1])] == 0 and np.median(radius) > 4
    assert values[0].sum() == 0 and values[-1].sum() < 30
    assert (np.diff(stamps) > 0).all() and abs(stamps[-1] - stamps[0] - (24.755 - 4.313)) < 1e-5


SYNC, ROWS = '(1.0) can0 080#', ('(1.1) can0 181#0A0B', '(1.2) can0 281#0A0A', '(1.3) can0 381#0A0A')


def tiny_log(folder, *lines, name='x.log'):
    path = folder / name
    path.write_text('\n'.join(lines) + '\n')
    return path


def write_database(path, messages):
    """Write a database (.db) with python-can, whose writer discards its queued messages when it is stopped."""
    writer = can.Logger(str(path))
    for message in messages:
        writer.on_message_received(message)
    until(lambda: writer.num_frames == len(messages))
    writer.stop()
    return path


def tiny_pads(folder):
    return (PadSettings('pad', (1,), tiny_layout(folder)),)


def test_oddities_of_a_log_are_counted_by_service(tmp_path):
    log = tiny_log(tmp_path, '(0.1) can0 181#0A0A', SYNC, ROWS[0], '(1.1) can0 00000181#0F0F',
                   '(1.1) can0 281#R',
                   '(1.1) can0 20000080#', '(1.1) can0 081#', '(1.1) can0 281##00A0B', ROWS[1], ROWS[2],
                   '(1.4) can0 555#01', '(1.5) can0 100#01')
    frames, source = play(log, tiny_pads(tmp_path))
    assert len(frames) == 1 and frames[0][1].values[0].tolist() == [0, 2]
    assert source.facts().can_frames == {'tpdo': 4, 'sync': 1, 'foreign': 3, 'remote': 1, 'error': 1,
                                              'emcy': 1,
                                              'time': 1}
    assert source.facts().pad('pad').losses[LossReason.BEFORE_FIRST_SYNC] == 1


def test_a_compressed_log_cut_short_is_read_up_to_the_cut_and_reported(tmp_path):
    whole, cut, random = tmp_path / 'x.log.gz', tmp_path / 'cut.log.gz', np.random.default_rng(3)
    writer = can.Logger(str(whole))
    for n in range(500):
        writer.on_message_received(can.Message(1.7e9 + n, 0x181, False, data=random.bytes(8), channel=1))
    writer.stop()
    complete = CanLogReader(whole)
    messages = [bytes(message.data) for message in complete]
    assert len(messages) == 500 and not complete.unread
    cut.write_bytes(whole.read_bytes()[:int(0.62 * whole.stat().st_size) + 5])
    reader = CanLogReader(cut)
    found = [bytes(message.data) for message in reader]
    assert found == messages[:len(found)] and 200 < len(found) < 400
    assert reader.unread == 1 and f'{len(found)} CAN frames, the last at 2023-11-14 2' in reader.summary
    assert 'end-of-stream' in reader.summary


def test_a_line_cut_short_never_reads_as_another_frame(tmp_path):
    """Without its last digit, 381#0A0C would be read as 381#0A00, a complete TPDO with a wrong value."""
    log = tmp_path / 'x.log'
    log.write_text('\n'.join([SYNC, *ROWS[:2], '(1.3) can0 381#0A0C'])[:-1])
    frames, source = play(log, tiny_pads(tmp_path))
    assert [f.missing_can_frames for _, f in frames] == [1] and np.isnan(frames[0][1].values[2]).all()
    assert source.facts().unread_log_lines == 1


@pytest.mark.parametrize(('name', 'content'), [
    ('empty.log', b''), ('prose.log', b'This is no log.\nNor is this.\n'), ('x.pdf', b'abc'),
    ('bin.log', bytes(range(256))),
    ('no.log.gz', b'not gzip'), ('x.blf', b'LOGG'), ('x.asc', b''), ('x.trc', b'nonsense\n'), ('x.mcap', b''),
    ('x.mcap', b'\x89MCAP0\r\n' + bytes(50)), ('x.db3', b''), ('x.db3', b'SQLite format 3\0' + bytes(200))])
def test_a_log_without_can_frames_is_an_error(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(LogError, match=name):
        LogSource(str(tmp_path / name), tiny_pads(tmp_path), lambda *_: None).open()


def test_missing_log(tmp_path):
    with pytest.raises(LogError, match='no such file'):
        LogSource(str(tmp_path / 'none.log'), tiny_pads(tmp_path), lambda *_: None).open()


@pytest.mark.parametrize('suffix', ['.log', '.log.gz', '.mcap'])
def test_a_written_log_can_be_read(tmp_path, suffix):
    path = tmp_path / f'x{suffix}'
    writer = CanLogWriter(path)
    sent = [(0x181, b'\x0A\x0B', 1.7e9), (0x080, b'', 1.7e9 + 0.5), (0x7FF, bytes(range(8)), 1.7e9 + 1)]
    for can_id, data, stamp in sent:
        writer.write(can.Message(stamp, can_id, False, data=data, channel=1))
    writer.close()
    writer.write(can.Message())  # Writing a message after closing raises no error.
    read = [(m.arbitration_id, bytes(m.data), m.timestamp) for m in CanLogReader(path)]
    assert read == sent and writer.can_frames == 3


@pytest.mark.parametrize('suffix', ['.asc', '.asc.gz', '.blf', '.csv', '.trc', '.db'])
def test_the_command_in_the_refusal_converts_to_a_format_that_cannot_be_written(tmp_path, monkeypatch, suffix):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(LogError) as refused:
        CanLogWriter(f'x{suffix}')
    assert not list(tmp_path.iterdir())
    writer = CanLogWriter('x.log')
    for stamp in (1.7e9 + 0.25, 1.7e9 + 0.5):
        writer.write(can.Message(stamp, 0x181, False, data=b'AB', channel=1))
    writer.close()
    *_, module, source, target = refused.value.remedy.rstrip('.').split()
    subprocess.run([sys.executable, '-m', module, source, target], check=True, timeout=60)
    read = [(m.arbitration_id, bytes(m.data), m.timestamp - 1.7e9) for m in CanLogReader(f'x{suffix}')]
    # ASC and TRC files store time stamps in milliseconds.
    assert read == [(0x181, b'AB', pytest.approx(at, abs=1.1e-3)) for at in (0.25, 0.5)]


@pytest.mark.parametrize(('suffix', 'kept'), [('.mcap', 3), ('.log', 4)])
def test_messages_that_a_format_cannot_hold_are_counted(tmp_path, suffix, kept):
    path = tmp_path / f'x{suffix}'
    writer = CanLogWriter(path)
    for kind in ({'is_remote_frame': True}, {'is_error_frame': True}, {'is_fd': True}, {}):
        writer.write(can.Message(1.7e9, 0x181, False, channel=1, **kind))
    writer.close()
    assert (writer.can_frames, writer.unwritten) == (kept, 4 - kept) and len(list(CanLogReader(path))) == kept


def test_pace_stop_and_start_lose_nothing(tmp_path):
    """The log covers 0.3 s and is played at ten times its speed.

    The callback on_frame stops the log, which is then started again.
    """
    lines = [f'({k / 100 + i / 1000}) can0 {can_id}#{"" if i == 0 else "0A0A"}'
             for k in range(30) for i, can_id in enumerate(('080', '181', '281', '381'))]
    stamps, stopped = [], threading.Event()

    def on_frame(_name, frame):
        stamps.append(frame.stamp)
        if len(stamps) == 10:
            source.stop()
            stopped.set()

    source = LogSource(str(tiny_log(tmp_path, *lines)), tiny_pads(tmp_path), on_frame, pace=10)
    source.open()
    source.start()
    assert stopped.wait(60)
    for thread in threading.enumerate():
        if thread.name == 'replay':
            thread.join(60)
    assert len(stamps) == 10 and not source.finished.is_set()
    source.start()
    assert source.finished.wait(60)
    source.close()
    np.testing.assert_allclose(stamps, np.arange(30) / 100)


TWO_BUSES = ('(1.0) can0 080#', '(1.0) can1 080#', '(1.1) can0 181#0A0A', '(1.1) can1 181#1414', '(1.2) can0 281#0A0A',
             '(1.2) can0 381#0A0A', '(1.2) can1 281#1414', '(1.2) can1 381#1414')


def test_a_log_of_two_buses_with_the_same_pad_is_refused_until_one_is_named(tmp_path):
    log, pads = tiny_log(tmp_path, *TWO_BUSES), tiny_pads(tmp_path)
    frames, source = play(log, pads)
    assert source.failure.fault is BusFault.LOG_UNUSABLE
    assert all(part in source.failure.detail for part in ('0x080', 'can0 and on can1', 'replay_channel'))
    assert not any(np.isfinite(frame.values[1:]).any() for _, frame in frames)
    for channel, value in (('can0', 0.0), ('can1', 20.0)):
        (_, frame), = play(log, pads, channel=channel)[0]
        assert (frame.values == value).all()
    with pytest.raises(LogError, match='none of channel .can7., but of can0, can1'):
        LogSource(str(log), pads, lambda *_: None, channel='can7').open()


def of_buses(*names):
    """Return the lines of a whole sweep, with the SYNC first.

    Each entry of ``names`` gives a channel, followed by T for a frame that the recorder sent or R for a received frame.
    """
    return [f'(1.{n}) {name.split()[0]} {frame} {name.split()[1]}'
            for n, (name, frame) in enumerate(zip(names, ('080#', '181#0A0A', '281#0A0A', '381#0A0A')))]


@pytest.mark.parametrize('sync', ['can1 R', 'can1 T'])
def test_sync_of_another_bus_never_ends_a_sweep(tmp_path, sync):
    """Received frames show that the log contains a second bus, even if they are TPDOs of other nodes."""
    lines = ['(0.5) can1 3FF#01 R', *of_buses(sync, *3 * ['can0 R'])]
    frames, source = play(tiny_log(tmp_path, *lines), tiny_pads(tmp_path))
    assert source.failure.fault is BusFault.LOG_UNUSABLE and 'can1 and on can0' in source.failure.detail
    assert not any(np.isfinite(frame.values).any() for _, frame in frames)


def test_tpdos_of_one_pad_on_two_buses_are_refused(tmp_path):
    frames, source = play(tiny_log(tmp_path, *of_buses('can0 R', 'can0 R', 'can0 R', 'can1 R')), tiny_pads(tmp_path))
    assert source.failure.fault is BusFault.LOG_UNUSABLE and '0x381' in source.failure.detail
    assert not any(np.isfinite(frame.values[2]).any() for _, frame in frames)


@pytest.mark.parametrize('channel', ['', 'can0'])
def test_a_frame_sent_without_the_name_of_its_bus_belongs_to_the_log_s_first(tmp_path, channel):
    """Earlier versions of this package recorded SYNC in this form. python-can writes vcan0 instead of the name."""
    (_, frame), = play(tiny_log(tmp_path, *of_buses('vcan0 T', *3 * ['can0 R'])), tiny_pads(tmp_path),
                       channel=channel)[0]
    assert not frame.missing_can_frames


@pytest.mark.parametrize(('channel', 'name'), [('can0', 'can0'), ('/dev/serial/by-id/my adapter', 'my_adapter')])
def test_messages_without_a_bus_name_are_recorded_with_the_name_of_the_bus(tmp_path, channel, name):
    writer = CanLogWriter(tmp_path / 'x.log', channel)
    writer.write(can.Message(1.0, 0x080, False, is_rx=False))
    writer.write(can.Message(1.1, 0x181, False, data=b'A', channel='can7'))
    writer.close()
    assert (tmp_path / 'x.log').read_text() == f'(1.000000) {name} 080# T\n(1.100000) can7 181#41 R\n'


@pytest.mark.parametrize('damaged', ['9000000001.1', '0.1'])
def test_a_damaged_stamp_costs_its_own_can_frame_alone(tmp_path, damaged):
    lines = [f'({1e9 + k + i / 10}) can0 {can_id}#{"" if i == 0 else "0A0A"}'
             for k in range(3) for i, can_id in enumerate(('080', '181', '281', '381'))]
    lines[5] = f'({damaged}) can0 181#0A0A'
    frames, source = play(tiny_log(tmp_path, *lines), tiny_pads(tmp_path))
    assert [frame.stamp for _, frame in frames] == [1e9, 1e9 + 1, 1e9 + 2]
    assert [frame.missing_can_frames for _, frame in frames] == [0, 1, 0]
    assert source.facts().unread_log_lines == 1 and source.facts().clock_jumps == 0 and damaged in source.reader.summary


def test_a_gap_is_reported_and_not_waited_for(tmp_path, caplog):
    """During the recording, either the clock was set forward by an hour, or no SYNC was sent for an hour."""
    caplog.set_level(logging.INFO, 'tactile_node')
    lines = [f'({stamp + i / 1000}) can0 {can_id}#{"" if i == 0 else "0A0A"}'
             for stamp in (1.0, 1.1, 3601.2, 3601.3) for i, can_id in enumerate(('080', '181', '281', '381'))]
    frames, source = play(tiny_log(tmp_path, *lines), tiny_pads(tmp_path), pace=1.0)
    assert [frame.stamp for _, frame in frames] == [1.0, 1.1, 3601.2, 3601.3]
    assert any('gap of 3600.1 s' in sentence for sentence in caplog.messages)


def test_consumer_that_fails_is_counted(tmp_path, caplog):
    source = LogSource(str(tiny_log(tmp_path, SYNC, *ROWS)), tiny_pads(tmp_path), lambda *_: 1 / 0, pace=None)
    source.open()
    source.start()
    assert source.finished.wait(60)
    source.close()
    assert source.facts().consumer_errors == 1 and 'division by zero' in caplog.text


def test_a_failed_replay_reports_the_failure_and_counts_as_finished(tmp_path, caplog):
    source = LogSource(str(tiny_log(tmp_path, SYNC, *ROWS)), tiny_pads(tmp_path), lambda *_: None, pace=None)
    source._router.end = lambda: 1 / 0
    source.open()
    source.start()
    assert source.finished.wait(60)
    source.close()
    assert source.failure.fault is BusFault.INTERNAL_ERROR and 'ZeroDivisionError' in source.failure.detail
    assert 'Traceback' in caplog.text


def two_skins(tmp_path, heartbeat):
    """Write a log of nodes 32 and 40, in which the nodes in ``heartbeat`` send heartbeats.

    The layout has eight TPDOs in each range of COB-IDs.
    """
    lines = []
    for k in range(3):
        lines.append(f'(1.{k}00000) can0 080#')
        lines += [f'(1.{k}00100) can0 {0x180 + 0x100 * (n // 8) + n % 8 + node:03X}#{node:02X}000000000000'
                  + '00' for node in (32, 40) for n in range(32)]
        lines += [f'(1.{k}00200) can0 {0x700 + node:03X}#05' for node in heartbeat]
    path = tmp_path / 'two.log'
    path.write_text('\n'.join(lines) + '\n')
    return path


@pytest.mark.parametrize(('node_id', 'got', 'remedy'), [
    (1, '3 TPDOs', '"map"'), (2, 'no TPDO', '--node-id')])
def test_a_pad_without_taxels_is_distinguished_from_a_pad_missing_in_the_log(tmp_path, node_id, got, remedy, capsys):
    short = [row[:-2] for row in ROWS]
    tiny_layout(tmp_path)
    log, words = str(tiny_log(tmp_path, SYNC, *short)), ['--layout', str(tmp_path / 'layout.yaml'), '--node-id']
    assert main(['replay', log, *words, str(node_id)]) == 1
    said = capsys.readouterr().err
    assert f"pad 'pad{node_id}'" in said and got in said and remedy in said


def test_a_replay_names_the_order_of_a_device_that_is_not_the_layout_s(tmp_path, caplog):
    sweeps = [line for number in range(3) for line in (SYNC, ROWS[1], ROWS[0], ROWS[2])]
    frames, source = play(tiny_log(tmp_path, *sweeps), tiny_pads(tmp_path))
    assert [frame.missing_can_frames for _, frame in frames] and source.facts().pad('pad').frames_complete == 0
    order = TpdoOrder(1, ('2', '1', '3'), ('1', '2', '3'))
    said, = [record for record in caplog.records if getattr(record, 'fact', None) == order]
    assert 'order 2, 1, 3' in said.getMessage() and '1, 2, 3' in said.getMessage() and 'Node 1' in said.getMessage()


@pytest.mark.parametrize('node_id, heartbeat, code, is_reported', [
    (36, (32, 40), 1, True), (32, (32, 40), 0, False), (36, (), 1, False), (32, (50,), 0, False)])
def test_a_pad_put_together_from_two_others_is_reported(tmp_path, node_id, heartbeat, code, is_reported, caplog):
    """No frame of this pad is lost, but its TPDOs arrive in another order, so none of its taxels are published."""
    path = two_skins(tmp_path, heartbeat)
    assert main(['replay', str(path), '--node-id', str(node_id)]) == code
    assert ('Check the node-IDs' in caplog.text) == is_reported
    assert ('it sends its TPDOs in the order' in caplog.text) == (node_id == 36)


@pytest.mark.parametrize('name', ['X.LOG', 'x.log', 'x', 'x.gz', 'x.txt', 'x.LOG.GZ'])
@pytest.mark.parametrize('is_gzip', [False, True])
def test_candumps_text_is_read_under_any_name(tmp_path, name, is_gzip):
    text = b'(1.000000) can0 080#\n(1.100000) can0 181#0A0B\n'
    (tmp_path / name).write_bytes(gzip.compress(text) if is_gzip else text)
    reader = CanLogReader(tmp_path / name)
    assert [message.arbitration_id for message in reader] == [0x080, 0x181] and not reader.unread


@pytest.mark.parametrize('line', ['  can0  181   [2]  0A 0B', ' (1.000000)  can0  181   [2]  0A 0B',
                                  ' (2026-11-22 10:00:00.000000)  can0  181   [2]  0A 0B'])
def test_the_terminal_output_of_candump_is_refused_with_the_remedy(tmp_path, line):
    (tmp_path / 'x.log').write_text(3 * (line + '\n'))
    with pytest.raises(LogError, match='candump -L'):
        list(CanLogReader(tmp_path / 'x.log'))


@pytest.mark.parametrize('name', ['x.txt', 'x', 'x.log.zip', 'x.pdf', '.', '/', 'nowhere/x.log'])
def test_a_recording_that_could_not_be_replayed_is_refused(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(LogError, match='a log file that can be written'):
        CanLogWriter(name)
    assert not list(tmp_path.iterdir())


def test_a_recording_that_cannot_begin_leaves_no_empty_file(tmp_path, monkeypatch):
    monkeypatch.setattr(can, 'Logger', lambda path: (_ for _ in ()).throw(ImportError('no writer')))
    with pytest.raises(LogError, match='no writer'):
        CanLogWriter(tmp_path / 'x.log')
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize('suffix', ['.log', '.mcap', '.log.gz'])
def test_recordings_that_begin_together_have_a_file_each(tmp_path, suffix):
    """In an earlier version, two recordings could both find the same file name free and write to the same file."""
    begin, writers = threading.Barrier(8), []

    def record():
        begin.wait(60)
        writers.append(CanLogWriter(tmp_path / f'x{suffix}'))
    threads = [threading.Thread(target=record) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    for writer in writers:
        writer.close()
    assert len({writer.path for writer in writers}) == 8
