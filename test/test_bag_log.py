"""Tests for CAN frames in ROS 2 bags.

Other libraries must read our bags, and our reader must read their bags.
"""

import sqlite3
from concurrent.futures import ThreadPoolExecutor

import can
import numpy as np
import pytest
from test_logs import write_database
from test_topic_bag import bag as topic_bag

from tactile_node.errors import LogError
from tactile_node.logs.bag_log import CAN_TYPE
from tactile_node.logs.log_reader import CanLogReader
from tactile_node.logs.log_writer import CanLogWriter

mcap = pytest.importorskip('mcap.reader')
typesys = pytest.importorskip('rosbags.typesys')

FRAME = '''std_msgs/Header header
uint32 id
bool is_rtr
bool is_extended
bool is_error
uint8 dlc
uint8[8] data'''
SENT = [can.Message(1.7e9, 0x181, False, data=b'\x0A\x0B', channel='can0'), can.Message(1.7e9 + 0.25, 0x80, False),
        can.Message(1.7e9 + 0.5, 0x1ABCDEF, True, data=bytes(range(8))),
        can.Message(1.7e9 + 0.75, 0x181, False, is_remote_frame=True, dlc=2),
        can.Message(1.7e9 + 1, 0x040, False, is_error_frame=True, dlc=8, data=bytes(8))]


def written(path, messages=SENT):
    writer = CanLogWriter(path)
    for message in messages:
        writer.write(message)
    writer.close()
    return path


def store():
    types = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    types.register(typesys.get_types_from_msg(FRAME, CAN_TYPE))
    return types


def bag(folder, plugin, topics=(('/from_can_bus', CAN_TYPE),), stamped=True, compressed=False):
    """Write a rosbag2 bag with an independent library.

    Each topic carries the data frames of SENT at intervals of 0.25 s.
    """
    types, messages = store(), []
    kinds = types.types
    for topic, kind in topics:
        for message in SENT[:3]:
            stamp = kinds['builtin_interfaces/msg/Time'](*divmod(round(message.timestamp * 4) * 10**9 // 4 * stamped,
                                                                 10**9))
            header = kinds['std_msgs/msg/Header'](stamp, 'can0')
            messages.append((topic, header if kind != CAN_TYPE else kinds[CAN_TYPE](
                header=header, id=message.arbitration_id, is_rtr=False, is_extended=message.is_extended_id,
                is_error=False, dlc=message.dlc, data=np.frombuffer(bytes(message.data).ljust(8, b'\0'), np.uint8))))
    return topic_bag(folder, messages, plugin, types, topics, compressed, lambda k: SENT[k % 3].timestamp)


def content_of(messages):
    return [(m.timestamp, m.arbitration_id, m.is_extended_id, m.is_remote_frame, m.is_error_frame, m.dlc,
             bytes(m.data)) for m in messages]


def test_every_kind_of_frame_comes_back(tmp_path):
    assert content_of(CanLogReader(written(tmp_path / 'x.mcap'))) == content_of(SENT)


def test_other_libraries_read_our_bags(tmp_path):
    """The indexed reader of the MCAP library must be able to read our file.

    The test takes the message type only from the schema in the file.
    """
    with written(tmp_path / 'x.mcap').open('rb') as file:
        reader = mcap.make_reader(file)
        assert reader.get_header().profile == 'ros2' and reader.get_summary().statistics.message_count == 5
        schemas, channels, records = zip(*reader.iter_messages())
    schema, channel = schemas[0], channels[0]
    assert (schema.name, schema.encoding, channel.message_encoding) == (CAN_TYPE, 'ros2msg', 'cdr')
    types = typesys.get_typestore(typesys.Stores.EMPTY)
    types.register(typesys.get_types_from_msg(schema.data.decode(), schema.name))
    first = types.deserialize_cdr(records[0].data, CAN_TYPE)
    assert (first.id, first.dlc, first.data[:2].tolist(), first.header.frame_id) == (0x181, 2, [10, 11], 'can0')
    assert records[1].log_time == 1_700_000_000_250_000_000


