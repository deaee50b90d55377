"""Find the records of an MCAP file as its specification defines them (mcap.dev/spec), so that tests can damage them."""

import struct
from typing import NamedTuple

CHUNK, MESSAGE_INDEX, DATA_END = 0x06, 0x07, 0x0F


class Record(NamedTuple):
    """Offsets of a record.

    ``begin`` is at the opcode, ``content`` is just after the 8-byte length, and ``end`` is at the next record.
    """

    opcode: int
    begin: int
    content: int
    end: int


def records(data):
    """Yield the records up to the footer."""
    assert data[:8] == b'\x89MCAP0\r\n'
    found, at = [], 8
    while not found or found[-1].opcode != 0x02:
        length, = struct.unpack_from('<Q', data, at + 1)
        found.append(Record(data[at], at, at + 9, at + 9 + length))
        at += 9 + length
    return found


def chunks(data):
    return [record for record in records(data) if record.opcode == CHUNK]


def payload(chunk, data):
    """Return the offset of a chunk's compressed records.

    Two times, a size, a CRC, the compression and another size precede these records.
    """
    name, = struct.unpack_from('<I', data, chunk.content + 28)
    return chunk.content + 32 + name + 8
