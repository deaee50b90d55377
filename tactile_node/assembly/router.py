"""Route each CAN frame of a bus or a log to its pad, and count all frames by service."""

import logging
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf

import can

from tactile_node.assembly.domain_assembler import DomainAssembler
from tactile_node.assembly.facts import BusFacts
from tactile_node.assembly.free_bus import SLOW_BITRATE, BatchArrival, FreeBus
from tactile_node.assembly.pad_assembler import PadAssembler, TaxelFrames
from tactile_node.assembly.snapshot_assembler import SnapshotAssembler
from tactile_node.assembly.sweep_assembler import SweepAssembler
from tactile_node.assembly.sync_assembler import SyncAssembler
from tactile_node.cia301.objects import service_of
from tactile_node.skin.pads import PadSettings
from tactile_node.taxel_frame import TaxelFrame

logger = logging.getLogger(__name__)

#: Function that receives the name of a pad and each of its taxel frames.
OnFrame = Callable[[str, TaxelFrame], None]
#: A received message with its kind (`non_data_kind`) and its stamp [s].
StampedMessage = tuple[can.Message, str | None, float]


class Router:
    """Routes CAN frames in the order of their arrival, and calls ``on_frame`` with each taxel frame.

    A router is not thread-safe: only one thread may feed it. If ``on_frame`` raises an exception, the router counts and
    logs the exception, and continues.

    Parameters
    ----------
    pads : tuple of PadSettings
        Pads on the bus.
    on_frame : callable
        Function that is called with the name of the pad and each taxel frame.
    acquired : callable
        Function that returns the time on the steady clock that a stamp denotes [s]; -inf if not known.
    foreign_sync : bool
        True if SYNCs received from the bus also separate the periods; False if only calls to ``sync`` do.
    one_clock : bool
        True if the stamps passed to ``sync`` and ``feed`` come from one clock.
    drop_incomplete : bool
        True to withhold incomplete taxel frames.
    bitrate : int
        Bit rate [bit/s].
    """

    def __init__(self, pads: tuple[PadSettings, ...], on_frame: OnFrame,
                 acquired: Callable[[float], float] = lambda stamp: -inf, foreign_sync: bool = True,
                 one_clock: bool = True, drop_incomplete: bool = False, bitrate: int = SLOW_BITRATE):
        self._assemblers = {pad.name: _assembler(pad, one_clock) for pad in pads}
        self.withhold_incomplete(drop_incomplete)
        self._owners = {can_id: (name, assembler) for name, assembler in self._assemblers.items()
                        for can_id in assembler.can_ids}
        self.can_ids = frozenset(self._owners)  #: COB-IDs of the TPDOs or SDOs that carry taxels
        self._free_bus = FreeBus(bitrate)
        self.is_running = True  #: see ``pause``
        self._foreign_sync = foreign_sync
        self._sync_id = pads[0].layout.sync_cob_id
        self._on_frame = on_frame
        self._acquired = acquired
        self._counts: Counter[str] = Counter()
        self._consumer_errors = 0

    @property
    def is_in_doubt(self) -> bool:
        """True if no SYNC may be sent until the driver knows how far each node has got.

        Any thread may read this property.
        """
        return any(assembler.is_in_doubt for assembler in self._assemblers.values())

    def restart(self) -> None:
        """Discard unfinished frames. The next taxel frame of each pad has sequence number 0."""
        self.is_running = True
        self._free_bus.restart()
        for assembler in self._assemblers.values():
            assembler.restart()

    def resume(self, lost_periods: int) -> None:
        """Continue after an outage: discard unfinished frames and skip ``lost_periods`` sequence numbers."""
        self.is_running = True
        self._free_bus.restart()
        for assembler in self._assemblers.values():
            assembler.resume(lost_periods)

    def node_started(self, node_id: int) -> None:
        """Record that a silent node was started."""
        for assembler in self._assemblers.values():
            assembler.node_started(node_id)

    def pause(self) -> None:
        """From now on, ignore SYNCs from other devices and the data of pads without SYNC.

        A pad with SYNC still emits the sweeps that have begun, as soon as their TPDOs have arrived.
        """
        self.is_running = False

    def withhold_incomplete(self, is_wanted: bool) -> None:
        """Withhold incomplete taxel frames from now on if ``is_wanted`` is True; emit them otherwise."""
        for assembler in self._assemblers.values():
            assembler.drop_incomplete = is_wanted

    def sync(self, stamp: float, late: float = 0.0) -> None:
        """End the period of every pad and begin the next one, because this driver or another device sent a SYNC.

        The arguments are those of `FreeBus.sync`.
        """
        self._free_bus.sync(stamp, late)
        for name, assembler in self._assemblers.items():
            self._deliver(name, assembler.sync(stamp, late))

    def feed(self, can_id: int, data: bytes, stamp: float, after: float | None = None) -> None:
        """Process a data frame with an 11-bit identifier.

        Parameters
        ----------
        can_id : int
            Identifier of the frame.
        data : bytes
            Data of the frame.
        stamp : float
            Stamp of the frame [s].
        after : float or None
            Earliest time at which the frame may have arrived [s]; None if it arrived at its stamp.
        """
        if self._free_bus.nothing_pending(stamp if after is None else after):
            for each in self._assemblers.values():
                each.bus_was_free()
        owner = self._owners.get(can_id)
        if owner is None:
            self._free_bus.saw_frame(stamp)
            self._feed_other(can_id, stamp)
            return
        name, assembler = owner
        self._counts[assembler.service] += 1
        if assembler.answers_sync:
            self._free_bus.saw_tpdo(stamp)
        else:
            self._free_bus.saw_frame(stamp)
        if self.is_running or assembler.answers_sync:  # pads without SYNC send even while the driver is inactive
            if frames := assembler.feed(can_id, data, stamp):
                self._deliver(name, frames)

    def feed_batch(self, stamped: Sequence[StampedMessage], arrival: BatchArrival) -> None:
        """Process messages of a live bus that were read together. The caller counts those that are no data frames.

        Parameters
        ----------
        stamped : sequence of StampedMessage
            Messages in the order of reception.
        arrival : BatchArrival
            The time in which they arrived.
        """
        interval, most_free = arrival
        for message, kind, stamp in stamped:
            after, until = interval or (stamp, stamp)
            if not message.is_error_frame:
                self._free_bus.arrived(after, until, most_free)
            if kind is None:
                self.feed(message.arbitration_id, bytes(message.data), stamp, after)
            else:
                self._saw_other(message, stamp)

    def feed_message(self, message: can.Message) -> None:
        """Process a message of a log with its own timestamp.

        A message that is not a data frame with an 11-bit identifier is counted, and occupies the bus.
        """
        kind = non_data_kind(message)
        if kind is None:
            self.feed(message.arbitration_id, bytes(message.data), message.timestamp)
        else:
            self._counts[kind] += 1
            self._saw_other(message, message.timestamp)

    def end(self) -> None:
        """End the last period of each pad, because no more CAN frames will follow."""
        for name, assembler in self._assemblers.items():
            self._deliver(name, assembler.end_period())

    def facts(self) -> BusFacts:
        """Return the counts since construction."""
        pads = tuple(replace(assembler.facts(), pad=name) for name, assembler in self._assemblers.items())
        return BusFacts(pads, can_frames=dict(self._counts), error_frames=self._counts['error'],
                        consumer_errors=self._consumer_errors)

    def _saw_other(self, message: can.Message, stamp: float) -> None:
        """Record that a message without data occupied the bus at ``stamp`` [s]."""
        saw = self._free_bus.saw_error if message.is_error_frame else self._free_bus.saw_frame
        saw(stamp)

    def _feed_other(self, can_id: int, stamp: float) -> None:
        """Count a frame that belongs to no pad, and begin the next period if it is a SYNC."""
        if can_id != self._sync_id:
            self._counts[service_of(can_id)] += 1
            return
        self._counts['sync'] += 1
        if self._foreign_sync and self.is_running:
            self.sync(stamp)

    def _deliver(self, name: str, frames: TaxelFrames) -> None:
        """Call ``on_frame`` with each frame and its time of acquisition."""
        for frame in frames:
            try:
                self._on_frame(name, frame._replace(acquired=self._acquired(frame.stamp)))
            except Exception:
                self._consumer_errors += 1
                logger.exception('on_frame of pad %r failed', name)


def _assembler(pad: PadSettings, one_clock: bool) -> PadAssembler:
    if pad.layout.domain is not None:
        return DomainAssembler(pad.layout, pad.layout.domain, pad.node_ids[0])
    if (event := pad.layout.event_driven) is not None:
        return (SweepAssembler if event.is_sweeps else SnapshotAssembler)(pad.layout, event, pad.node_ids)
    return SyncAssembler(pad.layout, pad.node_ids, one_clock)


def non_data_kind(message: can.Message) -> str | None:
    """Return the kind of a message that is not a CANopen data frame: 'error', 'remote' or 'foreign'.

    For a CANopen data frame, return None. Frames with a 29-bit identifier and CAN FD frames are 'foreign'.
    """
    if message.is_error_frame:
        return 'error'
    if message.is_remote_frame:
        return 'remote'
    return 'foreign' if message.is_extended_id or message.is_fd else None
