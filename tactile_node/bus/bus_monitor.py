"""What is received beside taxels: heartbeats, EMCY, other masters' NMT commands, error frames; the bits of all."""

from collections.abc import Callable, Iterable

import can

from tactile_node.assembly.health import ErrorCounters, ForeignCommand
from tactile_node.cia301 import objects
from tactile_node.cia301.emergency import EmergencyLog
from tactile_node.cia301.frame_bits import load_bits
from tactile_node.cia301.heartbeat import Heartbeats, nmt_state
from tactile_node.cia301.sdo import written_object

#: linux/can/error.h: bits of an error frame's identifier; of byte 1 when the controller reports
BUS_OFF, CONTROLLER, RESTARTED, COUNTERS = 0x040, 0x004, 0x100, 0x200
PASSIVE, ACTIVE = 0x30, 0x40

#: objects that decide what TPDOs a node sends, and when
DECIDES_TPDOS = frozenset((objects.COB_ID_SYNC, *objects.COMMUNICATION_RECORDS, *objects.MAPPING_RECORDS))


class BusMonitor:
    """Fed on the thread of the reception, read from any; lasts while the bus is closed and opened again.

    ``on_news()`` is called when a node's state changes or another master sends a command or changes what a node sends;
    it must return at once.
    """

    def __init__(self, node_ids: Iterable[int], on_news: Callable[[], None] = lambda: None):
        self.heartbeats = Heartbeats()
        self._on_news = on_news
        self.emergencies = {node_id: EmergencyLog() for node_id in node_ids}
        self.can_frames = 0
        self.bits = 0
        self.foreign_commands = 0
        self.last_command: ForeignCommand | None = None  #: sent by another master to one of our nodes
        self.foreign_writes = dict.fromkeys(self.emergencies, 0)  #: by another master, to what decides a node's TPDOs
        self.foreign_requests = dict.fromkeys(self.emergencies, 0)  #: by SDO, of another master
        self.heartbeat_writes = dict.fromkeys(self.emergencies, 0)  #: by another master, to a node's heartbeat time
        self.is_error_passive = False
        self.error_counters = ErrorCounters()
        self._watched: dict[int, Callable[[int, bytes], object]] = {objects.NMT: self._command}
        for other in range(objects.MIN_NODE_ID, objects.MAX_NODE_ID + 1):
            self._watched[objects.HEARTBEAT + other] = self.heartbeats.feed
        for node_id, emergencies in self.emergencies.items():
            self._watched[objects.HEARTBEAT + node_id] = self._heartbeat
            self._watched[objects.EMCY + node_id] = emergencies.feed
            self._watched[objects.SDO_REQUEST + node_id] = self._request

    def restart(self) -> None:
        """The bus was opened again."""
        self.heartbeats.forget()
        self._reset_errors()

    def feed(self, can_id: int, data: bytes) -> None:
        """A data frame of another node, with an 11-bit identifier."""
        self.can_frames += 1
        self.bits += load_bits(len(data))
        watched = self._watched.get(can_id)
        if watched is not None:
            watched(can_id, data)

    def feed_own(self, size: int) -> None:
        """A frame of ``size`` bytes that we sent; it counts for the load."""
        self.bits += load_bits(size)

    def feed_other(self, message: can.Message) -> None:
        """Count a remote frame, or one with a 29-bit identifier, for the load: nothing else of it is used."""
        self.bits += load_bits(message.dlc, message.is_extended_id, message.is_remote_frame)

    def feed_error(self, message: can.Message) -> bool:
        """An error frame of the controller; True when it reports bus-off."""
        kind, data = message.arbitration_id, message.data
        if kind & CONTROLLER and len(data) > 1:
            self.is_error_passive = bool(data[1] & PASSIVE) and not data[1] & ACTIVE
        if kind & (CONTROLLER | COUNTERS) and len(data) == 8:
            self.error_counters = ErrorCounters(data[6], data[7])
        if kind & RESTARTED:
            self._reset_errors()
        return bool(kind & BUS_OFF)

    def _reset_errors(self) -> None:
        self.is_error_passive = False
        self.error_counters = ErrorCounters()

    def _heartbeat(self, can_id: int, data: bytes) -> None:
        if self.heartbeats.feed(can_id, data):
            if nmt_state(data) == objects.NmtState.BOOT_UP:
                self.emergencies[can_id - objects.HEARTBEAT].booted()
            self._on_news()

    def _request(self, can_id: int, data: bytes) -> None:
        """Own requests are not received. What this one writes may not mean what the layout says."""
        self.foreign_requests[can_id - objects.SDO_REQUEST] += 1
        written = written_object(data)
        if written == objects.PRODUCER_HEARTBEAT_TIME:
            self.heartbeat_writes[can_id - objects.SDO_REQUEST] += 1
        if written in DECIDES_TPDOS:
            self.foreign_writes[can_id - objects.SDO_REQUEST] += 1
            self._on_news()

    def _command(self, _can_id: int, data: bytes) -> None:
        """Own commands are not received, so this one is another master's."""
        if len(data) < 2 or data[1] and data[1] not in self.emergencies:
            return
        self.last_command = ForeignCommand(data[0], data[1])
        self.foreign_commands += 1
        self._on_news()
