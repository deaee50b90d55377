"""The server's side of SDO block upload (CiA 301, 7.2.4.3.9 on), which canopen's server leaves out."""

import binascii
from collections.abc import Callable

BLOCK_UPLOAD, START, ACKNOWLEDGE, END = 5, 0xA3, 0xA2, 0xA1
ANSWER_WITH_SIZE_AND_CRC, END_OF_UPLOAD, LAST_SEGMENT = 0xC6, 0xC1, 0x80
ABORT, WRONG_BLOCK_SIZE = 0x80, 0x05040002
SEGMENT_BYTES = 7


class BlockUploadServer:
    """Answers block uploads of object ``index``, ``subindex`` with what ``read()`` gives when one begins."""

    def __init__(self, index: int, subindex: int, read: Callable[[], bytes], send: Callable[[bytes], None]):
        self._object = bytes([index & 0xFF, index >> 8, subindex])
        self._read, self._send = read, send
        self._data, self._acknowledged, self._in_block, self._is_running = b'', 0, 0, False

    def takes(self, request: bytes) -> bool:
        """Whether it has answered; what it has not is for the common SDO server."""
        if len(request) == 8 and request[0] >> 5 == BLOCK_UPLOAD and not request[0] & 3:
            if request[1:4] != self._object:
                return False
            self._begin(request[4])
        elif not self._is_running:
            return False
        elif request[0] == START:
            self._send_block()
        elif request[0] == ACKNOWLEDGE:
            self._go_on(request[1], request[2])
        else:
            self._is_running = False
            return request[0] in (END, ABORT)
        return True

    def _begin(self, block_size: int) -> None:
        if not 1 <= block_size <= 127:
            self._send(bytes([ABORT]) + self._object + WRONG_BLOCK_SIZE.to_bytes(4, 'little'))
            return
        self._data, self._acknowledged, self._block_size, self._is_running = self._read(), 0, block_size, True
        self._send(bytes([ANSWER_WITH_SIZE_AND_CRC]) + self._object + len(self._data).to_bytes(4, 'little'))

    def _send_block(self) -> None:
        rest = self._data[SEGMENT_BYTES * self._acknowledged:]
        segments = [rest[i:i + SEGMENT_BYTES] for i in range(0, len(rest), SEGMENT_BYTES)]
        self._in_block = min(len(segments), self._block_size)
        for number, segment in enumerate(segments[:self._block_size], 1):
            is_last = number == len(segments)
            self._send(bytes([number | LAST_SEGMENT * is_last]) + segment.ljust(SEGMENT_BYTES, b'\0'))

    def _go_on(self, count: int, block_size: int) -> None:
        self._acknowledged, self._block_size = self._acknowledged + min(count, self._in_block), block_size
        if SEGMENT_BYTES * self._acknowledged < len(self._data):
            self._send_block()
            return
        unused = -len(self._data) % SEGMENT_BYTES
        crc = binascii.crc_hqx(self._data, 0)
        self._send(bytes([END_OF_UPLOAD | unused << 2]) + crc.to_bytes(2, 'little') + bytes(5))
