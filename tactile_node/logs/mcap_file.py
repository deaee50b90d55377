"""Read the messages of one MCAP file in their stored order, and continue after damage.

An MCAP file stores messages in chunks, each with a checksum of its content. A chunk with a wrong checksum is dropped as
a whole. An index at the end of the file, with a separate checksum, contains the positions of the chunks. The index is
missing if the recorder was killed. Without an index, the reader reads the records (opcode, length, content) in
sequence. If the sequence is broken, the reader searches for the next chunk. The header of a chunk can be recognised,
because it contains the length twice and the name of the compression. Messages outside chunks have no checksum. After a
damaged place, all messages outside chunks are lost up to the end of the file.

The readers in the mcap and rosbags libraries stop at the first damage, and read nothing from the file of a killed
recorder. If zeros have replaced a chunk, or if its opcode is damaged, mcap's readers skip the chunk without an error.
This module needs the mcap library, so `bag_records` imports this module only for a bag.
"""

import os
import re
import struct
import zlib
from collections.abc import Iterable, Iterator
from io import BytesIO
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import NonSeekingReader
from mcap.records import Channel, Chunk, ChunkIndex, McapRecord, Message, Schema
from mcap.stream_reader import breakup_chunk
from mcap.summary import Summary

from tactile_node.logs.damage import Damage, DamageKind
from tactile_node.logs.recorded import MSG_ENCODING, Recorded

MCAP_MAGIC = b'\x89MCAP0\r\n'
#: record header: opcode, length of the content [bytes]
RECORD_HEAD = struct.Struct('<BQ')
# footer: offset of the summary, offset of the summary offsets, checksum of the preceding bytes
_FOOTER = struct.Struct('<QQI')
TAIL_BYTES = RECORD_HEAD.size + _FOOTER.size + len(MCAP_MAGIC)  #: size of the footer and the closing magic [bytes]
FIXED_LENGTHS = {Opcode.FOOTER: _FOOTER.size, Opcode.DATA_END: 4}  #: content length by opcode [bytes]
OPCODES = frozenset(Opcode)
#: size of a chunk without the records and the compression name [bytes]
CHUNK_SIZE = 40
#: maximum size of an uncompressed record [bytes], because a damaged header may claim any size
LARGEST_RECORD = 1 << 30
#: schema of a channel whose schema record is missing
UNKNOWN_SCHEMA = Schema(id=0, data=b'', encoding='', name='')
#: block size for the search for the next chunk [bytes]
SEARCH_BYTES = 1 << 20
#: possible chunk header: opcode, length below 2**40, then times, size and checksum, then the compression name
_CHUNK_HEAD = re.compile(rb'(?s)\x06(?=.{5}\0\0\0.{28}(?:\0\0\0\0|\x03\0\0\0lz4|\x04\0\0\0zstd))')


