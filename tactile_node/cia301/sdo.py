"""Define service data objects (CiA 301, 7.2.4): commands of block uploads, abort codes, and a tracker of uploads.

``canopen.sdo.constants`` defines the elementary commands. canopen versions before 2.4 lack the abort codes.
"""

import binascii
from enum import Enum, IntEnum

from canopen.sdo import constants

SDO_BYTES = 8  #: length of every SDO frame
SEGMENT_BYTES = 7  #: number of data bytes in one segment
MAX_BLOCK_SEGMENTS = 127  #: largest number of segments in one block
COMMAND = 0xE0  #: mask of the command specifier
BLOCK_COMMAND = 0xE3  #: mask of the command specifier and the sub-command of a block transfer

# Commands that the client sends
INITIATE_BLOCK_REQUEST = constants.REQUEST_BLOCK_UPLOAD | constants.INITIATE_BLOCK_TRANSFER
START_BLOCK_REQUEST = constants.REQUEST_BLOCK_UPLOAD | constants.START_BLOCK_UPLOAD
ACKNOWLEDGE_BLOCK_REQUEST = constants.REQUEST_BLOCK_UPLOAD | constants.BLOCK_TRANSFER_RESPONSE
END_BLOCK_REQUEST = constants.REQUEST_BLOCK_UPLOAD | constants.END_BLOCK_TRANSFER
# Commands that the server sends
INITIATE_BLOCK_RESPONSE = (constants.RESPONSE_BLOCK_UPLOAD | constants.INITIATE_BLOCK_TRANSFER
                           | constants.BLOCK_SIZE_SPECIFIED | constants.CRC_SUPPORTED)
END_BLOCK_RESPONSE = constants.RESPONSE_BLOCK_UPLOAD | constants.END_BLOCK_TRANSFER


class AbortCode(IntEnum):
    """Abort codes with which a server rejects a request.

    The list contains only the abort codes that this package uses.
    """

    INVALID_BLOCK_SIZE = 0x0504_0002
    NOT_MAPPABLE = 0x0604_0041
    PDO_TOO_LONG = 0x0604_0042
    INVALID_VALUE = 0x0609_0030
    WRONG_DEVICE_STATE = 0x0800_0022


def written_object(request: bytes) -> int | None:
    """Return the index of the object that an SDO client starts to write, or None for any other request.

    >>> hex(written_object(bytes.fromhex('2F001A0000000000')))
    '0x1a00'
    >>> written_object(bytes.fromhex('40001A0000000000'))  # an upload
    """
    if len(request) != SDO_BYTES:
        return None
    command = request[0]
    is_block = command & COMMAND == constants.REQUEST_BLOCK_DOWNLOAD and not command & constants.END_BLOCK_TRANSFER
    is_write = is_block or command & COMMAND == constants.REQUEST_DOWNLOAD
    return int.from_bytes(request[1:3], 'little') if is_write else None


class UploadStep(Enum):
    """Effect that a frame has on the upload."""

    NOTHING = 0
    BEGUN = 1
    DONE = 2  #: ``data`` is complete
    BROKEN = 3  #: the transfer was aborted, a frame is missing, or the CRC is wrong


class _Waiting(Enum):
    NOTHING = 0
    ANSWER = 1
    SEGMENT = 2
    START = 3
    BLOCK = 4
    END = 5


