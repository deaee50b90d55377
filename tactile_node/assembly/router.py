"""Routes each CAN frame of a bus or a log to the pad that it belongs to, and counts all others by service."""

import logging
from collections import Counter
from math import inf

import can

from tactile_node.assembly.assembler import FrameAssembler
from tactile_node.assembly.domain_assembler import DomainAssembler
from tactile_node.assembly.frame_source import BusStatistics, OnFrame
from tactile_node.assembly.free_bus import SLOW_BITRATE, FreeBus
from tactile_node.assembly.pad_assembler import Frames, PadAssembler
from tactile_node.assembly.snapshot_assembler import SnapshotAssembler
from tactile_node.assembly.sweep_assembler import SweepAssembler
from tactile_node.cia301.objects import service_of
from tactile_node.skin.pads import PadSettings

logger = logging.getLogger(__name__)


class Router:
    """Routes CAN frames in order and calls ``on_frame(pad name, TaxelFrame)``. Not thread-safe: one thread feeds it.

    Exceptions of ``on_frame`` are counted and logged; reception continues.

    With ``foreign_sync`` the SYNCs on the bus separate the periods; else only calls of ``sync`` do. ``one_clock``:
    the stamps given to ``sync`` and ``feed`` are of one clock. ``bitrate`` [bit/s].
    """

    def __init__(self, pads: tuple[PadSettings, ...], on_frame: OnFrame, foreign_sync: bool = True,
                 one_clock: bool = True, drop_incomplete: bool = False, bitrate: int = SLOW_BITRATE):
        self._assemblers = {pad.name: _assembler(pad, one_clock) for pad in pads}
        self.drop_incomplete(drop_incomplete)
        self._owners = {can_id: (name, assembler, isinstance(assembler, FrameAssembler))
                        for name, assembler in self._assemblers.items() for can_id in assembler.can_ids}
        self._synchronous = [one for one in self._assemblers.values() if isinstance(one, FrameAssembler)]
        self.can_ids = frozenset(self._owners)  #: COB-IDs of the pads' taxels
        self.bus = FreeBus(bitrate)  #: occupied also by what is not fed
        self.is_running = True  #: see ``pause``
        self._foreign_sync = foreign_sync
        self._sync_id = pads[0].layout.sync_cob_id
        self._on_frame = on_frame
        self._counts: Counter[str] = Counter()
        self._consumer_errors = 0

    @property
    def is_in_doubt(self) -> bool:
        """Whether a bus without SYNC has to show how far a node is. From any thread."""
        return any(assembler.is_in_doubt for assembler in self._synchronous)

    def restart(self) -> None:
        self.is_running = True
        self.bus.restart()
        for assembler in self._assemblers.values():
            assembler.restart()

    def resume(self, lost_periods: int) -> None:
        """After an outage: forget the period under way and leave out ``lost_periods`` sequence numbers."""
        self.is_running = True
        self.bus.restart()
        for assembler in self._assemblers.values():
            assembler.resume(lost_periods)

    def start(self, node_id: int) -> None:
        """A node that did not send was started."""
        for assembler in self._assemblers.values():
            assembler.start(node_id)

    def pause(self) -> None:
        """Ignore SYNCs of other devices from now on, so that there are no frames."""
        self.is_running = False

    def drop_incomplete(self, is_wanted: bool) -> None:
        """From now on withhold incomplete taxel frames, or give them."""
        for assembler in self._assemblers.values():
            assembler.drop_incomplete = is_wanted

    def sync(self, stamp: float, late: float = 0.0) -> None:
        """A SYNC, own or foreign, at most ``late`` [s] after ``stamp``: every pad's period ends and the next begins."""
        self.bus.sync(stamp, late)
        for name, assembler in self._assemblers.items():
            self._deliver(name, assembler.sync(stamp, late))

    def feed(self, can_id: int, data: bytes, stamp: float, after: float | None = None) -> None:
        """A data frame with an 11-bit identifier. It came ``after`` this stamp, where its own does not say when."""
        if self.bus.proves(stamp if after is None else after):
            for synchronous in self._synchronous:
                synchronous.settle()
        owner = self._owners.get(can_id)
        if owner is not None and owner[-1]:
            self.bus.take(stamp)
        else:
            self.bus.occupy(stamp)
        if owner is not None:
            name, assembler, has_sync = owner
            self._counts[assembler.service] += 1
            if self.is_running or has_sync:  # without SYNC, what comes while not active is no sample
                self._deliver(name, assembler.feed(can_id, data, stamp))
        elif can_id == self._sync_id:
            self._counts['sync'] += 1
            if self._foreign_sync and self.is_running:
                self.sync(stamp)
        else:
            self._counts[service_of(can_id)] += 1

    def feed_message(self, message: can.Message) -> None:
        """Any python-can message; one that is no 11-bit data frame is only counted."""
        kind = non_data_kind(message)
        if kind is None:
            self.feed(message.arbitration_id, bytes(message.data), message.timestamp)
        else:
            self._counts[kind] += 1
            self.bus.occupy(message.timestamp, inf if message.is_error_frame else None)

    def end(self) -> None:
        """End the last period, since no more CAN frames will come."""
        for name, assembler in self._assemblers.items():
            self._deliver(name, assembler.end_period())

    def statistics(self) -> BusStatistics:
        pads = {name: assembler.statistics() for name, assembler in self._assemblers.items()}
        return BusStatistics(pads, dict(self._counts), consumer_errors=self._consumer_errors)

    def _deliver(self, name: str, frames: Frames) -> None:
        for frame in frames:
            try:
                self._on_frame(name, frame)
            except Exception:
                self._consumer_errors += 1
                logger.exception('on_frame of pad %r failed', name)


def _assembler(pad: PadSettings, one_clock: bool) -> PadAssembler:
    if pad.layout.domain is not None:
        return DomainAssembler(pad.layout, pad.layout.domain, pad.node_ids[0])
    if (event := pad.layout.event_driven) is not None:
        return (SweepAssembler if event.is_sweeps else SnapshotAssembler)(pad.layout, event, pad.node_ids)
    return FrameAssembler(pad.layout, pad.node_ids, one_clock)


def non_data_kind(message: can.Message) -> str | None:
    """Name the kind of a message that is no CANopen data frame: 'error', 'remote' or 'foreign'; None for one."""
    if message.is_error_frame:
        return 'error'
    if message.is_remote_frame:
        return 'remote'
    return 'foreign' if message.is_extended_id or message.is_fd else None
