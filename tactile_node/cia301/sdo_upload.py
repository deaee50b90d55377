"""Follows SDO uploads of one object by their frames alone (CiA 301, 7.2.4.3): block, segmented and expedited.

The client may be this driver or, in a recorded log, any other. A pure state machine: no bus, no clock.

    NOTHING -> ANSWER -> (expedited)                        -> NOTHING, ``data`` is complete
                      -> SEGMENT ...                        -> NOTHING
                      -> START -> BLOCK <-> BLOCK ... -> END -> NOTHING

A new request begins again at ANSWER. Any frame that does not fit breaks the upload.
"""

import binascii
from enum import Enum

from canopen.sdo.constants import (
    CRC_SUPPORTED,
    EXPEDITED,
    NO_MORE_BLOCKS,
    NO_MORE_DATA,
    REQUEST_ABORTED,
    REQUEST_SEGMENT_UPLOAD,
    REQUEST_UPLOAD,
    RESPONSE_ABORTED,
    RESPONSE_BLOCK_UPLOAD,
    RESPONSE_SEGMENT_UPLOAD,
    RESPONSE_UPLOAD,
    SIZE_SPECIFIED,
    TOGGLE_BIT,
)

from tactile_node.cia301.sdo import (
    ACKNOWLEDGE_BLOCK_REQUEST,
    BLOCK_COMMAND,
    COMMAND,
    END_BLOCK_RESPONSE,
    INITIATE_BLOCK_REQUEST,
    SDO_BYTES,
    START_BLOCK_REQUEST,
)


class Step(Enum):
    """What a frame means for the upload."""

    NOTHING = 0
    BEGUN = 1
    DONE = 2  #: ``data`` is complete
    BROKEN = 3  #: aborted, or frames are missing, or the CRC is wrong


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
        self._has_last = False  # the last segment of the object is among them
        self._client_has_crc = False
        self._has_crc = False  # client and server have
        self._toggle = 0  # of the next segment
        self._buffer = bytearray()
        self.data = b''

    @property
    def is_under_way(self) -> bool:
        return self._waiting is not _Waiting.NOTHING

    def request(self, frame: bytes) -> Step:
        """Take a frame of the client."""
        command = frame[0] if len(frame) == SDO_BYTES else REQUEST_ABORTED
        is_block = command & BLOCK_COMMAND == INITIATE_BLOCK_REQUEST
        if (is_block or command & COMMAND == REQUEST_UPLOAD) and frame[1:4] == self._object:
            self._begin(is_block and bool(command & CRC_SUPPORTED))
            return Step.BEGUN
        if not self.is_under_way:
            return Step.NOTHING
        if command == START_BLOCK_REQUEST and self._waiting is _Waiting.START:
            self._waiting = _Waiting.BLOCK
            return Step.NOTHING
        if command == ACKNOWLEDGE_BLOCK_REQUEST and self._waiting is _Waiting.BLOCK:
            return self._acknowledge(frame[1])
        if command & COMMAND == REQUEST_SEGMENT_UPLOAD and self._waiting is _Waiting.SEGMENT:
            return Step.NOTHING
        return self._break()  # aborted, or the channel serves another object now

    def response(self, frame: bytes) -> Step:
        """Take a frame of the server."""
        if not self.is_under_way:
            return Step.NOTHING
        if len(frame) != SDO_BYTES or frame[0] == RESPONSE_ABORTED:
            return self._break()
        if self._waiting is _Waiting.ANSWER:
            return self._answer(frame)
        if self._waiting is _Waiting.BLOCK:
            return self._block_segment(frame)
        if self._waiting is _Waiting.SEGMENT and frame[0] & COMMAND == RESPONSE_SEGMENT_UPLOAD:
            return self._segment(frame)
        if self._waiting is _Waiting.END and frame[0] & BLOCK_COMMAND == END_BLOCK_RESPONSE:
            return self._end_block(frame)
        return self._break()

    def _begin(self, client_has_crc: bool) -> None:
        self._waiting = _Waiting.ANSWER
        self._buffer = bytearray()
        self._segments = []
        self._toggle = 0
        self._has_last = False
        self._client_has_crc = client_has_crc

    def _answer(self, frame: bytes) -> Step:
        command = frame[0]
        kind = command & COMMAND
        if frame[1:4] != self._object or kind not in (RESPONSE_UPLOAD, RESPONSE_BLOCK_UPLOAD):
            return self._break()
        if kind == RESPONSE_BLOCK_UPLOAD:
            self._waiting = _Waiting.START
            self._has_crc = self._client_has_crc and bool(command & CRC_SUPPORTED)
            return Step.NOTHING
        if not command & EXPEDITED:
            self._waiting = _Waiting.SEGMENT
            return Step.NOTHING
        unused = command >> 2 & 3 if command & SIZE_SPECIFIED else 0
        self._buffer += frame[4:SDO_BYTES - unused]
        return self._finish()

    def _segment(self, frame: bytes) -> Step:
        if frame[0] & TOGGLE_BIT != self._toggle:  # one is lost or doubled
            return self._break()
        self._toggle ^= TOGGLE_BIT
        unused = frame[0] >> 1 & 7
        self._buffer += frame[1:SDO_BYTES - unused]
        return self._finish() if frame[0] & NO_MORE_DATA else Step.NOTHING

    def _block_segment(self, frame: bytes) -> Step:
        """Only the next one in order counts: the server repeats all segments after a gap."""
        if frame[0] & ~NO_MORE_BLOCKS == len(self._segments) + 1:
            self._segments.append(frame[1:])
            self._has_last = bool(frame[0] & NO_MORE_BLOCKS)
        return Step.NOTHING

    def _acknowledge(self, count: int) -> Step:
        """The client has ``count`` segments of this block; it may have received more of them than we."""
        if count > len(self._segments):
            return self._break()
        is_last = self._has_last and count == len(self._segments)
        self._buffer += b''.join(self._segments[:count])
        self._segments = []
        self._has_last = False
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
        self._waiting = _Waiting.NOTHING
        self.data = bytes(self._buffer)
        return Step.DONE

    def _break(self) -> Step:
        self._waiting = _Waiting.NOTHING
        return Step.BROKEN
