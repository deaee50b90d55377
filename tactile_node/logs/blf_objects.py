"""Extract the intact objects of a Vector BLF log for python-can's BLF reader.

Objects are stored in containers. An object may start in one container and end in the next. At an object of size 0,
python-can's reader would yield the same CAN frame forever. The reader also does not count missing objects.
"""

import os
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import BinaryIO

import can
from can.io import blf

from tactile_node.logs.damage import Damage, DamageKind

SIGNATURE = b'LOBJ'
PADDING = 3  #: maximum number of bytes between two objects
RESTORE_POINTS = 115  #: object type that the file header does not include in its object count
_BASE = blf.OBJ_HEADER_BASE_STRUCT
_CONTAINER = blf.LOG_CONTAINER_STRUCT
# header size after _BASE by version [bytes]
_HEADS = {1: blf.OBJ_HEADER_V1_STRUCT.size, 2: blf.OBJ_HEADER_V2_STRUCT.size}
#: content size of each object type that contains a CAN frame [bytes]
_CONTENTS = {blf.CAN_MESSAGE: blf.CAN_MSG_STRUCT.size, blf.CAN_MESSAGE2: blf.CAN_MSG_STRUCT.size,
             blf.CAN_ERROR_EXT: blf.CAN_ERROR_EXT_STRUCT.size, blf.CAN_FD_MESSAGE: blf.CAN_FD_MSG_STRUCT.size,
             blf.CAN_FD_MESSAGE_64: blf.CAN_FD_MSG_64_STRUCT.size}


def blf_messages(file: BinaryIO, name: str) -> Iterator[can.Message | Damage]:
    """Yield the CAN messages of a BLF log, and a `Damage` for each missing part.

    Parameters
    ----------
    file
        The open log, which this function closes.
    name
        File name to show in damage reports.
    """
    with file:
        reader = can.BLFReader(file)
        for found in _whole_objects(file, name, reader.object_count):
            if isinstance(found, Damage):
                yield found
                continue
            size = _BASE.size + _CONTAINER.size + len(found)
            head = _BASE.pack(SIGNATURE, _BASE.size, 1, size, blf.LOG_CONTAINER)
            reader.file = BytesIO(head + _CONTAINER.pack(blf.NO_COMPRESSION, len(found)) + found)
            yield from reader


def _whole_objects(file: BinaryIO, name: str, count: int) -> Iterator[bytes | Damage]:
    """Yield runs of intact objects. Each run ends at damage or at the end of a container.

    ``count`` is the number of objects according to the file header, or 0 if unknown.
    """
    data, read, is_damaged = b'', 0, False
    for content in _contents(file, name):
        if isinstance(content, Damage):
            yield content
            data, is_damaged = b'', True  # an object that ends in a damaged container is lost
            continue
        data += content
        first = end = at = 0
        while (begin := data.find(SIGNATURE, at)) >= 0 and begin + _BASE.size <= len(data):
            size = _size(data, begin)
            if size == 0:
                at = begin + 1
                continue
            if begin + size > len(data):  # the object ends in the next container
                break
            if begin - end > PADDING:
                yield data[first:end]
                yield Damage(DamageKind.RECORDS, name, size=begin - end)
                is_damaged = True
                first = begin
            read += _BASE.unpack_from(data, begin)[-1] != RESTORE_POINTS
            at = end = begin + size
        yield data[first:end]
        data = data[end:]
    rest = len(data) + len(file.read())
    if rest > PADDING or not count or read < count and not is_damaged:
        yield Damage(DamageKind.CUT_SHORT, name, size=rest,
                     detail=f'{read} of {count or "an unknown number of"} objects')


def _contents(file: BinaryIO, name: str) -> Iterator[bytes | Damage]:
    """Yield the content of each container, or a `Damage` for it, and each object outside the containers.

    The iteration stops at an unreadable header, because the next object cannot be found.
    """
    while head := file.read(_BASE.size):
        size, kind = _BASE.unpack(head)[-2:] if len(head) == _BASE.size else (0, 0)
        if not head.startswith(SIGNATURE) or size < _BASE.size:
            file.seek(-len(head), os.SEEK_CUR)
            return
        content = file.read(size - _BASE.size)
        file.read(size % 4)
        try:
            yield _unpacked(content) if kind == blf.LOG_CONTAINER else head + content
        except zlib.error as error:
            yield Damage(DamageKind.CHUNK, name, size=size, detail=str(error))


def _unpacked(content: bytes) -> bytes:
    """Return the readable content of a container. Raises zlib.error if the content is damaged."""
    if len(content) < _CONTAINER.size:
        return b''
    method, _ = _CONTAINER.unpack_from(content)
    data = content[_CONTAINER.size:]
    return data if method == blf.NO_COMPRESSION else zlib.decompressobj().decompress(data)


def _size(data: bytes, begin: int) -> int:
    """Return the length of the object at ``begin``, or 0 if it is too short or overlaps another object."""
    _, _, version, size, kind = _BASE.unpack_from(data, begin)
    least = _BASE.size + (_HEADS.get(version, size) + _CONTENTS[kind] if kind in _CONTENTS else 0)
    return size if size >= least and data.find(SIGNATURE, begin + 1, begin + size + len(SIGNATURE) - 1) < 0 else 0
