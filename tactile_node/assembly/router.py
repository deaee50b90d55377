"""Gives each CAN frame of a bus or a log to the pad it belongs to, and counts all others by service."""

from collections import Counter
from collections.abc import Collection

import can

from tactile_node.assembly.assembler import FrameAssembler
from tactile_node.assembly.domain_assembler import DomainAssembler
from tactile_node.cia301.connection_set import service_of
from tactile_node.frames.consumer import OnFrame
from tactile_node.frames.losses import BusStatistics, Results
from tactile_node.frames.taxel_frame import TaxelFrame
from tactile_node.skin.pads import PadSettings


class Router:
    """Routes frames in order; not thread-safe, one thread feeds it.

    With ``foreign_sync`` the SYNCs on the bus part the periods; else only calls of ``sync`` do. ``one_clock``
    says that the stamps given to ``sync`` and ``feed`` can be compared.
    """

    def __init__(self, pads: tuple[PadSettings, ...], on_frame: OnFrame, foreign_sync: bool = True,
                 one_clock: bool = True, drop_incomplete: bool = False):
        self._assemblers = {pad.name: _assembler(pad, one_clock, drop_incomplete) for pad in pads}
        self._owner = {can_id: (name, assembler.feed, assembler.service)
                       for name, assembler in self._assemblers.items() for can_id in assembler.can_ids}
        self.is_running = True  #: see ``pause``
        self._foreign_sync, self._sync_id = foreign_sync, pads[0].layout.sync_cob_id
        self._on_frame = on_frame
        self._counts: Counter[str] = Counter()

    @property
    def can_ids(self) -> Collection[int]:
        """COB-IDs of the pads' taxels."""
        return self._owner.keys()

    def restart(self) -> None:
        self.is_running = True
        for assembler in self._assemblers.values():
            assembler.restart()

    def resume(self, lost_periods: int) -> None:
        """After an outage: forget the period under way, leave out the sequence numbers of those lost."""
        self.is_running = True
        for assembler in self._assemblers.values():
            assembler.resume(lost_periods)

    def start(self, node_id: int) -> None:
        """A node that did not send was told to start."""
        for assembler in self._assemblers.values():
            assembler.start(node_id)

    def pause(self) -> None:
        """SYNCs of others part no periods from now on, so there are no frames."""
        self.is_running = False

    def drop_incomplete(self, is_wanted: bool) -> None:
        """From now on drop incomplete taxel frames, or give them."""
        for assembler in self._assemblers.values():
            assembler.drop_incomplete = is_wanted

    def sync(self, stamp: float) -> None:
        """A SYNC, own or foreign: every pad's period ends and the next begins."""
        for name, assembler in self._assemblers.items():
            self._hand_over(name, assembler.sync(stamp))

    def feed(self, can_id: int, data: bytes, stamp: float) -> None:
        """A data frame with an 11-bit identifier."""
        owner = self._owner.get(can_id)
        if owner is not None:
            name, feed, service = owner
            self._counts[service] += 1
            if self.is_running or service == 'tpdo':  # an upload of a driver that is not active is none of a sample
                self._hand_over(name, feed(can_id, data, stamp))
        elif can_id == self._sync_id:
            self._counts['sync'] += 1
            if self._foreign_sync and self.is_running:
                self.sync(stamp)
        else:
            self._counts[service_of(can_id)] += 1

    def feed_message(self, message: can.Message) -> None:
        """Any python-can message: what is no 11-bit data frame is counted."""
        kind = oddity_of(message)
        if kind is None:
            self.feed(message.arbitration_id, bytes(message.data), message.timestamp)
        else:
            self._counts[kind] += 1

    def end(self) -> None:
        """No more frames will come: give the frames of the last period."""
        for name, assembler in self._assemblers.items():
            self._hand_over(name, assembler.end_period())

    def statistics(self) -> BusStatistics:
        pads = {name: assembler.statistics() for name, assembler in self._assemblers.items()}
        return BusStatistics(pads, dict(self._counts))

    def _hand_over(self, name: str, outcome: Results) -> None:
        for result in outcome:
            if isinstance(result, TaxelFrame):
                self._on_frame(name, result)


def _assembler(pad: PadSettings, one_clock: bool, drop_incomplete: bool) -> FrameAssembler | DomainAssembler:
    if pad.layout.domain is not None:
        return DomainAssembler(pad.layout, pad.node_ids[0], drop_incomplete)
    return FrameAssembler(pad.layout, pad.node_ids, one_clock, drop_incomplete)


def oddity_of(message: can.Message) -> str | None:
    """Why a message can be no CANopen data frame: 'error', 'remote' or 'foreign'; None when it can."""
    if message.is_error_frame:
        return 'error'
    if message.is_remote_frame:
        return 'remote'
    return 'foreign' if message.is_extended_id or message.is_fd else None
