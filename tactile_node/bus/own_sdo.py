"""An SDO client that takes only answers to its own requests: another master may use the same server."""

import queue
from collections import Counter

from canopen import ObjectDictionary
from canopen.sdo import SdoClient
from canopen.sdo.constants import (
    REQUEST_BLOCK_UPLOAD,
    REQUEST_DOWNLOAD,
    REQUEST_UPLOAD,
    RESPONSE_ABORTED,
    RESPONSE_BLOCK_UPLOAD,
    RESPONSE_DOWNLOAD,
    RESPONSE_UPLOAD,
)

from tactile_node.cia301.connection_set import SDO_REQUEST, SDO_RESPONSE
from tactile_node.cia301.sdo import BLOCK_COMMAND, COMMAND, INITIATE_BLOCK_REQUEST, SDO_BYTES

#: What a server answers to a request that names an object, if it does not abort
ANSWERS = {REQUEST_DOWNLOAD: RESPONSE_DOWNLOAD, REQUEST_UPLOAD: RESPONSE_UPLOAD,
           REQUEST_BLOCK_UPLOAD: RESPONSE_BLOCK_UPLOAD}


class OwnSdoClient(SdoClient):
    """canopen's client for ``node_id``, with its own timeout [s]; it leaves out answers to other requests.

    Others are of another client, or late answers to a request that was given up: about another object, or to a write
    where this one reads. An answer about the same object counts, also if another client requested it. An abort that
    names no object counts too: some servers send it. ``owed``: answers to all clients of this node by object, requests
    sent less answers received; a device that was held up answers those of clients before.
    """

    def __init__(self, node_id: int, dictionary: ObjectDictionary, timeout: float, owed: Counter[bytes]):
        super().__init__(SDO_REQUEST + node_id, SDO_RESPONSE + node_id, dictionary)
        self.RESPONSE_TIMEOUT = timeout
        self._object: bytes | None = None  # that the request under way is about; None: of a segment
        self._answer = RESPONSE_UPLOAD  # to it
        self._owed = owed
        self.requests = 0  #: that name an object
        self.doubled = 0  #: answers about objects of these, beyond one for each request
        self.others = 0  #: answers left out

    def on_response(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Queue an answer that is ours; canopen stumbles over shorter ones."""
        if len(data) != SDO_BYTES:
            return
        answered = bytes(data[1:4])
        if self._owed[answered] > 0:
            self._owed[answered] -= 1
        elif self._object is not None and answered in self._owed:
            self.doubled += 1
        has_no_object = data[0] == RESPONSE_ABORTED and not any(data[1:4])
        is_meant = answered == self._object and data[0] & COMMAND in (self._answer, RESPONSE_ABORTED)
        if self._object is None or is_meant or has_no_object:
            super().on_response(can_id, data, timestamp)
        else:
            self.others += 1

    def send_request(self, request: bytes) -> None:
        """Send a request; from now on only answers about its object count."""
        initiates = request[0] & COMMAND in (REQUEST_DOWNLOAD, REQUEST_UPLOAD) \
            or request[0] & BLOCK_COMMAND == INITIATE_BLOCK_REQUEST
        self._object = bytes(request[1:4]) if initiates else None
        if self._object is not None:
            self._answer = ANSWERS[request[0] & COMMAND]
            self._owed[self._object] += 1
            self.requests += 1
            self.responses = queue.Queue()  # what came until now is late
        super().send_request(request)
