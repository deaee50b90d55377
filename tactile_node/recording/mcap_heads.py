"""The heads of an MCAP file's records: opcode, length; and where the next chunk is, past what is damaged."""

import os
import re
import struct
from typing import NamedTuple

from tactile_node.recording.mcap_summary import CHANNEL, FOOTER, FOOTER_SIZE, HEAD, SCHEMA

MESSAGE, CHUNK, DATA_END = 0x05, 0x06, 0x0F
OPCODES = range(0x01, 0x10)
APPLICATIONS = 0x80  # opcodes from here on are theirs
_TIMES = struct.Struct('<QQQII')  # of a chunk: first, last [ns], size uncompressed, checksum, length of a name
_SIZE = struct.Struct('<Q')
COMPRESSIONS = b'', b'lz4', b'zstd'
PEEK = HEAD.size + _TIMES.size + 4 + _SIZE.size  # of a chunk up to its records, at most
LARGEST = 1 << 30  # bytes of a chunk, uncompressed; a damaged head may claim any number
WINDOW = 1 << 20   # bytes
#: where a chunk may begin: opcode, a length below 2**40, and after the times the compression's name
_CHUNK_HEAD = re.compile(rb'(?s)\x06(?=.{5}\0\0\0.{28}(?:\0\0\0\0|\x03\0\0\0lz4|\x04\0\0\0zstd))')


class ChunkHead(NamedTuple):
    last: int      #: time in it [ns]
    size: int      #: of its records, uncompressed [bytes]
    checksum: int  #: of these; 0: none
    begin: int     #: of its records
    compression: str


class Head(NamedTuple):
    """Of a record that lies within the file."""

    opcode: int
    begin: int  #: of the content
    end: int    #: of the record
    chunk: ChunkHead | None = None  #: of a chunk alone


def head_at(file: int, size: int, at: int) -> Head | None:
    """Return the head of the record at ``at``; None where there is none that is whole."""
    head = _plausible(file, size, at)
    if head is None or head.chunk is not None or head.opcode in (SCHEMA, CHANNEL, MESSAGE, DATA_END, FOOTER):
        return head
    return head if head.end == size or _plausible(file, size, head.end) is not None else None  # it is passed over


def _plausible(file: int, size: int, at: int) -> Head | None:
    start = os.pread(file, PEEK, at)
    if len(start) < HEAD.size:
        return None
    opcode, length = HEAD.unpack_from(start)
    begin = at + HEAD.size
    if begin + length > size:
        return None
    chunk = _chunk_head(start, length, begin)
    if chunk is not None:  # whatever the opcode has become
        return Head(CHUNK, begin, begin + length, chunk)
    if opcode == CHUNK or not (opcode in OPCODES or opcode >= APPLICATIONS):
        return None
    if length != {DATA_END: 4, FOOTER: FOOTER_SIZE}.get(opcode, length):
        return None
    return Head(opcode, begin, begin + length)


def next_chunk(file: int, size: int, at: int) -> int | None:
    """Return where the first whole chunk after ``at`` begins."""
    for begin in range(at + 1, size, WINDOW):
        window = os.pread(file, WINDOW + PEEK, begin)
        for match in _CHUNK_HEAD.finditer(window):
            found = begin + match.start()
            head = _plausible(file, size, found)
            if match.start() < WINDOW and head is not None and head.chunk is not None:
                return found
    return None


def _chunk_head(start: bytes, length: int, begin: int) -> ChunkHead | None:
    """Return what the begin of a record says of a chunk of ``length`` bytes at ``begin``; None where it is none."""
    if len(start) < HEAD.size + _TIMES.size + _SIZE.size:
        return None
    _, last, size, checksum, name = _TIMES.unpack_from(start, HEAD.size)
    at = HEAD.size + _TIMES.size
    if start[at:at + name] not in COMPRESSIONS or len(start) < at + name + _SIZE.size:
        return None
    (records,) = _SIZE.unpack_from(start, at + name)
    fixed = _TIMES.size + name + _SIZE.size
    if length != fixed + records:
        return None
    return ChunkHead(last, size, checksum, begin + fixed, start[at:at + name].decode())
