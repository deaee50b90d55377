"""Server side of the SDO block upload (CiA 301, 7.2.4.3.9 ff.), which canopen's SDO server does not support."""

import binascii
from collections.abc import Callable

from canopen.sdo.constants import NO_MORE_BLOCKS, REQUEST_ABORTED, RESPONSE_ABORTED

from tactile_node.cia301 import sdo


class BlockUploadServer:
    """Serves block uploads for a single object.

    Parameters
    ----------
    index, subindex
        Index and sub-index of the object to serve.
    read
        Called when an upload begins. Returns the bytes to upload.
    send
        Called with each response frame.
    """

    def __init__(self, index: int, subindex: int, read: Callable[[], bytes], send: Callable[[bytes], None]):
        self._object = bytes([index & 0xFF, index >> 8, subindex])
        self._read = read
        self._send = send
        self._data = b''
        self._acknowledged = 0  # number of segments
        self._in_block = 0  # number of segments already sent in the current block
        self._block_size = 0  # number of segments
        self._is_running = False

    def takes(self, request: bytes) -> bool:
        """Answer a request, or return False if the regular SDO server must answer it."""
        if len(request) == sdo.SDO_BYTES and request[0] & sdo.BLOCK_COMMAND == sdo.INITIATE_BLOCK_REQUEST:
            if request[1:4] != self._object:
                return False
            self._begin(request[4])
        elif not self._is_running:
            return False
        elif request[0] == sdo.START_BLOCK_REQUEST:
            self._send_block()
        elif request[0] == sdo.ACKNOWLEDGE_BLOCK_REQUEST:
            self._continue(request[1], request[2])
        else:
            self._is_running = False
            return request[0] in (sdo.END_BLOCK_REQUEST, REQUEST_ABORTED)
        return True

    def _begin(self, block_size: int) -> None:
        if not 1 <= block_size <= sdo.MAX_BLOCK_SEGMENTS:
            reason = sdo.AbortCode.INVALID_BLOCK_SIZE.to_bytes(4, 'little')
            self._send(bytes([RESPONSE_ABORTED]) + self._object + reason)
            return
        self._data = self._read()
        self._acknowledged = 0
        self._block_size = block_size
        self._is_running = True
        self._send(bytes([sdo.INITIATE_BLOCK_RESPONSE]) + self._object + len(self._data).to_bytes(4, 'little'))

    def _send_block(self) -> None:
        rest = self._data[sdo.SEGMENT_BYTES * self._acknowledged:]
        segments = [rest[i:i + sdo.SEGMENT_BYTES] for i in range(0, len(rest), sdo.SEGMENT_BYTES)]
        self._in_block = min(len(segments), self._block_size)
        for number, segment in enumerate(segments[:self._block_size], 1):
            is_last = number == len(segments)
            self._send(bytes([number | NO_MORE_BLOCKS * is_last]) + segment.ljust(sdo.SEGMENT_BYTES, b'\0'))

    def _continue(self, count: int, block_size: int) -> None:
        self._acknowledged += min(count, self._in_block)
        self._block_size = block_size
        if sdo.SEGMENT_BYTES * self._acknowledged < len(self._data):
            self._send_block()
            return
        unused = -len(self._data) % sdo.SEGMENT_BYTES
        crc = binascii.crc_hqx(self._data, 0)
        self._send(bytes([sdo.END_BLOCK_RESPONSE | unused << 2]) + crc.to_bytes(2, 'little') + bytes(5))
