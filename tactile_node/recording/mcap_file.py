"""The messages of one MCAP file in the order in which they stand there, past what is damaged.

The file is a row of records: opcode, length, content (MCAP specification). Messages are in chunks, each with a
checksum of its content; a chunk that does not fit it is left out whole. Where the row is broken, the next chunk is
looked for byte by byte: its head gives its length twice, and names its compression. Messages without a chunk have no
checksum: what follows damage is then lost to the end of the file.
"""

import os
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from tactile_node.recording.damage import Damage, DamageKind
from tactile_node.recording.mcap_heads import DATA_END, LARGEST, MESSAGE, Head, head_at, next_chunk
from tactile_node.recording.mcap_summary import CHANNEL, FOOTER, MAGIC, SCHEMA, summary_of


class Stored(NamedTuple):
    """A message of the file."""

    channel: Any  #: of the library `mcap`
    schema: Any   #: None: it has none
    time: int     #: when it was recorded [ns]
    data: bytes


class McapFile:
    """Reads an open file from ``since`` [ns] on. ``library`` and ``records``: mcap.stream_reader and mcap.records."""

    def __init__(self, file: int, path: Path, library, records):
        self._file, self._name = file, path.name
        self._size = os.fstat(file).st_size
        self._library, self._records = library, records
        self._has_end = self._size > len(MAGIC) and os.pread(file, len(MAGIC), self._size - len(MAGIC)) == MAGIC
        self.summary = summary_of(file, self._size)
        self._schemas: dict[int, Any] = {}
        self._channels: dict[int, Any] = {}
        if self.summary is not None:
            for opcode, contents in ((SCHEMA, self.summary.schemas), (CHANNEL, self.summary.channels)):
                for content in contents:
                    self._learn(self._parsed(opcode, content))

    @property
    def channels(self) -> list[tuple[Any, Any]]:
        """Those known so far, each with its schema or None."""
        return [(each, self._schemas.get(each.schema_id)) for each in self._channels.values()]

    def read(self, since: int = 0) -> Iterator[Stored | Damage]:
        read, is_damaged = 0, False
        for found in self._walk(since):
            is_damaged = is_damaged or isinstance(found, Damage)
            read += isinstance(found, Stored)
            yield found
        counted = 0 if self.summary is None or since else self.summary.messages or 0
        if read < counted and not is_damaged:
            yield Damage(DamageKind.RECORDS, self._name, None, detail=f'{read} of {counted} messages')

    def _walk(self, since: int) -> Iterator[Stored | Damage]:
        at: int | None = len(MAGIC) if os.pread(self._file, len(MAGIC), 0) == MAGIC else 0
        if self.summary is not None and len(self.summary.places) and since:
            at = self.summary.first_place(since)
        while at is not None:
            head = head_at(self._file, self._size, at)
            if head is None:
                following = next_chunk(self._file, self._size, at)
                yield from self._broken(at, following)
                at = following
                continue
            if head.opcode in (DATA_END, FOOTER):
                return
            if head.chunk is not None:
                yield from self._chunk(head, at, since)
            elif head.opcode in (SCHEMA, CHANNEL, MESSAGE):
                yield from self._record(head, since)
            at = head.end

    def _broken(self, at: int, following: int | None) -> Iterator[Damage]:
        """What lies between; nothing where the summary shows that no chunk was lost."""
        end = self._size if following is None else following
        chunks = None
        if self.summary is not None and len(self.summary.places):
            chunks = self.summary.chunks_between(at, end)
        if chunks != 0:
            is_cut = following is None and not self._has_end
            yield Damage(DamageKind.CUT_SHORT if is_cut else DamageKind.RECORDS, self._name, chunks, end - at)

    def _chunk(self, head: Head, at: int, since: int) -> Iterator[Stored | Damage]:
        assert head.chunk is not None
        last, size, checksum, begin, compression = head.chunk
        if self.summary is None and last < since:
            return
        try:
            if size > LARGEST:
                raise ValueError(f'a chunk of {size} bytes')
            data = os.pread(self._file, head.end - begin, begin)
            chunk = self._records.Chunk(compression=compression, data=data, message_start_time=0, message_end_time=last,
                                        uncompressed_crc=checksum, uncompressed_size=size)
            found = self._library.breakup_chunk(chunk, validate_crc=True)
        except Exception as error:  # the library lets struct's, lz4's and zstandard's through beside its own
            yield Damage(DamageKind.CHUNK, self._name, 1, head.end - at, detail=f'{type(error).__name__}: {error}')
            return
        unknown = 0
        for record in found:
            if not isinstance(record, self._records.Message):
                self._learn(record)
            elif record.channel_id not in self._channels:
                unknown += 1
            elif record.log_time >= since:
                yield self._stored(record)
        if unknown:
            yield Damage(DamageKind.UNKNOWN_CHANNEL, self._name, 0, head.end - at, detail=f'{unknown} messages')

    def _record(self, head: Head, since: int) -> Iterator[Stored | Damage]:
        """One that is in no chunk."""
        try:
            record = self._parsed(head.opcode, os.pread(self._file, head.end - head.begin, head.begin))
        except Exception as error:  # as above
            yield Damage(DamageKind.RECORDS, self._name, None, head.end - head.begin,
                         detail=f'{type(error).__name__}: {error}')
            return
        if head.opcode != MESSAGE:
            self._learn(record)
        elif record.channel_id not in self._channels:
            yield Damage(DamageKind.UNKNOWN_CHANNEL, self._name, 0, head.end - head.begin, detail='1 message')
        elif record.log_time >= since:
            yield self._stored(record)

    def _parsed(self, opcode: int, content: bytes):
        stream = self._library.ReadDataStream(BytesIO(content))
        if opcode == MESSAGE:
            return self._records.Message.read(stream, len(content))
        return (self._records.Schema if opcode == SCHEMA else self._records.Channel).read(stream)

    def _learn(self, record) -> None:
        if isinstance(record, self._records.Schema):
            self._schemas[record.id] = record
        elif isinstance(record, self._records.Channel):
            self._channels[record.id] = record

    def _stored(self, message) -> Stored:
        channel = self._channels[message.channel_id]
        return Stored(channel, self._schemas.get(channel.schema_id), message.log_time, message.data)
