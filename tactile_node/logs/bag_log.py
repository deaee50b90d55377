"""Convert CAN frames to and from can_msgs/msg/Frame, and write them to .mcap files without ROS.

The writer ends an MCAP chunk after CHUNK_BYTES and at each flush. A truncated file can therefore be read up to its last
complete chunk, and damage destroys only the affected chunk. The rosbags library also writes bags, but without chunk
checksums.
"""

from pathlib import Path
from typing import Any

import can
import numpy as np

from tactile_node.logs.bag_decoder import CAN_DEFINITION, CAN_TYPE
from tactile_node.logs.bag_records import library
from tactile_node.logs.recorded import MSG_ENCODING, Recorded
from tactile_node.logs.replay_times import SECOND

#: topic name used by ros2_socketcan
CAN_TOPIC = 'from_can_bus'
#: Uncompressed size of a chunk [bytes], which is 0.5 s of traffic on a full 1 Mbit/s bus. A killed recording loses at
#: most one chunk. Larger chunks would lose more data when damaged, and smaller chunks would make the file larger.
CHUNK_BYTES = 1 << 18


def can_message(recorded: Recorded, frame: Any) -> can.Message:
    """Convert a can_msgs/msg/Frame. Its stamp is that of the CAN driver or, without one, the time of recording."""
    stamp = frame.header.stamp
    time = stamp.sec + stamp.nanosec / SECOND if stamp.sec or stamp.nanosec else recorded.time / SECOND
    data = bytes(frame.data[:min(frame.dlc, 8)])
    return can.Message(time, frame.id & 0x1FFF_FFFF, is_extended_id=frame.is_extended, is_remote_frame=frame.is_rtr,
                       is_error_frame=frame.is_error, channel=recorded.topic, dlc=len(data),
                       data=None if frame.is_rtr else data)


class McapCanWriter:
    """Writes CAN messages to an .mcap file as can_msgs/msg/Frame, with the interface of python-can's writers."""

    def __init__(self, path: str | Path):
        typesys = library('rosbags.typesys', path)
        writer = library('mcap.writer', path)
        if not hasattr(writer.Writer, 'flush'):
            raise ImportError('an mcap library older than 1.5.0, which cannot end a chunk')
        self.file = open(path, 'wb')
        # Loading all types of a ROS distribution would interrupt a rotating recording for 0.2 s.
        self._types = typesys.get_typestore(typesys.Stores.EMPTY)
        self._types.register(typesys.get_types_from_msg(CAN_DEFINITION, CAN_TYPE))
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
        self._writer.add_message(channel_id=self._channel, log_time=time, data=self._cdr(message, time),
                                 publish_time=time, sequence=self._sequence)

    def _cdr(self, message: can.Message, time: int) -> bytes:
        kinds = self._types.types
        stamp = kinds['builtin_interfaces/msg/Time'](time // SECOND, time % SECOND)
        header = kinds['std_msgs/msg/Header'](stamp, str(message.channel or ''))
        data = np.frombuffer(bytes(message.data).ljust(8, b'\0'), np.uint8)
        frame = kinds[CAN_TYPE](header=header, id=message.arbitration_id, is_rtr=message.is_remote_frame,
                                is_extended=message.is_extended_id, is_error=message.is_error_frame, dlc=message.dlc,
                                data=data)
        return bytes(self._types.serialize_cdr(frame, CAN_TYPE))

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
