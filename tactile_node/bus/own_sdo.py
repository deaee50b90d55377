"""An SDO client that takes only answers to its own requests: another master may use the same server."""

import queue
import time

from canopen import ObjectDictionary, SdoCommunicationError
from canopen.sdo import SdoClient
from canopen.sdo.constants import REQUEST_DOWNLOAD, REQUEST_UPLOAD, RESPONSE_ABORTED

from tactile_node.cia301.connection_set import SDO_REQUEST, SDO_RESPONSE
from tactile_node.cia301.sdo import BLOCK_COMMAND, COMMAND, INITIATE_BLOCK_REQUEST, SDO_BYTES


class OwnSdoClient(SdoClient):
    """canopen's client for ``node_id``, with its own timeout [s]; it leaves out answers about other objects.

    These are of another client, or late ones of a request that was given up. An answer about the same object is taken,
    whoever requested it: it is as true. So is an abort without an object, as some servers send it.
    """

    def __init__(self, node_id: int, dictionary: ObjectDictionary, timeout: float):
        super().__init__(SDO_REQUEST + node_id, SDO_RESPONSE + node_id, dictionary)
        self.RESPONSE_TIMEOUT = timeout
        self._object: bytes | None = None  # that the request under way is about; None: of a segment
        self.others = 0  #: answers left out

    def on_response(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Queue an answer; canopen stumbles over shorter ones."""
        if len(data) == SDO_BYTES:
            super().on_response(can_id, data, timestamp)

    def send_request(self, request: bytes) -> None:
        """Send a request and note what it is about."""
        initiates = request[0] & COMMAND in (REQUEST_DOWNLOAD, REQUEST_UPLOAD) \
            or request[0] & BLOCK_COMMAND == INITIATE_BLOCK_REQUEST
        self._object = bytes(request[1:4]) if initiates else None
        super().send_request(request)

    def read_response(self) -> bytes:
        """Return the answer. Raises SdoCommunicationError after the timeout, SdoAbortedError."""
        given, end = self.RESPONSE_TIMEOUT, time.monotonic() + self.RESPONSE_TIMEOUT
        try:
            while self._object is not None:
                answer = self._next(end)
                if answer[1:4] == self._object or answer[0] == RESPONSE_ABORTED and not any(answer[1:4]):
                    self.responses.queue.appendleft(answer)  # canopen's own method takes it from here
                    break
                self.others += 1
            self.RESPONSE_TIMEOUT = max(end - time.monotonic(), 0.001)
            return bytes(super().read_response())
        finally:
            self.RESPONSE_TIMEOUT = given

    def _next(self, end: float) -> bytes:
        try:
            return bytes(self.responses.get(timeout=max(end - time.monotonic(), 0.0)))
        except queue.Empty:
            raise SdoCommunicationError('No SDO response received') from None
