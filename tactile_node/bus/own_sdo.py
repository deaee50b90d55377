"""An SDO client that takes only answers to its own requests: another master may use the same server."""

import queue
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TypeVar

from canopen import ObjectDictionary, SdoAbortedError, SdoCommunicationError
from canopen.sdo import SdoClient, constants

from tactile_node.cia301.objects import SDO_REQUEST, SDO_RESPONSE, ObjectAddress
from tactile_node.cia301.sdo import BLOCK_COMMAND, COMMAND, INITIATE_BLOCK_REQUEST, SDO_BYTES
from tactile_node.errors import DeviceAbsentError, DeviceError, InterruptedSetupError


def read_object(sdo: SdoClient, address: ObjectAddress) -> bytes:
    """Return the bytes of one object. Raises DeviceError."""
    with _refusals(sdo, address, 'be read'):
        with sdo.open(address.index, address.sub, 'rb', buffering=0) as upload:
            announced, data = upload.size, bytes(upload.read())
    if announced is not None and announced != len(data):
        raise DeviceError(_where(sdo, address), expected=f'{announced} bytes, as the device announces',
                          got=f'{len(data)} bytes', remedy='Read it again; another SDO client may have interfered.')
    return data


def write_object(sdo: SdoClient, address: ObjectAddress, data: bytes) -> None:
    """Write ``data``. Raises DeviceError where the device does not confirm it."""
    with _refusals(sdo, address, f'be set to the bytes {data[:8].hex()}{"..." if len(data) > 8 else ""}'):
        sdo.download(address.index, address.sub, data)


@contextmanager
def _refusals(sdo: SdoClient, address: ObjectAddress, what: str) -> Iterator[None]:
    try:
        yield
    except SdoAbortedError as error:
        raise DeviceError(_where(sdo, address), expected=f'that it can {what}', got=f'SDO abort: {error}',
                          remedy="Compare with the device's manual and EDS.") from error
    except SdoCommunicationError as error:
        raise DeviceAbsentError(_where(sdo, address), expected=f'an answer by SDO within {sdo.RESPONSE_TIMEOUT:g} s',
                                got=str(error), remedy='Check power, wiring, bit rate and node-ID; a slow device '
                                'needs a larger --timeout.') from error


def _where(sdo: SdoClient, address: ObjectAddress) -> str:
    return f'node {sdo.rx_cobid & 0x7F}, object {address}'


#: What a server answers to a request that names an object, if it does not abort
ANSWER_COMMANDS = {constants.REQUEST_DOWNLOAD: constants.RESPONSE_DOWNLOAD,
                   constants.REQUEST_UPLOAD: constants.RESPONSE_UPLOAD,
                   constants.REQUEST_BLOCK_UPLOAD: constants.RESPONSE_BLOCK_UPLOAD}


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
        self._answer = constants.RESPONSE_UPLOAD  # to it
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
        has_no_object = data[0] == constants.RESPONSE_ABORTED and not any(data[1:4])
        is_meant = answered == self._object and data[0] & COMMAND in (self._answer, constants.RESPONSE_ABORTED)
        if self._object is None or is_meant or has_no_object:
            super().on_response(can_id, data, timestamp)
        else:
            self.others += 1

    def send_request(self, request: bytes) -> None:
        """Send a request; from now on only answers about its object count."""
        initiates = request[0] & COMMAND in (constants.REQUEST_DOWNLOAD, constants.REQUEST_UPLOAD) \
            or request[0] & BLOCK_COMMAND == INITIATE_BLOCK_REQUEST
        self._object = bytes(request[1:4]) if initiates else None
        if self._object is not None:
            self._answer = ANSWER_COMMANDS[request[0] & COMMAND]
            self._owed[self._object] += 1
            self.requests += 1
            self.responses = queue.Queue()  # what came until now is late
        super().send_request(request)


Answer = TypeVar('Answer')


class DeviceObjects:
    """The objects of the device ``label``; a request without an answer is repeated ``retries`` times.

    Raises DeviceError where the device refuses, DeviceAbsentError where it does not answer, BusError; and
    InterruptedSetupError in place of the next request when ``is_interrupted()``.
    """

    def __init__(self, sdo: SdoClient, label: str, retries: int, is_interrupted: Callable[[], bool]):
        self._sdo = sdo
        self._label = label
        self._tries = 1 + retries
        self._is_interrupted = is_interrupted

    def _read(self, index: int, sub: int) -> int:
        """Read an unsigned number."""
        with self._refusal('be read', index, sub):
            return self._upload(index, sub)

    def _read_if_any(self, index: int, sub: int) -> int | None:
        """Read an unsigned number; None where the device refuses it."""
        with suppress(SdoAbortedError):
            return self._upload(index, sub)
        return None

    def _write(self, index: int, sub: int, value: int, size: int) -> None:
        with self._refusal(f'be set to 0x{value:X}', index, sub):
            self._download(index, sub, value.to_bytes(size, 'little'))

    def _upload(self, index: int, sub: int) -> int:
        return int.from_bytes(self._retried('read', index, sub, lambda: self._sdo.upload(index, sub)), 'little')

    def _download(self, index: int, sub: int, data: bytes) -> None:
        self._retried('write', index, sub, lambda: self._sdo.download(index, sub, data))

    def _retried(self, verb: str, index: int, sub: int, request: Callable[[], Answer]) -> Answer:
        """What ``request`` returns; it is repeated when there is no answer. Raises DeviceAbsentError."""
        silence: SdoCommunicationError | None = None
        for _ in range(self._tries):
            self._check_interrupt()
            try:
                return request()
            except SdoCommunicationError as error:
                silence = error
        timeout = self._tries * self._sdo.RESPONSE_TIMEOUT
        raise DeviceAbsentError(f'{self._label}, object 0x{index:04X} sub {sub}', got=str(silence),
                                expected=f'an answer to a {verb} within {timeout:g} s',
                                remedy='Check the wiring and whether the device is on; a slow one needs a larger '
                                'sdo_timeout.') from silence

    def _check_interrupt(self) -> None:
        if self._is_interrupted():
            raise InterruptedSetupError(self._label, expected='that it is configured', got='a driver that stops',
                                        remedy='Start the driver again.')

    @contextmanager
    def _refusal(self, what: str, index: int, sub: int) -> Iterator[None]:
        try:
            yield
        except SdoAbortedError as error:
            raise DeviceError(f'{self._label}, object 0x{index:04X} sub {sub}', expected=f'that it can {what}',
                              got=f'SDO abort: {error}',
                              remedy="Compare the layout with the device's manual and EDS.") from error