class SdoUpload:
    """Follows the upload of one object. After DONE and before the next BEGUN, ``data`` holds the object."""

    def __init__(self, index: int, subindex: int):
        self._object = bytes([index & 0xFF, index >> 8, subindex])
        self._waiting = _Waiting.NOTHING
        self._segments: list[bytes] = []  # segments received in the present block
        self._has_last = False  # True if the present block contains the last segment of the object
        self._client_has_crc = False
        self._has_crc = False  # True if both client and server support a CRC
        self._toggle = 0  # toggle bit expected in the next segment
        self._buffer = bytearray()
        self.data = b''

    @property
    def is_under_way(self) -> bool:
        return self._waiting is not _Waiting.NOTHING

    def request(self, frame: bytes) -> UploadStep:
        """Process a frame from the client and return its effect."""
        command = frame[0] if len(frame) == SDO_BYTES else constants.REQUEST_ABORTED
        is_block = command & BLOCK_COMMAND == INITIATE_BLOCK_REQUEST
        if (is_block or command & COMMAND == constants.REQUEST_UPLOAD) and frame[1:4] == self._object:
            self._begin(is_block and bool(command & constants.CRC_SUPPORTED))
            return UploadStep.BEGUN
        if not self.is_under_way:
            return UploadStep.NOTHING
        if command == START_BLOCK_REQUEST and self._waiting is _Waiting.START:
            self._waiting = _Waiting.BLOCK
            return UploadStep.NOTHING
        if command == ACKNOWLEDGE_BLOCK_REQUEST and self._waiting is _Waiting.BLOCK:
            return self._acknowledge(frame[1])
        if command & COMMAND == constants.REQUEST_SEGMENT_UPLOAD and self._waiting is _Waiting.SEGMENT:
            return UploadStep.NOTHING
        return self._break()  # the upload was aborted, or the channel now transfers another object

    def response(self, frame: bytes) -> UploadStep:
        """Process a frame from the server and return its effect."""
        if not self.is_under_way:
            return UploadStep.NOTHING
        if len(frame) != SDO_BYTES or frame[0] == constants.RESPONSE_ABORTED:
            return self._break()
        if self._waiting is _Waiting.ANSWER:
            return self._answer(frame)
        if self._waiting is _Waiting.BLOCK:
            return self._block_segment(frame)
        if self._waiting is _Waiting.SEGMENT and frame[0] & COMMAND == constants.RESPONSE_SEGMENT_UPLOAD:
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

    def _answer(self, frame: bytes) -> UploadStep:
        command = frame[0]
        kind = command & COMMAND
        if frame[1:4] != self._object or kind not in (constants.RESPONSE_UPLOAD, constants.RESPONSE_BLOCK_UPLOAD):
            return self._break()
        if kind == constants.RESPONSE_BLOCK_UPLOAD:
            self._waiting = _Waiting.START
            self._has_crc = self._client_has_crc and bool(command & constants.CRC_SUPPORTED)
            return UploadStep.NOTHING
        if not command & constants.EXPEDITED:
            self._waiting = _Waiting.SEGMENT
            return UploadStep.NOTHING
        unused = command >> 2 & 3 if command & constants.SIZE_SPECIFIED else 0
        self._buffer += frame[4:SDO_BYTES - unused]
        return self._finish()

    def _segment(self, frame: bytes) -> UploadStep:
        if frame[0] & constants.TOGGLE_BIT != self._toggle:  # a segment was lost or duplicated
            return self._break()
        self._toggle ^= constants.TOGGLE_BIT
        unused = frame[0] >> 1 & 7
        self._buffer += frame[1:SDO_BYTES - unused]
        return self._finish() if frame[0] & constants.NO_MORE_DATA else UploadStep.NOTHING

    def _block_segment(self, frame: bytes) -> UploadStep:
        """Store a segment if it is the next one in the sequence. After a gap, the server repeats all following
        segments."""
        if frame[0] & ~constants.NO_MORE_BLOCKS == len(self._segments) + 1:
            self._segments.append(frame[1:])
            self._has_last = bool(frame[0] & constants.NO_MORE_BLOCKS)
        return UploadStep.NOTHING

    def _acknowledge(self, count: int) -> UploadStep:
        """Process the client's acknowledgement of ``count`` segments.

        The client may have received more segments than we did.
        """
        if count > len(self._segments):
            return self._break()
        is_last = self._has_last and count == len(self._segments)
        self._buffer += b''.join(self._segments[:count])
        self._segments = []
        self._has_last = False
        if is_last:
            self._waiting = _Waiting.END
        return UploadStep.NOTHING

    def _end_block(self, frame: bytes) -> UploadStep:
        unused = frame[0] >> 2 & 7
        if unused:
            del self._buffer[-unused:]
        if self._has_crc and binascii.crc_hqx(self._buffer, 0) != int.from_bytes(frame[1:3], 'little'):
            return self._break()
        return self._finish()

    def _finish(self) -> UploadStep:
        self._waiting = _Waiting.NOTHING
        self.data = bytes(self._buffer)
        return UploadStep.DONE

    def _break(self) -> UploadStep:
        self._waiting = _Waiting.NOTHING
        return UploadStep.BROKEN
