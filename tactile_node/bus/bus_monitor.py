"""Monitor all bus traffic except the taxels, and count the bits of all frames to measure the bus load.

The monitor observes heartbeats, EMCY messages, error frames, and the NMT commands and SDO requests of other masters.
"""

from collections.abc import Callable, Iterable

import can

from tactile_node.assembly.health import ErrorCounters, ForeignCommand
from tactile_node.cia301 import objects
from tactile_node.cia301.emergency import EmergencyLog
from tactile_node.cia301.frame_bits import load_bits
from tactile_node.cia301.heartbeat import Heartbeats, nmt_state
from tactile_node.cia301.sdo import written_object

# Bits in the identifier of an error frame (see linux/can/error.h).
CONTROLLER = 0x004
BUS_OFF = 0x040
RESTARTED = 0x100
COUNTERS = 0x200
# Bits in byte 1 of an error frame whose CONTROLLER bit is set (see linux/can/error.h).
PASSIVE = 0x30
ACTIVE = 0x40

#: Objects that determine which TPDOs a node sends and when it sends them.
DECIDES_TPDOS = frozenset((objects.COB_ID_SYNC, *objects.COMMUNICATION_RECORDS, *objects.MAPPING_RECORDS))


class BusMonitor:
    """State of the nodes and of the CAN controller as observed on one bus.

    The reception thread feeds the monitor, and any thread may read it. The monitor and its counts persist while the bus
    is closed and opened again.

    Parameters
    ----------
    node_ids : iterable of int
        Node-IDs of the pads on the bus.
    on_news : callable
        Function that is called when a node changes state, or when another master sends it an NMT command or changes its
        TPDOs. The callback must return immediately.
    """

    def __init__(self, node_ids: Iterable[int], on_news: Callable[[], None] = lambda: None):
        self.heartbeats = Heartbeats()
        self._on_news = on_news
        self.emergencies = {node_id: EmergencyLog() for node_id in node_ids}
        self.can_frames = 0
        self.bits = 0
        self.foreign_commands = 0
        self.last_command: ForeignCommand | None = None  #: last NMT command from another master to one of our nodes

        #: number of writes by another master to the objects in DECIDES_TPDOS, by node-ID
        self.foreign_writes = dict.fromkeys(self.emergencies, 0)
        self.foreign_requests = dict.fromkeys(self.emergencies, 0)  #: SDO requests from another master, by node-ID

        #: number of writes by another master to the heartbeat time, by node-ID
        self.heartbeat_writes = dict.fromkeys(self.emergencies, 0)
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
        """Forget the states of the nodes and of the controller, because the bus was reopened. The counts stay."""
        self.heartbeats.forget()
        self._reset_errors()

    def feed(self, can_id: int, data: bytes) -> None:
        """Process a received data frame with an 11-bit identifier."""
        self.can_frames += 1
        self.bits += load_bits(len(data))
        watched = self._watched.get(can_id)
        if watched is not None:
            watched(can_id, data)

    def feed_own(self, size: int) -> None:
        """Add a frame sent by this driver to the bus load. The frame has ``size`` data bytes."""
        self.bits += load_bits(size)

    def feed_other(self, message: can.Message) -> None:
        """Add a remote frame, or a frame with a 29-bit identifier, to the bus load.

        The driver ignores the data of the frame.
        """
        self.bits += load_bits(message.dlc, message.is_extended_id, message.is_remote_frame)

    def feed_error(self, message: can.Message) -> bool:
        """Process an error frame from the CAN controller. Return True if the frame reports bus-off."""
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
        """Count an SDO request from another master.

        Writes to the TPDOs or to the heartbeat time of a node are also counted separately.

        The driver does not receive its own requests. After another master has written to a node, the TPDOs may no
        longer match the layout.
        """
        self.foreign_requests[can_id - objects.SDO_REQUEST] += 1
        written = written_object(data)
        if written == objects.PRODUCER_HEARTBEAT_TIME:
            self.heartbeat_writes[can_id - objects.SDO_REQUEST] += 1
        if written in DECIDES_TPDOS:
            self.foreign_writes[can_id - objects.SDO_REQUEST] += 1
            self._on_news()

    def _command(self, _can_id: int, data: bytes) -> None:
        """Record an NMT command from another master. The driver does not receive its own commands."""
        if len(data) < 2 or data[1] and data[1] not in self.emergencies:
            return
        self.last_command = ForeignCommand(data[0], data[1])
        self.foreign_commands += 1
        self._on_news()
