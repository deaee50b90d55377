"""The summary section of an MCAP file, by its checksum (MCAP specification, "Summary Section" and "Footer").

Its chunk indexes say where the messages of a time are; without it a reader walks over the heads of all chunks.
"""

import os
import struct
import zlib
from typing import NamedTuple

import numpy as np

from tactile_node.read_only import read_only

MAGIC = b'\x89MCAP0\r\n'
HEAD = struct.Struct('<BQ')  #: of a record: opcode, length of its content [bytes]
SCHEMA, CHANNEL, CHUNK_INDEX, STATISTICS, FOOTER = 0x03, 0x04, 0x08, 0x0B, 0x02
FOOTER_SIZE = 20
_FOOTER = struct.Struct('<QQI')      # begin of the summary, of its offsets, checksum
_CHUNK_INDEX = struct.Struct('<QQQ')  # first and last time [ns], place of the chunk
_STATISTICS = struct.Struct('<QHIIIIQQ')  # messages ... chunks, first and last time [ns]
NUMBER = np.dtype(np.uint64)


class Summary(NamedTuple):
    """What a file says of itself at its end. Chunks are in the order in which they stand in the file."""

    places: np.ndarray  #: (chunks,) of the chunks' heads [bytes]
    ends: np.ndarray    #: (chunks,) the last times in them [ns]
    schemas: tuple[bytes, ...]   #: contents of the records
    channels: tuple[bytes, ...]
    messages: int | None = None  #: of the file
    begin: int = 0  #: first time [ns]
    end: int = 0    #: last time [ns]

    def first_place(self, since: int) -> int | None:
        """Return where the first chunk is that has messages at ``since`` [ns] or later; None: there is none."""
        later = self.places[self.ends >= since]
        return int(later[0]) if len(later) else None

    def chunks_between(self, begin: int, end: int) -> int:
        """Return how many chunks begin in ``begin`` <= place < ``end``."""
        return int(((self.places >= begin) & (self.places < end)).sum())


def summary_of(file: int, size: int) -> Summary | None:
    """Return that of an open file of ``size`` bytes; None: it was not ended, has no summary, or a damaged one."""
    footer_at = size - len(MAGIC) - FOOTER_SIZE - HEAD.size
    tail = os.pread(file, size - footer_at, footer_at) if footer_at > len(MAGIC) else b''
    if not tail.endswith(MAGIC) or HEAD.unpack_from(tail) != (FOOTER, FOOTER_SIZE):
        return None
    begin, _, checksum = _FOOTER.unpack_from(tail, HEAD.size)
    if not len(MAGIC) <= begin < footer_at:
        return None
    content = os.pread(file, footer_at - begin, begin)
    checked = zlib.crc32(tail[:HEAD.size + 16], zlib.crc32(content))  # the footer up to its checksum
    if checksum not in (0, checked):
        return None
    try:
        return _parsed(content)
    except (struct.error, IndexError):
        return None


def _parsed(content: bytes) -> Summary:
    found: dict[int, list[bytes]] = {SCHEMA: [], CHANNEL: [], CHUNK_INDEX: [], STATISTICS: []}
    at = 0
    while at < len(content):
        opcode, length = HEAD.unpack_from(content, at)
        at += HEAD.size
        if opcode in found:
            found[opcode].append(content[at:at + length])
        at += length
    chunks = np.array(sorted((place, end) for _, end, place in map(_CHUNK_INDEX.unpack_from, found[CHUNK_INDEX])),
                      NUMBER).reshape(-1, 2)
    known = (None, 0, 0)
    if found[STATISTICS]:
        messages, *_, begin, end = _STATISTICS.unpack_from(found[STATISTICS][0])
        known = messages, begin, end
    return Summary(read_only(chunks[:, 0]), read_only(chunks[:, 1]), tuple(found[SCHEMA]), tuple(found[CHANNEL]),
                   *known)
