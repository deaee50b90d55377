"""Long recordings: several files are read as one recording, starting at any time.

If a chunk is damaged, only its own frames are lost.

A damaged file must not give a reader a wrong value. After damage, the reader must not report the rest of the hour as
lost, nor mistake the gap for a skin at rest. One file of ten must not be read as the whole recording, nor two
recordings as one.
"""

import os
import struct
from threading import Event

import can
import numpy as np
import pytest
from mcap_bytes import DATA_END, MESSAGE_INDEX, chunks, payload, records
from numbered_frames import numbered
from test_can_commands import run
from test_logs import play
from test_recording_files import numbers
from test_report_page import check_alone, reported
from test_topic_bag import TAXELS, frames_in, mcap_file, store, taxel_array

from tactile_node.cli import replay
from tactile_node.errors import ConfigurationError, LogError
from tactile_node.logs.bag_records import records_of
from tactile_node.logs.damage import DamageKind
from tactile_node.logs.log_reader import CanLogReader
from tactile_node.logs.log_writer import LogFile
from tactile_node.logs.replay_times import TimeWindow
from tactile_node.logs.topic_bag import TopicBagReader
from tactile_node.skin.layout_file import load_layout
from tactile_node.skin.pads import PadSettings
from tactile_node.taxel_frame import TaxelStatus
from tactile_node.viewing.recordings import BagRecording
from tactile_node.viewing.report_page import page_of
from tactile_node.viewing.timeline import Timeline

mcap = pytest.importorskip('mcap.writer')
rosbags = pytest.importorskip('rosbags.rosbag2')

FRAMES = 500  #: Number of CAN frames, which are 1 ms apart and start at the stamp 1.7e9 s.
EACH = 50     #: Number of CAN frames in a chunk.
BEGIN = 1.7e9


def can_log(path, frames=range(FRAMES)):
    path.touch()
    file, all_of_them = LogFile(path), numbered(FRAMES)
    for n in frames:
        file.write(all_of_them[n])
        if n % EACH == EACH - 1:
            file.flush()
    file.close()
    return path


def topic_bag(path, count=60, each=10, compression=mcap.CompressionType.LZ4):
    """Write taxel arrays at intervals of one second, with checksums."""
    mcap_file(path, [taxel_array(store(), n) for n in range(count)], each=each, compression=compression)
    return path


