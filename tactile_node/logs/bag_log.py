"""Read and write CAN frames (can_msgs/msg/Frame) in ROS 2 bags without ROS: .mcap, .db3 (rosbag2) or a bag folder.

The writer ends an MCAP chunk after CHUNK_BYTES and at each flush. A truncated file can therefore be read up to its last
complete chunk, and damage destroys only the affected chunk. The rosbags library also writes bags, but without chunk
checksums.
"""

from collections.abc import Iterator
from pathlib import Path

import can
import numpy as np

from tactile_node.errors import LogError
from tactile_node.logs.bag_records import MSG_ENCODING, OnDamage, Recorded, begin_of, decompress, library, records_of
from tactile_node.logs.damage import Damage, DamageKind
from tactile_node.logs.replay_times import SECOND, WHOLE, TimeWindow

CAN_TYPE = 'can_msgs/msg/Frame'
#: topic name used by ros2_socketcan
CAN_TOPIC = 'from_can_bus'
#: definition of CAN_TYPE from the can_msgs package, including all nested types
CAN_DEFINITION = '''std_msgs/Header header
uint32 id
bool is_rtr
bool is_extended
bool is_error
uint8 dlc
uint8[8] data
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
'''
#: Uncompressed size of a chunk [bytes], which is 0.5 s of traffic on a full 1 Mbit/s bus. A killed recording loses at
#: most one chunk. Larger chunks would lose more data when damaged, and smaller chunks would make the file larger.
CHUNK_BYTES = 1 << 18


def read_can_frames(path: str | Path, on_damage: OnDamage = lambda _: None, window: TimeWindow = WHOLE
                    ) -> Iterator[can.Message]:
    """Yield the CAN messages of a bag in the order of recording.

    Parameters
    ----------
    path
        Path of the bag: a file or a folder.
    on_damage
        Called with each unreadable part.
    window
        Part of the recording to read.

    Raises
    ------
    LogError
        Raised if the bag has no topic of type can_msgs/msg/Frame.
    """
    path, types, given = Path(path), _CanTypes(path), 0
    seen: dict[str, str] = {}  # message types by topic
    bounds = (0, None) if window == WHOLE else window.of(begin_of(path))
    try:
        for recorded in records_of(path, on_damage, *bounds):
            seen.setdefault(recorded.topic, recorded.type)
            if recorded.type != CAN_TYPE:
                continue
            given += 1
            try:
                message = types.message(recorded)
            except Exception as error:  # rosbags also raises errors from struct, numpy and zstandard
                at = recorded.time / SECOND
                on_damage(Damage(DamageKind.UNDECODABLE, path.name, begin=at, end=at,
                                 detail=f'{recorded.topic}: {type(error).__name__}: {error}'))
            else:
                yield message
    finally:
        if not given and seen and CAN_TYPE not in seen.values():
            topics = ', '.join(f'{topic} ({kind})' for topic, kind in sorted(seen.items()))
            raise LogError(str(path), expected=f'a topic of type {CAN_TYPE}', got=topics,
                           remedy='Record the topic of your CAN driver, such as /from_can_bus of ros2_socketcan.')


class McapCanWriter:
    """Writes CAN messages to an .mcap file as can_msgs/msg/Frame, with the interface of python-can's writers."""

    def __init__(self, path: str | Path):
        types = _CanTypes(path)
        writer = library('mcap.writer', path)
        if not hasattr(writer.Writer, 'flush'):
            raise ImportError('an mcap library older than 1.5.0, which cannot end a chunk')
        self.file = open(path, 'wb')
        self._types = types
        self._sequence = 0
        self._writer = writer.Writer(self.file, chunk_size=CHUNK_BYTES)
        self._writer.start(profile='ros2', library='tactile_skin')
        schema = self._writer.register_schema(CAN_TYPE, MSG_ENCODING, CAN_DEFINITION.encode())
        self._channel = self._writer.register_channel(CAN_TOPIC, 'cdr', schema)
        self._repeat_types(schema, library('mcap.records', path), library('mcap.data_stream', path))

    def on_message_received(self, message: can.Message) -> None:
        """Write a message. Raises ValueError for a CAN FD frame, which does not fit into can_msgs/msg/Frame."""
        if message.is_fd:
            raise ValueError('a CAN FD frame does not fit into can_msgs/msg/Frame')
        seconds, part = divmod(message.timestamp, 1)
        # The time is converted in two parts, because a single float would round it to 256 ns.
        time = int(seconds) * SECOND + round(part * SECOND)
        self._sequence += 1
        self._writer.add_message(channel_id=self._channel, log_time=time, data=self._types.cdr(message, time),
                                 publish_time=time, sequence=self._sequence)

    def _repeat_types(self, schema: int, records, streams) -> None:
        """Also write schema and channel before the first chunk.

        Otherwise, damage to that chunk would lose all messages.
        """
        builder = streams.RecordBuilder()
        records.Schema(id=schema, name=CAN_TYPE, encoding=MSG_ENCODING, data=CAN_DEFINITION.encode()).write(builder)
        records.Channel(id=self._channel, topic=CAN_TOPIC, message_encoding='cdr', metadata={},
                        schema_id=schema).write(builder)
        self.file.write(builder.end())

    def flush(self) -> None:
        """End the current chunk, so that a reader can see all messages written so far."""
        self._writer.flush()

    def stop(self) -> None:
        self._writer.finish()
        self.file.close()


class _CanTypes:
    """Converts between can_msgs/msg/Frame and python-can messages."""

    def __init__(self, path: str | Path):
        typesys = library('rosbags.typesys', path)
        # Loading all types of a ROS distribution would interrupt a rotating recording for 0.2 s.
        self._store = typesys.get_typestore(typesys.Stores.EMPTY)
        self._store.register(typesys.get_types_from_msg(CAN_DEFINITION, CAN_TYPE))
        self._frame = self._store.types[CAN_TYPE]

    def message(self, recorded: Recorded) -> can.Message:
        """Return the recorded message with the stamp of the CAN driver or, without one, the time of recording."""
        frame = self._store.deserialize_cdr(decompress(recorded.cdr), CAN_TYPE)
        stamp = frame.header.stamp
        time = stamp.sec + stamp.nanosec / SECOND if stamp.sec or stamp.nanosec else recorded.time / SECOND
        data = bytes(frame.data[:min(frame.dlc, 8)])
        return can.Message(time, frame.id & 0x1FFF_FFFF, is_extended_id=frame.is_extended,
                           is_remote_frame=frame.is_rtr, is_error_frame=frame.is_error, channel=recorded.topic,
                           dlc=len(data), data=None if frame.is_rtr else data)

    def cdr(self, message: can.Message, time: int) -> bytes:
        kinds, data = self._store.types, bytes(message.data).ljust(8, b'\0')
        stamp = kinds['builtin_interfaces/msg/Time'](time // SECOND, time % SECOND)
        header = kinds['std_msgs/msg/Header'](stamp, str(message.channel or ''))
        frame = self._frame(header=header, id=message.arbitration_id, is_rtr=message.is_remote_frame,
                            is_extended=message.is_extended_id, is_error=message.is_error_frame, dlc=message.dlc,
                            data=np.frombuffer(data, np.uint8))
        return bytes(self._store.serialize_cdr(frame, CAN_TYPE))
