"""Follows SDO uploads of one object by the frames alone (CiA 301, 7.2.4.3): block, segmented and expedited.

The one who reads may be this driver or, in a log, whoever did then. A pure state machine: no bus, no clock.
"""

import binascii
from enum import Enum

INITIATE_UPLOAD, SEGMENT_UPLOAD, BLOCK_UPLOAD, ABORT = 2, 3, 5, 4  # client's command specifiers, bits 5..7
UPLOADED, SEGMENT, BLOCK = 2, 0, 6  # the server's
SIZE_TOLD, EXPEDITED, BLOCK_CRC = 0x01, 0x02, 0x04
START_BLOCK, ACKNOWLEDGE, END_BLOCK = 0xA3, 0xA2, 0xA1


class Step(Enum):
    """What a frame means for the upload."""

    NOTHING = 'nothing'
    BEGUN = 'begun'
    DONE = 'done'  #: ``data`` is whole
    BROKEN = 'broken'  #: aborted, or frames are missing, or the CRC is wrong


class _Waiting(Enum):
    NOTHING = 0
    ANSWER = 1
    SEGMENT = 2
    START = 3
    BLOCK = 4
    END = 5


class SdoUpload:
    """The upload of object ``index``, ``subindex``; ``data`` holds it from DONE to the next BEGUN."""

    def __init__(self, index: int, subindex: int):
        self._object = bytes([index & 0xFF, index >> 8, subindex])
        self._waiting = _Waiting.NOTHING
        self._segments: list[bytes] = []  # of the block under way
        self._has_last = self._asks_crc = self._has_crc = False
        self._toggle = 0  # of the next segment
        self._buffer, self.data = bytearray(), b''

    @property
    def is_under_way(self) -> bool:
        return self._waiting is not _Waiting.NOTHING

    def request(self, frame: bytes) -> Step:
        """A frame of the client."""
        command = frame[0] if len(frame) == 8 else ABORT << 5
        kind = command >> 5
        if (kind == INITIATE_UPLOAD or kind == BLOCK_UPLOAD and not command & 3) and frame[1:4] == self._object:
            self._waiting, self._buffer, self._segments = _Waiting.ANSWER, bytearray(), []
            self._toggle, self._has_last, self._asks_crc = 0, False, kind == BLOCK_UPLOAD and bool(command & BLOCK_CRC)
            return Step.BEGUN
        if not self.is_under_way:
            return Step.NOTHING
        if command == START_BLOCK and self._waiting is _Waiting.START:
            self._waiting = _Waiting.BLOCK
            return Step.NOTHING
        if command == ACKNOWLEDGE and self._waiting is _Waiting.BLOCK:
            return self._acknowledge(frame[1])
        if kind == SEGMENT_UPLOAD and self._waiting is _Waiting.SEGMENT:
            return Step.NOTHING
        return self._break()  # aborted, or the channel serves another object now

    def response(self, frame: bytes) -> Step:
        """A frame of the server."""
        if not self.is_under_way:
            return Step.NOTHING
        if len(frame) != 8 or frame[0] == ABORT << 5:
            return self._break()
        if self._waiting is _Waiting.ANSWER:
            return self._answer(frame)
        if self._waiting is _Waiting.BLOCK:
            return self._block_segment(frame)
        if self._waiting is _Waiting.SEGMENT and frame[0] >> 5 == SEGMENT:
            if frame[0] >> 4 & 1 != self._toggle:  # one lost or doubled
                return self._break()
            self._toggle ^= 1
            self._buffer += frame[1:8 - (frame[0] >> 1 & 7)]
            return self._finish() if frame[0] & 1 else Step.NOTHING
        if self._waiting is _Waiting.END and frame[0] & 0xE3 == BLOCK << 5 | 1:
            return self._end_block(frame)
        return self._break()

    def _answer(self, frame: bytes) -> Step:
        command, kind = frame[0], frame[0] >> 5
        if frame[1:4] != self._object or kind not in (UPLOADED, BLOCK):
            return self._break()
        if kind == BLOCK:
            self._waiting, self._has_crc = _Waiting.START, self._asks_crc and bool(command & BLOCK_CRC)
            return Step.NOTHING
        if not command & EXPEDITED:
            self._waiting = _Waiting.SEGMENT
            return Step.NOTHING
        self._buffer += frame[4:8 - (command >> 2 & 3)] if command & SIZE_TOLD else frame[4:8]
        return self._finish()

    def _block_segment(self, frame: bytes) -> Step:
        """Only the next one in order counts: what follows a gap is sent again."""
        if frame[0] & 0x7F == len(self._segments) + 1:
            self._segments.append(frame[1:8])
            self._has_last = bool(frame[0] & 0x80)
        return Step.NOTHING

    def _acknowledge(self, count: int) -> Step:
        """The client has ``count`` segments of this block; it may have seen more of them than we."""
        if count > len(self._segments):
            return self._break()
        is_last = self._has_last and count == len(self._segments)
        self._buffer += b''.join(self._segments[:count])
        self._segments, self._has_last = [], False
        if is_last:
            self._waiting = _Waiting.END
        return Step.NOTHING

    def _end_block(self, frame: bytes) -> Step:
        unused = frame[0] >> 2 & 7
        if unused:
            del self._buffer[-unused:]
        if self._has_crc and binascii.crc_hqx(self._buffer, 0) != int.from_bytes(frame[1:3], 'little'):
            return self._break()
        return self._finish()

    def _finish(self) -> Step:
        self._waiting, self.data = _Waiting.NOTHING, bytes(self._buffer)
        return Step.DONE

    def _break(self) -> Step:
        self._waiting = _Waiting.NOTHING
        return Step.BROKEN