def without(*lost, count=FRAMES, each=EACH):
    return [n for n in range(count) if n // each not in lost]


def flipped(data, index):
    chunk = chunks(data)[index]
    at = (payload(chunk, data) + chunk.end) // 2
    return data[:at] + bytes([data[at] ^ 0x10]) + data[at + 1:]


def zeroed(data, begin, end):
    return data[:begin] + bytes(end - begin) + data[end:]


def with_bytes(data, at, new):
    return data[:at] + new + data[at + len(new):]


#: Kinds of damage to a file with ten chunks, and the numbers of the chunks that each kind may destroy.
DAMAGES = {
    'a bit of the content': (lambda data, at: flipped(data, 4), {4}),
    'bits in two places': (lambda data, at: flipped(flipped(data, 4), 7), {4, 7}),
    'a block of zeros over the end of one and the begin of the next': (
        lambda data, at: zeroed(data, at[4].end - 100, at[5].content + 60), {4, 5}),
    'a block of zeros over all of one': (lambda data, at: zeroed(data, at[4].begin, at[4].end), {4}),
    'its opcode': (lambda data, at: with_bytes(data, at[4].begin, b'\x86'), set()),
    'its length, by far': (lambda data, at: with_bytes(data, at[4].begin + 6, b'\xff'), {4}),
    'its length, by little': (lambda data, at: with_bytes(data, at[4].begin + 1, b'\x01'), {4}),
    'the name of its compression': (lambda data, at: with_bytes(data, at[4].content + 32, b'x'), {4}),
    'its checksum': (lambda data, at: with_bytes(data, at[4].content + 24, b'\1\2\3\4'), {4}),
    'its size': (lambda data, at: with_bytes(data, at[4].content + 16, b'\xff' * 8), {4}),
    'its times': (lambda data, at: zeroed(data, at[4].content, at[4].content + 16), set()),
    'the length of the index after it': (
        lambda data, at: with_bytes(data, at[4].end + 1, struct.pack('<Q', at[7].content + 20 - at[4].end - 9)), set()),
    'the first, with the types': (lambda data, at: flipped(data, 0), {0}),
    'the last and the end of the data': (
        lambda data, at: zeroed(data, at[9].begin, next(r for r in records(data) if r.opcode == DATA_END).end), {9}),
    'the magic': (lambda data, at: zeroed(data, 0, 8), set()),
    'the summary': (lambda data, at: flipped_summary(data), set()),
}


def flipped_summary(data):
    at = next(record for record in records(data) if record.opcode == DATA_END).end + 40
    return zeroed(data, at, at + 30)


@pytest.mark.parametrize('name', DAMAGES)
def test_damage_costs_the_can_frames_of_its_chunk_alone(tmp_path, name):
    path = can_log(tmp_path / 'x.mcap')
    data = path.read_bytes()
    damage, lost = DAMAGES[name]
    assert len(chunks(data)) == FRAMES // EACH
    path.write_bytes(damage(data, chunks(data)))
    assert path.read_bytes() != data
    reader, all_of_them = CanLogReader(path), numbered(FRAMES)
    assert [bytes(message.data) for message in reader] == [bytes(all_of_them[n].data) for n in without(*lost)]
    runs = [index for index in lost if index - 1 not in lost]
    assert len(reader.damages) == reader.unread == len(runs)
    assert all(each.kind in (DamageKind.CHUNK, DamageKind.RECORDS) for each in reader.damages)
    assert sum(each.chunks for each in reader.damages) == len(lost)
    # The damage lies between the stamps of the frames before and after it.
    for each, first in zip(reader.damages, sorted(runs)):
        last = next(index for index in range(first, 11) if index not in lost)
        assert each.begin == (pytest.approx(BEGIN + (first * EACH - 1) / 1000, abs=1e-5) if first else None)
        assert each.end == (pytest.approx(BEGIN + last * EACH / 1000, abs=1e-5) if last < 10 else None)


@pytest.mark.parametrize('compression', list(mcap.CompressionType))
def test_damage_costs_the_taxel_frames_of_its_chunk_alone(tmp_path, compression):
    path = topic_bag(tmp_path / 'x.mcap', compression=compression)
    path.write_bytes(flipped(path.read_bytes(), 3))
    reader = TopicBagReader(path)
    assert [each.sequence for each in frames_in(reader)] == without(3, count=60, each=10)
    assert reader.unread == 1
    damage, = reader.damages
    assert (damage.kind, damage.chunks, damage.begin, damage.end) == (DamageKind.CHUNK, 1, BEGIN + 29, BEGIN + 40)
    report = reported(path)
    assert report.recording.damages == (damage,) and report.recording.unread == 1
    assert any('11.000 s' in text for text in check_alone(page_of(report)).texts)
    timeline = Timeline()
    recording = BagRecording(str(path))
    recording.read(timeline, Event())
    assert recording.problem and (timeline.begin, timeline.end) == (BEGIN + 0.25, BEGIN + 59.25) and timeline.index(
        'left', BEGIN + 59.5) == 49
    timeline.close()


@pytest.mark.parametrize('share', [0.3, 0.62, 0.95])
def test_the_chunks_before_a_missing_end_are_read(tmp_path, share):
    path = can_log(tmp_path / 'x.mcap')
    data, at = path.read_bytes(), chunks(path.read_bytes())
    cut = int(share * at[-1].end)
    # The first chunk is damaged, too. The types are stored only at the beginning of the file.
    path.write_bytes(flipped(data, 0)[:cut])
    whole = [n for n, chunk in enumerate(at) if chunk.end <= cut and n]
    assert whole
    reader = CanLogReader(path)
    assert [int.from_bytes(m.data[:4], 'little') for m in reader] == without(0, *range(whole[-1] + 1, 10))
    first, last = reader.damages
    assert first.kind is DamageKind.CHUNK and last.kind is DamageKind.CUT_SHORT and last.end is None


@pytest.mark.parametrize('name', [name for name in DAMAGES if not name.startswith(('the last', 'the magic', 'the su'))])
def test_damage_to_a_killed_recording_costs_its_chunk_alone(tmp_path, name):
    """A recording whose recorder was killed has no index of its chunks."""
    path = can_log(tmp_path / 'x.mcap')
    data, (damage, lost) = path.read_bytes(), DAMAGES[name]
    path.write_bytes(damage(data, chunks(data))[:chunks(data)[-1].end])
    reader, all_of_them = CanLogReader(path), numbered(FRAMES)
    assert [bytes(message.data) for message in reader] == [bytes(all_of_them[n].data) for n in without(*lost)]
    assert reader.damages[-1].kind is DamageKind.CUT_SHORT and len(reader.damages) > bool(lost)


def test_a_part_of_another_recorders_killed_recording_is_read(tmp_path):
    """Only the first chunk, which lies before the requested part, contains the types of the recording."""
    path = topic_bag(tmp_path / 'x.mcap')
    path.write_bytes(path.read_bytes()[:chunks(path.read_bytes())[-1].end])
    messages = TopicBagReader(path).messages((TAXELS,), window=TimeWindow(17.0, 25.0))
    assert [message.content.sequence for message in messages] == list(range(17, 42))


def series(folder, suffix='.mcap'):
    """Write a series of three files with 500 frames in total."""
    parts = folder / f'x{suffix}', folder / f'x_part2{suffix}', folder / f'x_part3{suffix}'
    for part, frames in zip(parts, (range(200), range(200, 400), range(400, FRAMES))):
        can_log(part, frames)
    return parts


@pytest.mark.parametrize('suffix', ['.mcap', '.log', '.log.gz'])
def test_the_first_file_of_a_series_stands_for_all_any_other_for_itself(tmp_path, suffix):
    first, second, third = series(tmp_path, suffix)
    can_log(tmp_path / f'xy_part2{suffix}')  # This file belongs to another recording.
    assert numbers(first) == list(range(FRAMES))
    assert (numbers(second), numbers(third)) == (list(range(200, 400)), list(range(400, FRAMES)))
    second.unlink()
    reader = CanLogReader(first)
    assert len(list(reader)) == 300 and reader.unread == 1
    damage, = reader.damages
    assert damage.kind is DamageKind.MISSING_FILE and damage.file == second.name
    assert (damage.begin, damage.end) == (pytest.approx(BEGIN + 0.199, abs=1e-5), pytest.approx(BEGIN + 0.4, abs=1e-5))


def test_after_a_damaged_file_of_a_series_the_others_are_read(tmp_path):
    first, second, third = series(tmp_path)
    first.write_bytes(first.read_bytes()[:len(first.read_bytes()) // 2])
    second.write_bytes(b'nothing of it is left')
    reader = CanLogReader(first)
    found = [int.from_bytes(message.data[:4], 'little') for message in reader]
    assert found[-100:] == list(range(400, 500)) and found[:50] == list(range(50)) and max(found[:-100]) < 200
    # One damage entry covers both files, because no frame was read between the two damaged parts.
    damage, = reader.damages
    assert (damage.kind, damage.file) == (DamageKind.CUT_SHORT, 'x.mcap') and damage.end == pytest.approx(BEGIN + 0.4)


def test_a_file_that_a_bags_metadata_name_is_missed(tmp_path):
    for n, frames in enumerate((range(200), range(400, FRAMES))):
        can_log(tmp_path / f'bag_{2 * n}.mcap', frames)
    (tmp_path / 'metadata.yaml').write_text('rosbag2_bagfile_information:\n  relative_file_paths: [bag_0.mcap, '
                                            'bag_1.mcap, bag_2.mcap]\n')
    reader = CanLogReader(tmp_path)
    assert len(list(reader)) == 300
    assert [(each.kind, each.file) for each in reader.damages] == [(DamageKind.MISSING_FILE, 'bag_1.mcap')]


@pytest.mark.parametrize('window', [TimeWindow(), TimeWindow(0.13), TimeWindow(0.13, 0.1), TimeWindow(0.25, 0.3),
                                    TimeWindow(0.45, 9.0)])
@pytest.mark.parametrize('suffix', ['.mcap', '.log'])
def test_a_window_contains_the_same_frames_as_the_whole_recording(tmp_path, suffix, window):
    first, *_ = series(tmp_path, suffix)
    expected = [n for n in range(FRAMES) if window.start <= n / 1000 < window.start + window.duration]
    found = [int.from_bytes(message.data[:4], 'little') for message in CanLogReader(first, window=window)]
    assert found == expected


@pytest.mark.parametrize('is_ended', [True, False])
def test_chunks_before_a_window_are_not_read(tmp_path, is_ended):
    """All chunks before the window are overwritten with zeros, except the first, which contains the beginning."""
    path = can_log(tmp_path / 'x.mcap')
    data, at = path.read_bytes(), chunks(path.read_bytes())
    for chunk in at[1:6]:
        data = zeroed(data, payload(chunk, data), chunk.end)
    path.write_bytes(data if is_ended else data[:at[-1].end])
    reader = CanLogReader(path, window=TimeWindow(0.3295))
    assert [int.from_bytes(m.data[:4], 'little') for m in reader] == list(range(330, FRAMES))
    assert [each.kind for each in reader.damages] == ([] if is_ended else [DamageKind.CUT_SHORT])
    with pytest.raises(LogError, match='--start'):
        list(CanLogReader(path, window=TimeWindow(10.0)))


@pytest.mark.slow
def test_replay_reports_what_is_missing_and_begins_where_it_is_asked_to(tmp_path, capsys):
    """The log contains 3 s of a pad that sends a SYNC and 32 TPDOs 100 times a second.

    One chunk, which holds 0.1 s of data, is damaged.
    """
    path = tmp_path / 'x.mcap'
    path.touch()
    file = LogFile(path)
    for sweep in range(300):
        at = BEGIN + sweep / 100
        file.write(can.Message(at, 0x80, False, channel='can0'))
        for tpdo in range(32):
            base = 0x180 + 0x100 * (tpdo // 8) + tpdo % 8
            file.write(can.Message(at + 1e-4 * (tpdo + 1), base + 32, False, data=bytes([sweep % 200] * 8)))
        if sweep % 10 == 9:
            file.flush()
    file.close()
    path.write_bytes(flipped(path.read_bytes(), 7))
    run(replay, path)
    out = capsys.readouterr()
    assert f'CAN frames: {33 * 290}' in out.out and '0.1' in out.err and 'x.mcap' in out.err
    run(replay, path, '--start', 1, '--duration', 0.5)
    out = capsys.readouterr()
    assert f'CAN frames: {33 * 50}' in out.out and not out.err
    with pytest.raises(ConfigurationError):
        run(replay, path, '--start', 'nan')


@pytest.mark.slow
def test_bytes_beside_the_chunks_may_be_anything(tmp_path):
    """If a bit outside the chunks' content is flipped, either no frame is lost or the damage is reported.

    A flipped bit never changes a frame.
    """
    path, copy = can_log(tmp_path / 'x.mcap'), tmp_path / 'y.mcap'
    data, random = path.read_bytes(), np.random.default_rng(5)
    inside = np.zeros(len(data), bool)
    for chunk in chunks(data):
        inside[payload(chunk, data):chunk.end] = True
    indexes = [record for record in records(data) if record.opcode == MESSAGE_INDEX]
    heads = [at for record in [*chunks(data), *indexes] for at in range(record.begin, record.content)]
    whole = [record.cdr for record in records_of(path, pytest.fail)]
    count = 150 if os.environ.get('TACTILE_LONG') else 60
    for at in [*random.choice(np.flatnonzero(~inside), count), *random.choice(heads, count)]:
        copy.write_bytes(with_bytes(data, at, bytes([data[at] ^ 1 << random.integers(8)])))
        damages = []
        found = [record.cdr for record in records_of(copy, damages.append)]
        lost = sum(each.chunks or 0 for each in damages)
        assert set(found) <= set(whole) and len(found) == FRAMES - EACH * lost, at


@pytest.mark.slow
@pytest.mark.parametrize('is_missing', [False, True])
def test_no_taxel_frame_is_made_of_what_was_before_a_gap_and_what_came_after(tmp_path, is_missing):
    """Chunks and files end in the middle of sweeps.

    Sweep k has the value k in all taxels, so that the test can detect a mixture of sweeps.
    """
    layout, names = load_layout('sim16x16.yaml'), [tmp_path / 'x.mcap', *(tmp_path / f'x_part{n}.mcap' for n in (2, 3))]
    messages = []
    for k in range(100):
        at = BEGIN + k / 100
        messages.append(can.Message(at, 0x80, False, channel='can0'))
        messages += [can.Message(at + 1e-4 * (n + 4), tpdo.cob_id.of(32), False, data=[k] * 8, channel='can0')
                     for n, tpdo in enumerate(layout.tpdos)]
    thirds = [messages] if not is_missing else [messages[:1000], messages[1000:1500], messages[1500:]]
    for name, part in zip(names, thirds):
        name.touch()
        file = LogFile(name)
        for n, message in enumerate(part, 1):
            file.write(message)
            if n % 50 == 0:
                file.flush()
        file.close()
    data = names[0].read_bytes()
    for index in range(2, 60, 7) if not is_missing else ():
        data = flipped(data, index)
    names[0].write_bytes(data)
    if is_missing:
        names[1].unlink()
    frames, source = play(names[0], (PadSettings('left', (32,), layout),))
    assert len(source.reader.damages) == (1 if is_missing else 9) and len(frames) > 70
    for _, frame in frames:
        valid = frame.status == TaxelStatus.VALID
        assert set(np.rint(frame.values[valid] / layout.value.scale)) <= {round((frame.stamp - BEGIN) * 100)}
    assert source.facts().pad('left').frames_complete > 60
