"""A simulated CANopen device of a skin, for a bus without hardware."""

import logging
import threading
import time
from collections.abc import Callable, Iterator

import canopen
import numpy as np
from canopen import SdoAbortedError

from tactile_node.cia301 import objects
from tactile_node.cia301.objects import NMT
from tactile_node.cia301.sdo import SDO_BYTES, AbortCode
from tactile_node.errors import BusError
from tactile_node.simulator.block_upload import BlockUploadServer
from tactile_node.simulator.tpdo_records import SCAN, ConfiguredTpdo, EventSchedule, Piece, TpdoRecords
from tactile_node.skin.pads import CanopenNode
from tactile_node.skin.taxel_codec import TaxelCodec
from tactile_node.threads import StoppableThread

logger = logging.getLogger(__name__)

#: function that takes the time since the device became OPERATIONAL [s] and returns taxel values (rows, cols) in the
#: layout's unit
TaxelSource = Callable[[float], np.ndarray]
#: function that sends the TPDOs of a sweep, given as pairs of COB-ID and bytes; if the transmit queue has no space for
#: a sweep, the function reads no pair
SendSweep = Callable[[Iterator[tuple[int, bytes]]], None]


class SimulatedDevice:
    """Simulates one node of a pad: a CANopen slave with boot-up, heartbeat, NMT, SDO server and TPDOs.

    The objects 0x1005, 0x1800... and 0x1A00..., as written by the master, determine which TPDOs the device sends. The
    layout only determines which mapped object contains which taxel. TPDOs of types 254 and 255 with an event timer are
    sent without SYNC, as scheduled by `EventSchedule`.

    Parameters
    ----------
    network
        Network to which the device is connected.
    node
        Node-ID, object dictionary and layout.
    source
        Called at each SYNC while the device is OPERATIONAL, with the time since it became OPERATIONAL [s]. Returns the
        taxel values, shape (rows, cols), in the layout's unit.
    send_sweep
        Function that sends the TPDOs requested by a SYNC, or None to send the TPDOs on ``network``.
    """

    def __init__(self, network: canopen.Network, node: CanopenNode, source: TaxelSource,
                 send_sweep: SendSweep | None = None):
        self._network = network
        self._send_sweep = send_sweep or self._send_at_once
        self._source = source
        self._node_id = node.node_id
        self._layout = node.layout
        self._codec = TaxelCodec(node.layout)
        self._records = TpdoRecords(node, self._number)
        self._node = canopen.LocalNode(node.node_id, node.dictionary)
        if node.dictionary.get_variable(objects.IDENTITY, 4) is not None:  # real devices have different serial numbers
            self._node.set_data(objects.IDENTITY, 4, node.node_id.to_bytes(4, 'little'))
        self._node.add_write_callback(self._before_write)
        self._node.add_read_callback(self._read_taxels)
        self._zero: np.ndarray | None = None  # values that the auto-zero of the device subtracts
        self._words = [bytes(8)] * len(node.layout.tpdos)
        self._domain = node.layout.domain
        self._blocks = None if self._domain is None else BlockUploadServer(
            self._domain.index, self._domain.subindex, self._sample,
            lambda data: network.send_message(self._node.sdo.tx_cobid, data))
        self._tpdos: list[ConfiguredTpdo] | None = None
        self._schedule = EventSchedule([], 0.0)
        self._events = StoppableThread(self._send_events, f'events {node.node_id}')
        self._sent: dict[int, bytes] = {}
        self._started = 0.0
        self._syncs = 0
        self._lock = threading.RLock()
        self.frames_sent = 0
        self.refuses_blocks = False  #: True to behave like a device whose SDO server does not support block upload
        self.refuses_start = False  #: True to behave like a device that stays PRE-OPERATIONAL because of an error

    def boot(self) -> None:
        """Switch the device on. The device sends its boot-up message and becomes PRE-OPERATIONAL."""
        self._network.add_node(self._node)
        self._network.unsubscribe(NMT, self._node.nmt.on_command)
        self._network.subscribe(NMT, self._on_nmt)
        self._network.unsubscribe(self._node.sdo.rx_cobid, self._node.sdo.on_request)
        self._network.subscribe(self._node.sdo.rx_cobid, self._on_sdo)
        self._subscribe_sync()
        self._announce()

    def power_off(self) -> None:
        """Switch the device off without any message on the bus. `boot` switches the device on with its defaults."""
        with self._lock:
            if self._node_id not in self._network:
                return
            self._node.nmt.stop_heartbeat()
            self._network.unsubscribe(NMT, self._on_nmt)
            self._network.unsubscribe(self._sync_id, self._on_sync)
            self._network.unsubscribe(self._node.sdo.rx_cobid, self._on_sdo)
            self._network.subscribe(NMT, self._node.nmt.on_command)  # remove_network expects both
            self._network.subscribe(self._node.sdo.rx_cobid, self._node.sdo.on_request)
            del self._network[self._node_id]
            self._forget()
        self._events.stop()  # called without the lock, because the event thread takes the lock

    def lie(self, index: int, subindex: int, data: bytes) -> None:
        """Answer reads of the given object with ``data`` until the next reset."""
        self._node.data_store.setdefault(index, {})[subindex] = data

    @property
    def operational(self) -> bool:
        return self._node.nmt.state == 'OPERATIONAL'

    def _announce(self) -> None:
        self._node.nmt.state = 'INITIALISING'  # sends boot-up
        self._node.nmt.state = 'PRE-OPERATIONAL'

    def _forget(self) -> None:
        self._node.data_store.clear()
        self._tpdos = self._zero = None

    def _subscribe_sync(self) -> None:
        self._sync_id = self._number(objects.COB_ID_SYNC, 0) & objects.ID_MASK
        self._network.subscribe(self._sync_id, self._on_sync)

    def _on_nmt(self, _can_id: int, data: bytearray, timestamp: float) -> None:
        if len(data) < 2 or data[1] not in (objects.ALL_NODES, self._node_id):
            return
        self._apply_nmt(data, timestamp)
        if not self.operational:
            self._events.stop()
        elif self._records.has_event_timers:
            self._events.start()

    def _apply_nmt(self, data: bytearray, timestamp: float) -> None:
        with self._lock:
            if data[0] in (objects.NmtCommand.RESET_NODE, objects.NmtCommand.RESET_COMMUNICATION):
                self._node.nmt.stop_heartbeat()
                self._forget()
                self._network.unsubscribe(self._sync_id, self._on_sync)
                self._subscribe_sync()
                self._announce()
                return
            if self.refuses_start and data[0] == objects.NmtCommand.START:
                return
            was_operational = self.operational
            self._node.nmt.on_command(NMT, data, timestamp)
            if self.operational and not was_operational:
                self._started = timestamp
                self._syncs = 0
                self._sent.clear()
                self._tpdos = None

    def _send_events(self, stopping: threading.Event) -> None:
        due = time.monotonic()
        while not stopping.wait(max(0.0, due - time.monotonic())):
            try:
                due = self._send_due(time.monotonic())
            except BusError as error:
                logger.error('Node %d has stopped sending TPDOs: %s', self._node_id, error)
                return

    def _send_due(self, now: float) -> float:
        """Send the event-driven TPDOs that are due. Return the earliest time at which the next TPDOs may be due."""
        with self._lock:
            if not self.operational:
                return now + SCAN
            if self._tpdos is None:
                self._compile(now)
            self._scan(time.time())
            for tpdo in self._schedule.due(now, self._data):
                self._send_at_once(self._frames(tpdo))
            return self._schedule.next(now)

    def _sample(self) -> bytes:
        return self._codec.encode(self._values(time.time()))

    def _values(self, now: float) -> np.ndarray:
        values = np.asarray(self._source(now - self._started))
        return values if self._zero is None else values - self._zero

    def _zero_channel(self, channel: int, data: bytes) -> None:
        """Zero one channel. Channel 1 is taxel (0, 0), and the other channels follow row by row."""
        if data != objects.ZERO_SIGNATURE:
            raise SdoAbortedError(AbortCode.INVALID_VALUE)
        values = np.asarray(self._source(time.time() - self._started))
        zero = np.zeros(values.shape) if self._zero is None else self._zero.copy()
        zero.flat[channel - 1] = values.flat[channel - 1]
        self._zero = zero

    def _on_sdo(self, can_id: int, data: bytearray, timestamp: float) -> None:
        if len(data) != SDO_BYTES:  # not an SDO request, so canopen's server would raise an exception
            return
        with self._lock:
            if self._blocks is None or self.refuses_blocks or not self._blocks.takes(bytes(data)):
                self._node.sdo.on_request(can_id, data, timestamp)

    def _on_sync(self, _can_id: int, _data: bytearray, timestamp: float) -> None:
        with self._lock:
            if not self.operational or self._domain is not None:
                return
            self._syncs += 1
            self._send_sweep(self._sweep(timestamp))

    def _sweep(self, now: float) -> Iterator[tuple[int, bytes]]:
        self._scan(now)
        for tpdo in self._compile(time.monotonic()) if self._tpdos is None else self._tpdos:
            if not tpdo.event_timer:
                yield from self._answer(tpdo)

    def _scan(self, now: float) -> None:
        payload = self._codec.encode(self._values(now))
        self._words = [payload[i:i + 8] for i in range(0, len(payload), 8)]

    def _send_at_once(self, frames: Iterator[tuple[int, bytes]]) -> None:
        for can_id, data in frames:
            self._network.send_message(can_id, data)

    def _answer(self, tpdo: ConfiguredTpdo) -> Iterator[tuple[int, bytes]]:
        """Yield the CAN frames of the TPDO that are due at the current SYNC."""
        if tpdo.every and self._syncs % tpdo.every:
            return
        if not tpdo.head:
            data = self._data(tpdo)
            if not tpdo.every and self._sent.get(tpdo.can_id) == data:
                return
            self._sent[tpdo.can_id] = data
        yield from self._frames(tpdo)

    def _frames(self, tpdo: ConfiguredTpdo) -> Iterator[tuple[int, bytes]]:
        """Yield the CAN frame of the TPDO with the current taxel values."""
        self.frames_sent += 1
        yield tpdo.can_id, self._data(tpdo)

    def _data(self, tpdo: ConfiguredTpdo) -> bytes:
        if tpdo.head:
            return tpdo.head + self._words[tpdo.rank][len(tpdo.head):tpdo.length]
        if tpdo.whole is not None:
            return self._words[tpdo.whole][:tpdo.length]
        word = sum(self._bits(piece) << piece.to for piece in tpdo.pieces)
        return word.to_bytes(8, 'little')[:tpdo.length]

    def _bits(self, piece: Piece) -> int:
        if piece.rank is None:
            return 0
        return int.from_bytes(self._words[piece.rank], 'little') >> piece.start & (1 << piece.bits) - 1

    def _compile(self, now: float) -> list[ConfiguredTpdo]:
        """Compile the TPDOs from the current content of their records, and schedule the event-driven TPDOs."""
        self._tpdos = self._records.compile()
        self._schedule = EventSchedule(self._tpdos, now)
        return self._tpdos

    def _number(self, index: int, sub: int) -> int:
        return int.from_bytes(self._node.get_data(index, sub), 'little')

    def _read_taxels(self, index: int, subindex: int, od: object) -> int | bytes | None:
        if self._domain is not None and (index, subindex) == (self._domain.index, self._domain.subindex):
            return self._sample()
        place = self._records.places.get(index << 8 | subindex)
        if place is None:
            return None
        value = self._bits(Piece(*place, 0))
        signed = getattr(od, 'data_type', 0) in canopen.objectdictionary.SIGNED_TYPES
        return value - (value >> place[2] - 1 << place[2]) if signed else value

    def _before_write(self, index: int, subindex: int, data: bytes, **_: object) -> None:
        """Apply the CiA 301 rules for writes to PDO records. Raises the SDO abort that a strict device would send."""

        if index == objects.AUTO_ZERO:
            self._zero_channel(subindex, bytes(data))
            return
        communication = objects.TPDO_COMMUNICATION + (index & objects.MAX_TPDOS - 1)
        if index in objects.MAPPING_RECORDS:
            if not self._number(communication, 1) & objects.DISABLED:
                raise SdoAbortedError(AbortCode.WRONG_DEVICE_STATE)
            self._check_mapping(index, subindex, int.from_bytes(data, 'little'))
        elif index == communication and subindex == 1:
            now, new = self._number(index, 1), int.from_bytes(data, 'little')
            if not now & objects.DISABLED and (now ^ new) & objects.ID_MASK:
                raise SdoAbortedError(AbortCode.WRONG_DEVICE_STATE)
        elif (index == communication and subindex == objects.INHIBIT_TIME
                and not self._number(index, 1) & objects.DISABLED):
            raise SdoAbortedError(AbortCode.WRONG_DEVICE_STATE)
        self._tpdos = None

    def _check_mapping(self, index: int, subindex: int, value: int) -> None:
        if subindex == 0 and value == objects.SAM_MPDO:
            if not any(tpdo.is_mpdo for tpdo in self._layout.tpdos):
                raise SdoAbortedError(AbortCode.NOT_MAPPABLE)
        elif subindex == 0:
            bits = sum(self._number(index, sub) & 0xFF for sub in range(1, value + 1))
            if bits > objects.MAX_PDO_BITS:
                raise SdoAbortedError(AbortCode.PDO_TOO_LONG)
        elif self._number(index, 0) != 0:
            raise SdoAbortedError(AbortCode.WRONG_DEVICE_STATE)
        elif value and value >> 8 not in self._records.places:
            raise SdoAbortedError(AbortCode.NOT_MAPPABLE)
