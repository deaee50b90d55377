"""Compare the device setup found in the SDO transfers of a log with the layout and the EDS (CiA 301, 7.2.4).

Values that the log does not contain are not checked. A value is unknown if the log begins after the setup, or if the
device has been reset since. Only expedited transfers are read, because the checked objects have at most 4 bytes.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import can
from canopen.sdo import constants

from tactile_node.assembly.router import non_data_kind
from tactile_node.cia301 import objects
from tactile_node.cia301.heartbeat import nmt_state
from tactile_node.cia301.sdo import COMMAND, SDO_BYTES
from tactile_node.skin.eds_rules import Identity
from tactile_node.skin.layout import TpdoLayout
from tactile_node.skin.pads import PadSettings

WATCHED_OBJECTS = frozenset((objects.IDENTITY, *objects.COMMUNICATION_RECORDS, *objects.MAPPING_RECORDS))


class Contradiction(NamedTuple):
    """A difference between a device in the log and the device's layout or EDS."""

    pad: str
    node_id: int
    object_index: int  #: index of the object that differs: identity, or COB-ID or mapping of a TPDO
    expected: str      #: value from the layout or the EDS
    got: str           #: value in the log


class LoggedSetUp:
    """Reads the SDO transfers of the pads' nodes, and checks each TPDO against the values transferred so far.

    Parameters
    ----------
    pads
        Pads whose nodes are checked.
    identities
        Identities from the EDS by pad name, for the pads with an EDS.
    """

    def __init__(self, pads: Sequence[PadSettings], identities: Mapping[str, Identity]):
        self._takers: dict[int, Callable[[int, bytes], Contradiction | None]] = {}
        for pad in pads:
            for position, node_id in enumerate(pad.node_ids):
                node = _LoggedNode(pad, position, identities.get(pad.name))
                self._takers |= dict.fromkeys(node.can_ids, node.tpdo) | {
                    objects.SDO_REQUEST + node_id: node.request, objects.SDO_RESPONSE + node_id: node.response,
                    objects.HEARTBEAT + node_id: node.heartbeat}

    def feed(self, can_id: int, data: bytes) -> Contradiction | None:
        """Process the next data frame with an 11-bit identifier.

        Returns
        -------
        Contradiction or None
            Evidence that the frame comes from another device or carries other taxels, or None if there is none.
        """
        take = self._takers.get(can_id)
        return None if take is None else take(can_id, data)


class _LoggedNode:
    def __init__(self, pad: PadSettings, position: int, identity: Identity | None):
        self._pad = pad
        self._node_id = pad.node_ids[position]
        self._identity = identity
        self._layout = f'layout {Path(pad.layout.source).name}'
        self._tpdos = {tpdo.cob_id.of(self._node_id): tpdo for tpdo in pad.layout.tpdos if tpdo.node == position}
        self._requested: dict[tuple[int, int], int | None] = {}  # requested value by object, or None for an upload
        self._values: dict[tuple[int, int], int] = {}
        self._unjudged: set[int] = set()  # COB-IDs of TPDOs not yet checked against the latest values

    @property
    def can_ids(self) -> Sequence[int]:
        return tuple(self._tpdos)

    def request(self, _can_id: int, data: bytes) -> None:
        key = _object_of(data)
        if key is None:
            return
        command = data[0] & COMMAND
        if command == constants.REQUEST_DOWNLOAD:
            self._values.pop(key, None)  # until the response arrives, either the old or the new value may be valid
            if data[0] & constants.EXPEDITED:
                self._requested[key] = _value(data)
        elif command == constants.REQUEST_UPLOAD:
            self._requested[key] = None

    def response(self, _can_id: int, data: bytes) -> Contradiction | None:
        key = _object_of(data)
        if key is None or key not in self._requested:
            return None
        command, written = data[0] & COMMAND, self._requested.pop(key)
        if command == constants.RESPONSE_DOWNLOAD and written is not None:
            return self._learn(key, written)
        if command == constants.RESPONSE_UPLOAD and data[0] & constants.EXPEDITED and written is None:
            return self._learn(key, _value(data))
        return None

    def heartbeat(self, _can_id: int, data: bytes) -> None:
        if nmt_state(data) == objects.NmtState.BOOT_UP:  # the device has returned to its stored values
            self._values.clear()
            self._requested.clear()

    def tpdo(self, can_id: int, _data: bytes) -> Contradiction | None:
        if can_id not in self._unjudged:
            return None
        self._unjudged.discard(can_id)
        return next(self._contradictions(can_id, self._tpdos[can_id]), None)

    def _learn(self, key: tuple[int, int], value: int) -> Contradiction | None:
        self._values[key] = value
        if key[0] == objects.IDENTITY:
            return self._judge_identity()
        self._unjudged.update(self._tpdos)
        return None

    def _judge_identity(self) -> Contradiction | None:
        """Return a contradiction if the identity is wrong. Entries that were not read are assumed to be correct."""
        ours = self._identity
        if ours is None:
            return None
        read = [self._values.get((objects.IDENTITY, sub)) for sub in range(1, len(ours) + 1)]
        if ours.accepts(Identity(*(wanted if value is None else value for wanted, value in zip(ours, read)))):
            return None
        return self._contradiction(
            objects.IDENTITY, f'{ours}, as the EDS for {self._layout} says',
            ', '.join(f'{name} 0x{value:X}' for name, value in zip(Identity._fields, read) if value is not None))

    def _contradictions(self, can_id: int, tpdo: TpdoLayout) -> Iterator[Contradiction]:
        communication, mapping = objects.TPDO_COMMUNICATION + tpdo.number - 1, objects.TPDO_MAPPING + tpdo.number - 1
        cob_ids = {index: value for (index, sub), value in self._values.items()
                   if sub == 1 and index < objects.TPDO_MAPPING and not value & objects.DISABLED}
        for index, cob_id in cob_ids.items():
            if index != objects.IDENTITY and (cob_id & objects.ID_MASK == can_id) != (index == communication):
                number = index - objects.TPDO_COMMUNICATION + 1
                yield self._contradiction(index, f'0x{can_id:03X} to be TPDO {tpdo.number}, as {self._layout} says',
                                          f'0x{cob_id & objects.ID_MASK:03X} as TPDO {number}')
        wanted = [objects.SAM_MPDO] if tpdo.is_mpdo else [len(tpdo.mapping), *(mapped.entry for mapped in tpdo.mapping)]
        count = self._values.get((mapping, 0), 0)  # a count of 0 means that the mapping is being changed
        seen = [self._values.get((mapping, sub)) for sub in range(len(wanted))]
        if count and any(value not in (None, ours) for value, ours in zip(seen, wanted)):
            yield self._contradiction(mapping, f'the objects {_text(wanted)} in TPDO {tpdo.number}, as '
                                      f'{self._layout} says', _text(seen))

    def _contradiction(self, index: int, expected: str, got: str) -> Contradiction:
        return Contradiction(self._pad.name, self._node_id, index, expected, got)


