"""Our topics are read without ROS from ROS 2 bags that were written by rosbags or by this test."""

import sqlite3
import struct
from functools import cache
from inspect import signature

import numpy as np
import pytest

from tactile_node.cli.frame_file import read_frames
from tactile_node.cli.main import main
from tactile_node.errors import InputError, LogError
from tactile_node.logs.bag_log import CAN_TYPE
from tactile_node.logs.damage import DamageKind
from tactile_node.logs.topic_bag import (
    DIAGNOSTICS,
    TAXELS,
    TopicBagReader,
    frame_of,
    holds_can_frames,
    holds_taxels,
)
from tactile_node.package_files import package_file
from tactile_node.sources.log_source import UNREAD_EXIT
from tactile_node.taxel_frame import TaxelStatus

rosbags = pytest.importorskip('rosbags.rosbag2')
typesys = pytest.importorskip('rosbags.typesys')
mcap = pytest.importorskip('mcap.writer')

EPOCH = 1_700_000_000
NAN = float('nan')


@cache
def store(**other):
    """Return the types including our messages. ``other`` adds or replaces the text of definitions."""
    types = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    for name in dict.fromkeys(('TaxelArray', 'ContactMotion', 'ContactShape', *other)):
        text = other.get(name) or package_file(f'msg/{name}.msg').read_text(encoding='utf-8')
        types.register(typesys.get_types_from_msg(text, f'tactile_skin/msg/{name}'))
    return types


def taxel_array(types, sequence, **changed):
    kinds = types.types
    stamp = kinds['builtin_interfaces/msg/Time'](EPOCH + sequence, 250_000_000)
    fields = {'header': kinds['std_msgs/msg/Header'](stamp, 'left_pad'), 'sequence': sequence,
              'age': kinds['builtin_interfaces/msg/Duration'](0, 0), 'rows': 2, 'cols': 3, 'pitch': 0.004, 'unit': 'Pa',
              'values': np.array([1, 2, NAN, 4, 5, 6], np.float32), 'status': np.array([1, 1, 2, 1, 1, 5], np.uint8),
              'missing_can_frames': 1, 'layer_depth': 0.001, 'layer_deviation': 0.2, 'finger_ends': 4,
              'tpdo_ages': np.array([], np.float32), 'taxel_tpdos': np.array([], np.uint16)} | changed
    kind = kinds[TAXELS]
    return kind(**{name: fields[name] for name in signature(kind).parameters if name in fields})


def _with_header(text):
    line = '=' * 80
    return (f'{text}\n{line}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n{line}\n'
            f'MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n{line}\n'
            'MSG: builtin_interfaces/Duration\nint32 sec\nuint32 nanosec\n')