class McapFile:
    """Reader for an open MCAP file.

    Parameters
    ----------
    file
        The file.
    name
        File name to show in damage reports.

    Attributes
    ----------
    summary
        Summary at the end of the file, or None if the summary is missing or damaged.
    """

    def __init__(self, file: BinaryIO, name: str):
        self._file, self._name = file, name
        self._size = file.seek(0, os.SEEK_END)
        tail = self._bytes(TAIL_BYTES, max(self._size - TAIL_BYTES, 0))
        self._has_end = tail.endswith(MCAP_MAGIC)
        self.summary = self._read_summary(tail) if self._has_end and len(tail) == TAIL_BYTES else None
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Recorded] = {}  # message without time and content by channel ID
        if self.summary is not None:
            for record in (*self.summary.schemas.values(), *self.summary.channels.values()):
                self._learn(record)

    @property
    def begin(self) -> int | None:
        """Recording time of the first message according to the summary [ns], or None if unknown."""
        statistics = None if self.summary is None else self.summary.statistics
        return statistics.message_start_time if statistics is not None and statistics.message_count else None

    def topics(self) -> dict[str, str]:
        """Return the message type of each topic, or '' where the type is unknown.

        Without a summary, the topics are known only after reading the messages.
        """
        if not self._channels:
            for _ in self.read():
                pass
        return {channel.topic: channel.type for channel in self._channels.values()}

    def read(self, since: int = 0) -> Iterator[Recorded | Damage]:
        """Yield the messages recorded at ``since`` [ns] or later, and a `Damage` for each damaged part of the file."""
        read, is_damaged = 0, False
        indexes = () if self.summary is None else self.summary.chunk_indexes
        for found in self._read_indexed(indexes, since) if indexes else self._walk(since):
            is_damaged = is_damaged or isinstance(found, Damage)
            read += isinstance(found, Recorded)
            yield found
        statistics = None if self.summary is None or since else self.summary.statistics
        if statistics is not None and read < statistics.message_count and not is_damaged:
            yield Damage(DamageKind.RECORDS, self._name, detail=f'{read} of {statistics.message_count} messages')

    def _bytes(self, size: int, at: int) -> bytes:
        self._file.seek(at)
        return self._file.read(size)

    def _read_summary(self, tail: bytes) -> Summary | None:
        begin, _, checksum = _FOOTER.unpack_from(tail, RECORD_HEAD.size)
        content = self._bytes(max(self._size - TAIL_BYTES - begin, 0), begin) if begin < self._size else b''
        if not content or checksum not in (0, zlib.crc32(content + tail[:-len(MCAP_MAGIC) - 4])):
            return None
        try:
            summary = NonSeekingReader(BytesIO(MCAP_MAGIC + content + tail)).get_summary()
        except Exception:  # without a checksum, the content may be arbitrary bytes
            return None
        indexes = () if summary is None else summary.chunk_indexes
        return summary if all(each.chunk_start_offset + each.chunk_length <= self._size for each in indexes) else None

    def _read_indexed(self, indexes: Iterable[ChunkIndex], since: int) -> Iterator[Recorded | Damage]:
        for index in sorted(indexes, key=lambda index: index.chunk_start_offset):
            if index.message_end_time < since:
                continue
            record = self._bytes(index.chunk_length, index.chunk_start_offset)
            chunk = _chunk_of(record[RECORD_HEAD.size:])
            if chunk is None or RECORD_HEAD.unpack_from(record)[1] != index.chunk_length - RECORD_HEAD.size:
                yield Damage(DamageKind.RECORDS, self._name, 1, index.chunk_length)
            else:
                yield from self._read_chunk(chunk, since)

    def _walk(self, since: int) -> Iterator[Recorded | Damage]:
        if not self._size:
            yield Damage(DamageKind.CUT_SHORT, self._name, detail='the file is empty')
            return
        at: int | None = len(MCAP_MAGIC)
        while at is not None:
            opcode, length = self._head(at) or (None, 0)
            end = at + RECORD_HEAD.size + length
            record = self._bytes(end - at, at)
            chunk = _chunk_of(record[RECORD_HEAD.size:])
            if chunk is not None:
                if chunk.message_end_time >= since or self.summary is not None or not self._channels:
                    yield from self._read_chunk(chunk, since)
            elif opcode in FIXED_LENGTHS:
                return
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
                yield from self._read_chunk(Chunk('', record, 0, 0, 0, end - at), since, is_chunk=False)
            elif opcode in (None, Opcode.CHUNK) or (end < self._size and self._head(end) is None):
                following = self._next_chunk(at + 1)
                is_cut = following is None and not self._has_end
                yield Damage(DamageKind.CUT_SHORT if is_cut else DamageKind.RECORDS, self._name,
                             size=(following or self._size) - at)
                at = following
                continue
            at = end

    def _head(self, at: int) -> tuple[int, int] | None:
        """Return opcode and length of the record at ``at``, or None if no record can begin there."""
        head = self._bytes(RECORD_HEAD.size, at)
        if len(head) < RECORD_HEAD.size:
            return None
        opcode, length = RECORD_HEAD.unpack(head)
        is_known = opcode in OPCODES or opcode >= 0x80  # opcodes from 0x80 are reserved for applications
        fits = (length <= min(LARGEST_RECORD, self._size - at - RECORD_HEAD.size)
                and length == FIXED_LENGTHS.get(opcode, length))
        return (opcode, length) if is_known and fits else None

    def _next_chunk(self, at: int) -> int | None:
        for begin in range(at, self._size, SEARCH_BYTES):
            content = self._bytes(SEARCH_BYTES + RECORD_HEAD.size + CHUNK_SIZE, begin)
            for match in _CHUNK_HEAD.finditer(content):
                found = begin + match.start()
                head = self._head(found)
                if head is not None and _chunk_of(self._bytes(head[1], found + RECORD_HEAD.size)) is not None:
                    return found
        return None

    def _read_chunk(self, chunk: Chunk, since: int, is_chunk: bool = True) -> Iterator[Recorded | Damage]:
        size = len(chunk.data)
        try:
            if chunk.uncompressed_size > LARGEST_RECORD:
                raise ValueError(f'a chunk of {chunk.uncompressed_size} bytes')
            found = breakup_chunk(chunk, validate_crc=True)
        except Exception as error:  # the mcap library also raises errors from struct, lz4 and zstandard
            kind, chunks = (DamageKind.CHUNK, 1) if is_chunk else (DamageKind.RECORDS, None)
            yield Damage(kind, self._name, chunks, size, detail=f'{type(error).__name__}: {error}')
            return
        unknown = 0
        for record in found:
            if not isinstance(record, Message):
                self._learn(record)
            elif (channel := self._channels.get(record.channel_id)) is None:
                unknown += 1
            elif record.log_time >= since:
                yield channel._replace(time=record.log_time, cdr=record.data)
        if unknown:
            yield Damage(DamageKind.UNKNOWN_CHANNEL, self._name, 0, size, detail=f'{unknown} messages')

    def _learn(self, record: McapRecord) -> None:
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            schema = self._schemas.get(record.schema_id, UNKNOWN_SCHEMA)
            definition = schema.data.decode('utf-8', 'replace') if schema.encoding == MSG_ENCODING else ''
            self._channels[record.id] = Recorded(record.topic, schema.name, 0, b'', definition)


def _chunk_of(content: bytes) -> Chunk | None:
    """Parse a record as a chunk, even if the opcode is damaged. Return None if the lengths are inconsistent."""
    try:
        chunk = Chunk.read(ReadDataStream(BytesIO(content)))
    except Exception:  # other kinds of records raise struct, UTF-8 or end-of-file errors
        return None
    begin = CHUNK_SIZE + len(chunk.compression)
    announced = int.from_bytes(content[begin - 8:begin], 'little')  # the mcap library also accepts shorter content
    return chunk if chunk.compression in ('', 'lz4', 'zstd') and begin + announced == len(content) else None