def _object_of(data: bytes) -> tuple[int, int] | None:
    """Return index and sub-index of an SDO frame, or None if the object is not watched.

    Segment frames contain no index, but their bytes can look like an index.
    """
    index = int.from_bytes(data[1:3], 'little')
    if len(data) != SDO_BYTES or index not in WATCHED_OBJECTS:
        return None
    return index, data[3]


def _value(data: bytes) -> int:
    unused = data[0] >> 2 & 3 if data[0] & constants.SIZE_SPECIFIED else 0
    return int.from_bytes(data[4:SDO_BYTES - unused], 'little')


def _text(mapping: Sequence[int | None]) -> str:
    if mapping[0] == objects.SAM_MPDO:
        return 'of an MPDO'
    return ' '.join('?' if entry is None else f'{entry:08X}' for entry in mapping[1:]) + f' ({mapping[0]})'


class HeardNodes:
    """Records which nodes are heard in a log, and finds nodes that the given node-IDs may have wrong or lack.

    If a node-ID is wrong, a pad could be assembled from the TPDOs of two other pads. If a node-ID is lacking, all
    TPDOs of a pad are ignored.
    """

    def __init__(self, pads: Sequence[PadSettings]):
        self._neighbours = {pad.name: _neighbours(pad) for pad in pads}
        self._own = {pad.name: set(pad.node_ids) for pad in pads}
        self._layouts = {pad.layout for pad in pads if pad.layout.nodes == 1}
        self._own_cob_ids = {tpdo.cob_id.of(pad.node_ids[tpdo.node]) for pad in pads for tpdo in pad.layout.tpdos}
        self._heard: set[int] = set()
        self._can_ids: set[int] = set()  # identifiers of all data frames

    def feed(self, message: can.Message) -> None:
        """Process the next CAN frame. Node guarding requests are ignored, because the master sends them."""
        if non_data_kind(message) is not None:
            return
        self._can_ids.add(message.arbitration_id)
        node_id = objects.node_of(message.arbitration_id, objects.HEARTBEAT)
        if node_id is not None and message.data:
            self._heard.add(node_id)

    def further_pads(self) -> list[int]:
        """Return the nodes of no pad that send all TPDOs of a pad's layout.

        Each COB-ID counts for one node only: for a node with heartbeats, or else for the lowest node-ID.
        """
        own, left, found = set().union(*self._own.values()), self._can_ids - self._own_cob_ids, []
        for node_id in sorted(range(objects.MIN_NODE_ID, objects.MAX_NODE_ID + 1),
                              key=lambda node_id: node_id not in self._heard):
            for layout in self._layouts:
                cob_ids = {tpdo.cob_id.of(node_id) for tpdo in layout.tpdos if tpdo.cob_id.relative}
                if node_id not in own and cob_ids and cob_ids <= left:
                    left -= cob_ids
                    found.append(node_id)
        return sorted(found)

    def strangers(self) -> dict[str, list[int]]:
        """Return the other nodes that were heard and send a pad's COB-IDs, by pad name.

        A pad is omitted if at least one of its nodes was heard.
        """
        return {name: sorted(found) for name, neighbours in self._neighbours.items()
                if not self._heard & self._own[name] and (found := self._heard & neighbours)}


def _neighbours(pad: PadSettings) -> set[int]:
    """Return the other node-IDs with which a device of this layout would send some of the pad's COB-IDs."""
    tpdos = pad.layout.tpdos
    own = {tpdo.cob_id.of(pad.node_ids[tpdo.node]) for tpdo in tpdos}
    return {node_id for node_id in range(objects.MIN_NODE_ID, objects.MAX_NODE_ID + 1) if node_id not in pad.node_ids
            and any(tpdo.cob_id.of(node_id) in own for tpdo in tpdos if tpdo.cob_id.relative)}