def bag(folder, messages, plugin='MCAP', types=None, topics=(('/left/taxels', TAXELS),), compressed=False,
        times=lambda k: EPOCH + 100 + k):
    """Write the pairs (topic, message) to a bag.

    ``times(k)`` returns the time at which message k was recorded [s].
    """
    types = types or store()
    writer = rosbags.Writer(folder, version=9, storage_plugin=rosbags.StoragePlugin[plugin])
    if compressed:
        writer.set_compression(rosbags.CompressionMode.MESSAGE, rosbags.CompressionFormat.ZSTD)
    with writer:
        connections = {topic: writer.add_connection(topic, kind, typestore=types) for topic, kind in topics}
        for k, (topic, message) in enumerate(messages):
            content = message if isinstance(message, bytes) else types.serialize_cdr(message, dict(topics)[topic])
            writer.write(connections[topic], round(times(k) * 4) * 10**9 // 4, content)
    return folder


def mcap_file(path, messages, topic='/left/taxels', each=None, **options):
    """Write a file in the format of rosbag2's MCAP plugin, and return the position at which its last message ends.

    Messages are one second apart, in chunks of ``each`` messages or without chunks. If the recorder is killed, the file
    contains the bytes up to the returned position.
    """
    text = _with_header(package_file('msg/TaxelArray.msg').read_text(encoding='utf-8'))
    with path.open('wb') as file:
        writer = mcap.Writer(file, use_chunking=each is not None, **options)
        writer.start(profile='ros2')
        channel = writer.register_channel(topic, 'cdr', writer.register_schema(TAXELS, 'ros2msg', text.encode()))
        for k, message in enumerate(messages):
            time = (EPOCH + k) * 10**9
            writer.add_message(channel, time, bytes(store().serialize_cdr(message, TAXELS)), time)
            if each is not None and k % each == each - 1:
                writer.flush()
        size = file.tell()
        writer.finish()
    return size


def test_messages_of_a_bag_are_placed_by_the_clock_of_the_frames(tmp_path):
    """The frames have stamps from a replayed log, which lie 100 s before the recording.

    The first and the last message of the bag are notes.
    """
    shape = b'\0\1\0\0'
    topics = [('/left/taxels', TAXELS), ('/left/note', 'std_msgs/msg/Empty')]
    messages = [('/left/note', shape + b'\0'), *arrays(2), ('/left/note', shape + b'\0')]
    reader = TopicBagReader(bag(tmp_path / 'bag', messages, topics=topics))
    stamps = [message.stamp - EPOCH for message in reader.messages((TAXELS, 'std_msgs/msg/Empty'))]
    assert stamps == pytest.approx([-0.75, 0.25, 1.25, 2.25], abs=1e-3)


def arrays(count, **changed):
    return [('/left/taxels', taxel_array(store(), sequence, **changed)) for sequence in range(count)]


@pytest.mark.parametrize(('plugin', 'compressed'), [('MCAP', False), ('MCAP', True), ('SQLITE3', False)])
def test_a_bag_gives_frames_with_the_pads_geometry(tmp_path, plugin, compressed):
    folder = bag(tmp_path / 'bag', arrays(3), plugin, compressed=compressed)
    file, = (file for file in folder.iterdir() if file.suffix in ('.mcap', '.db3'))
    for path in (folder, file):
        reader = TopicBagReader(path)
        messages = list(reader.messages([TAXELS]))
        assert reader.pads == ('left',) and not reader.unread
        assert [(each.topic, frame_of(each.content).sequence, frame_of(each.content).stamp, each.recorded)
                for each in messages] == [('/left/taxels', k, EPOCH + k + 0.25, EPOCH + 100 + k) for k in range(3)]
        assert messages[0].content.pitch == pytest.approx(0.004) and messages[0].content.unit == 'Pa'
        frame = frame_of(messages[0].content)
        np.testing.assert_array_equal(frame.values, [[1, 2, NAN], [4, 5, 6]])
        assert frame.status.tolist() == [[1, 1, TaxelStatus.STALE], [1, 1, TaxelStatus.SATURATED]]
        assert frame.missing_can_frames == 1 and frame.tpdo_ages is None
        assert not frame.values.flags.writeable


def kinds_of(reader):
    return [damage.kind for damage in reader.damages]


def frames_in(reader):
    return [frame_of(message.content) for message in reader.messages([TAXELS])]


def test_a_bag_may_be_read_again(tmp_path):
    reader = TopicBagReader(bag(tmp_path / 'bag', arrays(5)))
    assert len(frames_in(reader)) == len(frames_in(reader)) == 5


def test_the_ages_of_a_snapshot_are_read_from_the_bag(tmp_path):
    changed = {'tpdo_ages': np.array([0, 0.5], np.float32), 'taxel_tpdos': np.array([0, 0, 0, 1, 1, 1], np.uint16)}
    frame, = frames_in(TopicBagReader(bag(tmp_path / 'bag', arrays(1, **changed))))
    assert frame.tpdo_ages.of(1, 2) == 0.5 and frame.tpdo_ages.of(0, 0) == 0


@pytest.mark.parametrize('plugin', ['MCAP', 'SQLITE3'])
def test_the_definition_in_the_bag_is_preferred(tmp_path, plugin):
    """With our definition, an older TaxelArray would be decoded to wrong values.

    The older message lacks the layer and the ages, and has a field that was removed later.
    """
    text = '''std_msgs/Header header
uint64 sequence
string gone
builtin_interfaces/Duration age
uint32 rows
uint32 cols
float32 pitch
string unit
float32[] values
uint8[] status
uint32 missing_can_frames'''
    types = store(TaxelArray=text)
    message = taxel_array(types, 7, **{'gone': 'some words'})
    frame, = frames_in(TopicBagReader(bag(tmp_path / 'bag', [('/left/taxels', message)], plugin, types)))
    assert frame.sequence == 7 and frame.values[1, 2] == 6 and frame.tpdo_ages is None


def test_a_bag_without_definitions_is_read_by_ours(tmp_path):
    """ROS 2 Humble writes bags without message definitions."""
    folder = bag(tmp_path / 'bag', arrays(2), 'SQLITE3')
    file = next(folder.glob('*.db3'))
    with sqlite3.connect(file) as base:
        base.execute('DROP TABLE message_definitions')
    base.close()
    assert len(frames_in(TopicBagReader(file))) == 2


def test_a_truncated_bag_yields_its_intact_part_and_reports_the_damage(tmp_path):
    path = tmp_path / 'x.mcap'
    size = mcap_file(path, [taxel_array(store(), k) for k in range(4)], '/robot/left/taxels')
    path.write_bytes(path.read_bytes()[:size - 10])
    reader = TopicBagReader(path)
    assert [each.sequence for each in frames_in(reader)] == [0, 1, 2]
    assert reader.pads == ('robot/left',) and kinds_of(reader) == [DamageKind.CUT_SHORT] and reader.problem


@pytest.mark.parametrize('changed', [
    {'rows': 0}, {'rows': 4_000_000_000}, {'values': np.ones(5, np.float32)}, {'status': np.ones(5, np.uint8)},
    {'status': np.full(6, 9, np.uint8)}, {'status': np.ones(6, np.uint8)}, {'unit': 'psi'}, {'pitch': NAN},
    {'pitch': 0.0}, {'tpdo_ages': np.array([1], np.float32)},
    {'tpdo_ages': np.array([1], np.float32), 'taxel_tpdos': np.ones(6, np.uint16)},
    {'layer_deviation': 0.0}, {'finger_ends': 16}, {'values': np.array([1, 2, np.inf, 4, 5, 6], np.float32)}])
def test_a_frame_whose_fields_do_not_fit_is_counted_not_given(tmp_path, changed):
    reader = TopicBagReader(bag(tmp_path / 'bag', arrays(1, **changed) + arrays(1)))
    assert len(frames_in(reader)) == 1 and kinds_of(reader) == [DamageKind.INCONSISTENT]
    damage, = reader.damages
    assert damage.begin == damage.end == EPOCH + 100 and 'at 2023-11-14' in reader.problem


def test_a_malformed_message_is_counted_and_not_returned(tmp_path):
    """One of these messages claims to have more bytes than it contains."""
    whole = bytes(store().serialize_cdr(taxel_array(store(), 0), TAXELS))
    huge = whole.replace(struct.pack('<I', 6) + struct.pack('<f', 1), struct.pack('<If', 2**32 - 1, 1))
    assert huge != whole
    broken = [('/left/taxels', data) for data in (b'', whole[:40], huge, b'\x28\xB5\x2F\xFDxx')]
    reader = TopicBagReader(bag(tmp_path / 'bag', broken + arrays(1)))
    assert len(frames_in(reader)) == 1 and kinds_of(reader) == [DamageKind.UNDECODABLE] * 4


def test_the_topics_of_a_bag_are_known_without_reading_its_messages(tmp_path):
    ours = bag(tmp_path / 'ours', arrays(1))
    types = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    types.register(typesys.get_types_from_msg('uint32 id', CAN_TYPE))
    frames = bag(tmp_path / 'can', [('/can', types.types[CAN_TYPE](1))], types=types, topics=(('/can', CAN_TYPE),))
    assert (holds_taxels(ours), holds_can_frames(ours)) == (True, False)
    assert (holds_taxels(frames), holds_can_frames(frames)) == (False, True)
    assert not holds_taxels(tmp_path / 'session.log')
    with pytest.raises(LogError, match='/can .can_msgs/msg/Frame.'):
        TopicBagReader(frames)
    with pytest.raises(LogError, match='no such file'):
        TopicBagReader(tmp_path / 'x.mcap')
    with pytest.raises(LogError, match='.mcap or .db3'):
        TopicBagReader(tmp_path)


@pytest.mark.parametrize('name', ['x.mcap', 'x.db3'])
def test_a_file_that_is_not_a_bag_is_an_error(tmp_path, name):
    (tmp_path / name).write_bytes(b'no bag at all')
    with pytest.raises(LogError, match='no readable topic'):
        TopicBagReader(tmp_path / name)


def test_other_messages_are_given_in_order_of_recording(tmp_path):
    types = store()
    kinds = types.types
    stamp = kinds['builtin_interfaces/msg/Time'](EPOCH, 0)
    header = kinds['std_msgs/msg/Header'](stamp, '')
    entry = kinds['diagnostic_msgs/msg/KeyValue']('load', '<b>0.4</b>')
    status = kinds['diagnostic_msgs/msg/DiagnosticStatus'](1, 'skin: bus', 'slow', 'can0', [entry])
    diagnostics = kinds[DIAGNOSTICS](header, [status])
    folder = bag(tmp_path / 'bag', [*arrays(1), ('/diagnostics', diagnostics), *arrays(1)], types=types,
                 topics=(('/left/taxels', TAXELS), ('/diagnostics', DIAGNOSTICS),
                         ('/left/shape', 'tactile_skin/msg/ContactShape')))
    found = list(TopicBagReader(folder).messages((TAXELS, DIAGNOSTICS)))
    assert [message.topic for message in found] == ['/left/taxels', '/diagnostics', '/left/taxels']
    assert found[1].content.status[0].values[0].value == '<b>0.4</b>' and found[1].recorded == EPOCH + 101


PADS = ('/left/taxels', TAXELS), ('/arm/right/taxels', TAXELS)


def test_replay_converts_a_bag_of_topics_to_arrays(tmp_path, capsys):
    messages = [('/left/taxels', taxel_array(store(), sequence)) for sequence in (1, 2, 5)]
    messages.append(('/arm/right/taxels', taxel_array(store(), 7, missing_can_frames=0)))
    folder = bag(tmp_path / 'bag', messages, topics=PADS)
    assert main(['replay', str(folder), '--output', str(tmp_path / 'x.npz')]) == 0
    assert capsys.readouterr().out == (
        'arm/right: 1 taxel frames, 1 complete, 0 incomplete; 0 acquisitions missing between them\n'
        'left: 3 taxel frames, 0 complete, 3 incomplete; 2 acquisitions missing between them\n')
    found = read_frames(str(tmp_path / 'x_left.npz'))
    np.testing.assert_array_equal(found.values, 3 * [[[1, 2, NAN], [4, 5, 6]]])
    assert found.status.tolist() == 3 * [[[1, 1, 2], [1, 1, 5]]]
    assert found.stamps.tolist() == [EPOCH + 1.25, EPOCH + 2.25, EPOCH + 5.25] and found.sequence.tolist() == [1, 2, 5]
    assert (found.pad, found.unit, found.pitch) == ('left', 'Pa', pytest.approx(0.004))
    assert read_frames(str(tmp_path / 'x_arm_right.npz')).sequence.tolist() == [7]


def test_replay_of_a_bag_reports_a_frame_of_another_size_by_its_exit_code(tmp_path, capsys):
    other = taxel_array(store(), 2, rows=3, cols=2)
    folder = bag(tmp_path / 'bag', [*arrays(1), ('/left/taxels', other)])
    assert main(['replay', str(folder), '--output', str(tmp_path / 'x.npz')]) == UNREAD_EXIT
    assert read_frames(str(tmp_path / 'x.npz')).values.shape == (1, 2, 3)
    assert '1 parts were not read' in capsys.readouterr().err


@pytest.mark.parametrize(('options', 'got'), [
    (['--node-id', '32', '--any-device'], 'got --node-id, --any-device'),
    (['--pads', 'lfet'], 'got lfet'), ([], 'none of arm/right')])
def test_replay_of_a_bag_refuses_ignored_options_and_missing_pads(tmp_path, capsys, options, got):
    folder = bag(tmp_path / 'bag', arrays(1), topics=PADS)
    assert main(['replay', str(folder), *options, '--output', str(tmp_path / 'x.npz')]) == 2
    assert got in capsys.readouterr().err
    assert not list(tmp_path.glob('*.npz'))


def test_a_bag_in_place_of_a_file_of_frames_is_named(tmp_path):
    (tmp_path / 'x.mcap').write_bytes(b'')
    for path in (tmp_path, tmp_path / 'x.mcap'):
        with pytest.raises(InputError, match='got a ROS 2 bag. Convert it with `tactile replay'):
            read_frames(str(path))
