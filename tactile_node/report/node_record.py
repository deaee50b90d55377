"""What the CAN frames of a log say of its nodes: identity, NMT states, heartbeats, EMCYs (CiA 301).

COB-IDs are those of the predefined connection set, which devices rarely change.
"""

from collections.abc import Sequence

import can

from tactile_node.cia301.connection_set import EMCY, HEARTBEAT, SDO_REQUEST, SDO_RESPONSE, node_of
from tactile_node.cia301.emergency import Emergency, decode_emergency
from tactile_node.cia301.heartbeat import TOGGLE
from tactile_node.cia301.nmt import NmtState
from tactile_node.cia301.objects import (
    DEVICE_NAME,
    DEVICE_TYPE,
    HARDWARE_VERSION,
    IDENTITY,
    PRODUCER_HEARTBEAT_TIME,
    SOFTWARE_VERSION,
)
from tactile_node.cia301.sdo_upload import SdoUpload, Step
from tactile_node.report.kept_entries import Ends
from tactile_node.report.model import NmtChange, NodeFacts

#: (index, sub-index) of what a ticket needs to name a device
OBJECTS = ((DEVICE_TYPE, 0), (DEVICE_NAME, 0), (HARDWARE_VERSION, 0), (SOFTWARE_VERSION, 0), (IDENTITY, 1),
           (IDENTITY, 2), (IDENTITY, 3), (IDENTITY, 4), (PRODUCER_HEARTBEAT_TIME, 0))
MOST_VALUES = 4  #: of one object: another one each time comes from a damaged log


class NodeRecords:
    """Takes every CAN frame of a log in turn. ``taken``: COB-IDs of TPDOs and SYNC, which are no EMCY."""

    def __init__(self, pads: Sequence[tuple[str, Sequence[int]]], taken: frozenset[int]):
        self._pads = {node_id: name for name, node_ids in pads for node_id in node_ids}
        self._taken = taken
        self._nodes: dict[int, _Node] = {}

    def feed(self, message: can.Message) -> None:
        can_id = message.arbitration_id
        if can_id in self._taken or message.is_extended_id or message.is_error_frame or message.is_remote_frame:
            return
        for base in (HEARTBEAT, EMCY, SDO_RESPONSE, SDO_REQUEST):
            node_id = node_of(can_id, base)
            if node_id is not None and (base != SDO_REQUEST or node_id in self._nodes or node_id in self._pads):
                self._node(node_id).feed(base, bytes(message.data), message.timestamp)

    def facts(self) -> tuple[NodeFacts, ...]:
        """Of all that were heard, and those of the pads, by node-ID."""
        for node_id in self._pads:
            self._node(node_id)
        return tuple(node.facts(node_id, self._pads.get(node_id)) for node_id, node in sorted(self._nodes.items()))

    def _node(self, node_id: int) -> '_Node':
        if node_id not in self._nodes:
            self._nodes[node_id] = _Node()
        return self._nodes[node_id]


class _Node:
    def __init__(self) -> None:
        self._uploads = {key: SdoUpload(*key) for key in OBJECTS}
        self._objects: dict[tuple[int, int], list[bytes]] = {}
        self._emergencies: Ends[Emergency] = Ends()
        self._nmt: Ends[NmtChange] = Ends()
        self._state: int | None = None
        self._heartbeats = 0
        self._last: float | None = None  # heartbeat
        self._longest: float | None = None

    def feed(self, base: int, data: bytes, stamp: float) -> None:
        if base == HEARTBEAT:
            self._heartbeat(data, stamp)
        elif base == EMCY:
            self._emergencies.add(decode_emergency(data, stamp))
        else:
            self._transfer(base == SDO_REQUEST, data)

    def facts(self, node_id: int, pad: str | None) -> NodeFacts:
        return NodeFacts(
            node_id=node_id, pad=pad, objects={key: tuple(values) for key, values in self._objects.items()},
            emergencies=self._emergencies.kept(), emergency_count=self._emergencies.count, nmt=self._nmt.kept(),
            nmt_count=self._nmt.count, heartbeats=self._heartbeats, longest_pause=self._longest)

    def _heartbeat(self, data: bytes, stamp: float) -> None:
        if not data:
            return
        state = data[0] & ~TOGGLE
        if state == NmtState.BOOT_UP or state != self._state:
            self._nmt.add(NmtChange(stamp, state))
        if state == NmtState.BOOT_UP:
            self._last = None
        else:
            self._heartbeats += 1
            if self._last is not None:
                self._longest = max(self._longest or 0.0, stamp - self._last)
            self._last = stamp
        self._state = state

    def _transfer(self, is_request: bool, data: bytes) -> None:
        for key, upload in self._uploads.items():
            step = upload.request(data) if is_request else upload.response(data)
            if step is Step.DONE:
                values = self._objects.setdefault(key, [])
                if upload.data not in values and len(values) < MOST_VALUES:
                    values.append(upload.data)
