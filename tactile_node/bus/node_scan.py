"""Finds the CANopen nodes of a bus: listens to heartbeats, then reads a few objects of each by SDO. Writes nothing."""

import threading
import time
from collections.abc import Iterable
from typing import NamedTuple

import can
from canopen import ObjectDictionary, SdoAbortedError, SdoCommunicationError
from canopen.sdo.constants import REQUEST_UPLOAD

from tactile_node.assembly.router import non_data_kind
from tactile_node.bus.bus_network import BusNetwork
from tactile_node.bus.reception import Batch
from tactile_node.cia301.connection_set import HEARTBEAT, SDO_REQUEST, SDO_RESPONSE, node_of
from tactile_node.cia301.heartbeat import TOGGLE
from tactile_node.cia301.objects import DEVICE_NAME, DEVICE_TYPE, IDENTITY, PRODUCER_HEARTBEAT_TIME
from tactile_node.cia301.sdo import SDO_BYTES
from tactile_node.skin.identity import Identity

SPACING = 0.002  #: s between two of the first requests: a bus in use stays usable
ANSWER = 0.5     #: s for the first answer of a node
ASK = bytes((REQUEST_UPLOAD, DEVICE_TYPE & 0xFF, DEVICE_TYPE >> 8, 0, 0, 0, 0, 0))  #: upload of the device type


class FoundNode(NamedTuple):
    """One node as it was heard; None for what it did not say."""

    node_id: int
    answers: bool             #: by SDO
    state: int | None         #: NMT state, by its last heartbeat
    heartbeat_period: float | None  #: between two heartbeats that were heard [s]
    heartbeat_time: float | None    #: 0x1017, as it is set [s]; 0: it sends none
    device_type: int | None
    name: str | None
    identity: Identity


class NodeScan:
    """What was heard on a bus; ``received`` is called on the thread of the reception."""

    def __init__(self) -> None:
        self.can_frames = 0
        self.answered: set[int] = set()
        self._states: dict[int, int] = {}
        self._heard: dict[int, list[float]] = {}
        self._lock = threading.Lock()

    def received(self, batch: Batch) -> None:
        """Note heartbeats and answers to the first request."""
        for message in batch.messages:
            self._note(message)

    def _note(self, message: can.Message) -> None:
        if non_data_kind(message) is not None:
            return
        can_id, data = message.arbitration_id, bytes(message.data)
        with self._lock:
            self.can_frames += 1
            if (alive := node_of(can_id, HEARTBEAT)) is not None and len(data) == 1:
                self._states[alive] = data[0] & ~TOGGLE
                self._heard.setdefault(alive, []).append(time.monotonic())
            elif (answering := node_of(can_id, SDO_RESPONSE)) is not None and len(data) == SDO_BYTES:
                self.answered.add(answering)

    def ask(self, network: BusNetwork, node_ids: Iterable[int]) -> None:
        """Ask for device types, and wait for the last answer. Raises BusError."""
        for node_id in node_ids:
            network.send_message(SDO_REQUEST + node_id, ASK)
            time.sleep(SPACING)
        time.sleep(ANSWER)

    def nodes(self, network: BusNetwork | None) -> list[FoundNode]:
        """Return all that were heard, by node-ID; with a ``network``, what they say of themselves. Raises BusError."""
        with self._lock:
            node_ids = sorted(self.answered | self._states.keys())
        return [self._node(node_id, network if node_id in self.answered else None) for node_id in node_ids]

    def _node(self, node_id: int, network: BusNetwork | None) -> FoundNode:
        said = {} if network is None else _read(network, node_id)
        with self._lock:
            heard = self._heard.get(node_id, [])
            period = (heard[-1] - heard[0]) / (len(heard) - 1) if len(heard) > 1 else None
            state = self._states.get(node_id)
        name, heartbeat = said.get((DEVICE_NAME, 0)), _number(said.get((PRODUCER_HEARTBEAT_TIME, 0)))
        return FoundNode(node_id, network is not None, state, period, None if heartbeat is None else heartbeat / 1000,
                         _number(said.get((DEVICE_TYPE, 0))),
                         None if name is None else name.decode('latin-1').rstrip('\0 '),
                         Identity(*(_number(said.get((IDENTITY, sub))) for sub in (1, 2, 3))))


def _read(network: BusNetwork, node_id: int) -> dict[tuple[int, int], bytes]:
    """Return what can be read of these objects."""
    found = {}
    with network.sdo_client(node_id, ObjectDictionary(), ANSWER) as sdo:
        for index, sub in ((DEVICE_TYPE, 0), (DEVICE_NAME, 0), (PRODUCER_HEARTBEAT_TIME, 0), (IDENTITY, 1),
                           (IDENTITY, 2), (IDENTITY, 3)):
            try:
                found[index, sub] = bytes(sdo.upload(index, sub))
            except (SdoAbortedError, SdoCommunicationError):
                continue
    return found


def _number(data: bytes | None) -> int | None:
    return None if data is None else int.from_bytes(data, 'little')
