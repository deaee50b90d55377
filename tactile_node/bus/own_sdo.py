"""Accept only answers to our own SDO requests, because another master may use the same server."""

import queue
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from canopen import ObjectDictionary, SdoAbortedError, SdoCommunicationError
from canopen.sdo import SdoClient, constants

from tactile_node.cia301.objects import SDO_REQUEST, SDO_RESPONSE, ObjectAddress
from tactile_node.cia301.sdo import BLOCK_COMMAND, COMMAND, INITIATE_BLOCK_REQUEST, SDO_BYTES
from tactile_node.errors import DeviceAbsentError, DeviceError


def read_object(sdo: SdoClient, address: ObjectAddress) -> bytes:
    """Return the bytes of one object. Raise DeviceError if the object cannot be read completely."""
    with _explain_failures(sdo, address, 'be read'):
        with sdo.open(address.index, address.sub, 'rb', buffering=0) as upload:
            announced, data = upload.size, bytes(upload.read())
    if announced is not None and announced != len(data):
        raise DeviceError(_where(sdo, address), expected=f'{announced} bytes, as the device announces',
                          got=f'{len(data)} bytes',
                          remedy='Read the object again; another SDO client may have interfered.')
    return data


def write_object(sdo: SdoClient, address: ObjectAddress, data: bytes) -> None:
    """Write ``data`` to one object. Raise DeviceError if the device does not confirm the write."""
    with _explain_failures(sdo, address, f'be set to the bytes {data[:8].hex()}{"..." if len(data) > 8 else ""}'):
        sdo.download(address.index, address.sub, data)


@contextmanager
def explain_refusal(where: str, what: str) -> Iterator[None]:
    """Turn an SDO abort inside the block into a DeviceError.

    Parameters
    ----------
    where : str
        Node and object to be named in the message.
    what : str
        Operation in the passive voice, such as 'be read'.
    """
    try:
        yield
    except SdoAbortedError as error:
        raise DeviceError(where, expected=f'an object that can {what}', got=f'SDO abort: {error}',
                          remedy="Compare the layout and the request with the device's manual and EDS.") from error


@contextmanager
def _explain_failures(sdo: SdoClient, address: ObjectAddress, what: str) -> Iterator[None]:
    try:
        with explain_refusal(_where(sdo, address), what):
            yield
    except SdoCommunicationError as error:
        raise DeviceAbsentError(_where(sdo, address), expected=f'an answer by SDO within {sdo.RESPONSE_TIMEOUT:g} s',
                                got=str(error), remedy='Check power, wiring, bit rate and node-ID. A slow device '
                                'needs a larger --timeout.') from error


def _where(sdo: SdoClient, address: ObjectAddress) -> str:
    return f'node {sdo.rx_cobid & 0x7F}, object {address}'


#: Command of the expected answer, for each request that names an object. An abort has a different command.
ANSWER_COMMANDS = {constants.REQUEST_DOWNLOAD: constants.RESPONSE_DOWNLOAD,
                   constants.REQUEST_UPLOAD: constants.RESPONSE_UPLOAD,
                   constants.REQUEST_BLOCK_UPLOAD: constants.RESPONSE_BLOCK_UPLOAD}


class OwnSdoClient(SdoClient):
    """canopen's SDO client for one node. The client ignores answers to other requests.

    The client ignores an answer that names another object, and an answer to a write while this client reads. An ignored
    answer is late or belongs to another client. The client accepts any answer that names the requested object, even if
    another client requested it. The client also accepts an abort that names no object, because some servers send such
    aborts. Segments name no object, so the client accepts every answer while it waits for a segment.

    Parameters
    ----------
    node_id : int
        Node-ID of the device.
    dictionary : ObjectDictionary
        Object dictionary of the device.
    timeout : float
        Time allowed for each answer [s].
    owed : Counter
        Number of answers that the node still owes, by object: requests sent minus answers received. All clients of the
        node share this counter, because a delayed device may also answer requests of earlier clients.
    """

    def __init__(self, node_id: int, dictionary: ObjectDictionary, timeout: float, owed: Counter[bytes]):
        super().__init__(SDO_REQUEST + node_id, SDO_RESPONSE + node_id, dictionary)
        self.RESPONSE_TIMEOUT = timeout
        self._object: bytes | None = None  # object of the pending request; None while a segment is pending
        self._answer = constants.RESPONSE_UPLOAD  # command that the answer must have
        self._owed = owed
        self.requests = 0  #: number of requests sent that name an object
        self.doubled = 0  #: number of surplus answers about requested objects, beyond one per request
        self.others = 0  #: answers ignored

    def on_response(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Queue an answer to the pending request.

        Frames of the wrong length are dropped, because canopen raises an exception on them.
        """
        if len(data) != SDO_BYTES:
            return
        answered = bytes(data[1:4])
        if self._owed[answered] > 0:
            self._owed[answered] -= 1
        elif self._object is not None and answered in self._owed:
            self.doubled += 1
        has_no_object = data[0] == constants.RESPONSE_ABORTED and not any(data[1:4])
        is_meant = answered == self._object and data[0] & COMMAND in (self._answer, constants.RESPONSE_ABORTED)
        if self._object is None or is_meant or has_no_object:
            super().on_response(can_id, data, timestamp)
        else:
            self.others += 1

    def send_request(self, request: bytes) -> None:
        """Send a request. After the call, the client accepts only answers that name its object."""
        initiates = request[0] & COMMAND in (constants.REQUEST_DOWNLOAD, constants.REQUEST_UPLOAD) \
            or request[0] & BLOCK_COMMAND == INITIATE_BLOCK_REQUEST
        self._object = bytes(request[1:4]) if initiates else None
        if self._object is not None:
            self._answer = ANSWER_COMMANDS[request[0] & COMMAND]
            self._owed[self._object] += 1
            self.requests += 1
            self.responses = queue.Queue()  # answers already in the queue are late, so the queue is replaced
        super().send_request(request)