@pytest.mark.parametrize('compressed', [False, True])
@pytest.mark.parametrize('plugin', ['MCAP', 'SQLITE3'])
def test_bags_of_rosbag2_are_read_by_folder_and_by_file(tmp_path, plugin, compressed):
    folder = bag(tmp_path / 'bag', plugin, compressed=compressed)
    file, = (file for file in folder.iterdir() if file.suffix in ('.mcap', '.db3'))
    assert content_of(CanLogReader(folder)) == content_of(CanLogReader(file)) == content_of(SENT[:3])


def test_paths_may_hold_what_has_a_meaning_in_an_uri(tmp_path):
    folder = bag(tmp_path / 'bag', 'SQLITE3').rename(tmp_path / 'run #3 ?%20&mode=rw')
    assert content_of(CanLogReader(folder)) == content_of(SENT[:3])


def test_without_stamps_the_time_of_recording_counts(tmp_path):
    folder = bag(tmp_path / 'bag', 'MCAP', stamped=False)
    assert [message.timestamp for message in CanLogReader(folder)] == [m.timestamp for m in SENT[:3]]


def test_one_bus_in_a_bag_of_two_buses_is_named_by_its_topic(tmp_path):
    folder = bag(tmp_path / 'bag', 'MCAP', (('/left/can', CAN_TYPE), ('/right/can', CAN_TYPE)))
    assert len(list(CanLogReader(folder))) == 6
    assert content_of(CanLogReader(folder, '/left/can')) == content_of(SENT[:3])


@pytest.mark.parametrize('plugin', ['MCAP', 'SQLITE3'])
def test_a_bag_without_can_frames_is_reported_by_its_topics(tmp_path, plugin):
    folder = bag(tmp_path / 'bag', plugin, (('/odom', 'std_msgs/msg/Header'),))
    with pytest.raises(LogError, match='/odom .std_msgs/msg/Header.'):
        list(CanLogReader(folder))
    with pytest.raises(LogError, match='.mcap or .db3'):
        list(CanLogReader(tmp_path))


def of_sqlite(folder, name):
    """Write the first three messages of SENT as an SQLite bag or as a python-can SQLite log (.db)."""
    return bag(folder / name, 'SQLITE3') if name == 'bag' else write_database(folder / name, SENT[:3])


@pytest.mark.parametrize('damage', ["timestamp = 'x'", 'topic_id = 99', 'data = 8'])
def test_a_damaged_row_of_a_bag_costs_its_own_frame(tmp_path, damage):
    file = next(bag(tmp_path / 'bag', 'SQLITE3').glob('*.db3'))
    with sqlite3.connect(file) as base:
        first, = base.execute('SELECT min(id) FROM messages').fetchone()
        base.execute(f'UPDATE messages SET {damage} WHERE id = {first + 1}')
    base.close()
    reader = CanLogReader(file)
    assert content_of(reader) == content_of([SENT[0], SENT[2]]) and reader.unread == 1


@pytest.fixture
def other_threads():
    """Yield two threads that live as long as the test.

    If one thread ended earlier, the next thread could get its identifier.
    """
    with ThreadPoolExecutor(1) as one, ThreadPoolExecutor(1) as another:
        yield one, another


@pytest.mark.parametrize('name', ['bag', 'x.db'])
def test_each_frame_of_a_log_in_sqlite_may_be_read_by_another_thread(tmp_path, name, other_threads):
    """One thread opens a log, and other threads play, pause, resume and close it.

    SQLite allows a connection to be used only in the thread that opened it.
    """
    reader = CanLogReader(of_sqlite(tmp_path, name))
    messages = iter(reader)
    found = [next(messages), *(thread.submit(next, messages).result() for thread in other_threads)]
    assert content_of(found) == content_of(SENT[:3])
    assert next(messages, None) is None and not reader.unread, reader.problem


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('name', ['bag', 'x.db'])
def test_a_log_in_sqlite_may_be_left_by_another_thread(tmp_path, name, other_threads):
    reader = CanLogReader(of_sqlite(tmp_path, name))
    messages = iter(reader)
    next(messages)
    other_threads[0].submit(messages.close).result()
    assert not reader.unread, reader.problem
