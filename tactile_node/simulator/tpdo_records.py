"""TPDOs of a simulated device.

The communication and mapping records (CiA 301, 7.5.2.37 ff.) determine which TPDOs the device sends, and when.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from canopen.objectdictionary import ODRecord

from tactile_node.cia301 import objects
from tactile_node.skin.layout import SkinLayout
from tactile_node.skin.pads import CanopenNode

#: positions of the objects that contain taxels: {index << 8 | sub: (rank, first bit, number of bits)}
Places = dict[int, tuple[int, int, int]]


class Piece(NamedTuple):
    """Position of a mapped object in the taxel data and in the TPDO.

    Taxel data are stored as 8-byte words, one word for each TPDO of the layout.
    """

    rank: int | None  #: number of the word that contains the object, or None if the object contains no taxels
    start: int  #: first bit of the object in the word
    bits: int  #: number of bits
    to: int  #: first bit of the object in the TPDO


class ConfiguredTpdo(NamedTuple):
    """A TPDO as configured by the master, or one CAN frame of a multiplexed TPDO."""

    can_id: int
    #: n if the TPDO is sent at every n-th SYNC, or 0 if it is sent at the first SYNC after its bytes have changed
    every: int
    length: int  #: number of bytes
    pieces: tuple[Piece, ...]
    whole: int | None  #: rank of the layout's TPDO with the same content, or None
    rank: int = 0  #: position in the layout; TPDOs that are not in the layout come last
    head: bytes = b''  #: first bytes of the CAN frame of a multiplexed TPDO
    event_timer: float = 0.0  #: longest time between two transmissions [s], or 0 for a TPDO that is sent at SYNC
    inhibit_time: float = 0.0  #: shortest time between two transmissions [s]
    is_on_change: bool = False  #: True if the TPDO ignores SYNC and is also sent when its bytes have changed


class TpdoRecords:
    """Compiles the records of one node into TPDOs. ``number(index, sub)`` reads an object of the node."""

    def __init__(self, node: CanopenNode, number: Callable[[int, int], int]):
        self._node = node
        self._number = number
        self.places = _object_places(node.layout)

    @property
    def has_event_timers(self) -> bool:
        return any(self._has(number, objects.EVENT_TIMER) for number in range(objects.MAX_TPDOS))

    def compile(self) -> list[ConfiguredTpdo]:
        """Return the active TPDOs according to the current content of their records, in layout order."""
        found = []
        for number in range(objects.MAX_TPDOS):
            if objects.TPDO_COMMUNICATION + number not in self._node.dictionary:
                continue
            frames = self._frames(number + 1)
            tpdo = self._compile(number, is_multiplexed=any(head for _, head in frames))
            if tpdo is not None:
                found += [tpdo._replace(rank=rank, head=head) for rank, head in frames]
        return sorted(found, key=lambda tpdo: tpdo.rank)

    def _compile(self, number: int, *, is_multiplexed: bool) -> ConfiguredTpdo | None:
        cob_id = self._number(objects.TPDO_COMMUNICATION + number, 1)
        kind = self._number(objects.TPDO_COMMUNICATION + number, objects.TRANSMISSION_TYPE)
        has_timer = kind >= objects.MANUFACTURER_EVENT
        timer = self._time(number, objects.EVENT_TIMER, objects.EVENT_TIMER_UNIT) if has_timer else 0.0
        count = self._number(objects.TPDO_MAPPING + number, 0)
        if cob_id & objects.DISABLED:
            return None
        if count == objects.SAM_MPDO and (kind == objects.MANUFACTURER_EVENT or timer):
            return ConfiguredTpdo(can_id=cob_id & objects.ID_MASK, every=objects.EVERY_SYNC,
                                  length=objects.MAX_PDO_BYTES, pieces=(), whole=None,
                                  event_timer=timer)  # each SYNC starts a scan if there is no timer
        if count in (0, objects.SAM_MPDO) or kind > objects.MAX_SYNCHRONOUS and not timer:
            return None
        pieces, bits = [], 0
        for sub in range(1, count + 1):
            entry = self._number(objects.TPDO_MAPPING + number, sub)
            rank, start, _ = self.places.get(entry >> 8, (None, 0, 0))
            pieces.append(Piece(rank, start, entry & 0xFF, bits))
            bits += entry & 0xFF
        is_whole = not is_multiplexed and all(p.rank == pieces[0].rank is not None and p.start == p.to for p in pieces)
        return ConfiguredTpdo(can_id=cob_id & objects.ID_MASK, every=kind, length=(bits + 7) // 8, pieces=tuple(pieces),
                              whole=pieces[0].rank if is_whole else None, event_timer=timer,
                              inhibit_time=self._time(number, objects.INHIBIT_TIME, objects.INHIBIT_UNIT),
                              is_on_change=kind == objects.PROFILE_EVENT and not is_multiplexed)

    def _time(self, number: int, sub: int, unit: float) -> float:
        """Return a time from the record of TPDO ``number`` [s], or 0 if the record has no such entry."""
        return self._number(objects.TPDO_COMMUNICATION + number, sub) * unit if self._has(number, sub) else 0.0

    def _has(self, number: int, sub: int) -> bool:
        record = self._node.dictionary.get(objects.TPDO_COMMUNICATION + number)
        return isinstance(record, ODRecord) and sub in record.subindices

    def _frames(self, number: int) -> list[tuple[int, bytes]]:
        """Return the rank and the first bytes of each CAN frame of TPDO ``number``."""
        tpdos = self._node.layout.tpdos
        frames = [(rank, tpdo.prefix(self._node.node_id)) for rank, tpdo in enumerate(tpdos) if tpdo.number == number]
        return frames or [(len(tpdos) + number, b'')]


def _object_places(layout: SkinLayout) -> Places:
    """Return the positions of all objects that contain taxels."""
    places: Places = {}
    for rank, tpdo in enumerate(layout.tpdos):
        start = 0
        for mapped in tpdo.mapping:
            places[mapped.index << 8 | mapped.subindex] = (rank, start, mapped.bits)
            start += mapped.bits
    return places


SCAN = 0.005  #: period at which the taxels are checked for changes [s]


class EventSchedule:
    """Schedules the TPDOs with an event timer. TPDOs without an event timer are never due.

    TPDOs of type 254 with the same event timer are due together, after one scan of the taxels. A TPDO of type 255 is
    due when its bytes have changed and its inhibit time has passed since the last transmission. A TPDO of type 255 is
    also due when its event timer expires.

    Parameters
    ----------
    tpdos
        TPDOs of the device.
    now
        Start time of the schedule [s].
    """

    def __init__(self, tpdos: Sequence[ConfiguredTpdo], now: float):
        self._tpdos = [tpdo for tpdo in tpdos if tpdo.event_timer]
        self._due = {tpdo: now for tpdo in self._tpdos}
        self._sent: dict[int, tuple[float, bytes]] = {}  # time and bytes of the last transmission by COB-ID

    def due(self, now: float, data: Callable[[ConfiguredTpdo], bytes]) -> list[ConfiguredTpdo]:
        """Return the TPDOs to send now, in layout order.

        Parameters
        ----------
        now
            Current time [s].
        data
            Function that returns the current bytes of a TPDO.
        """
        return [tpdo for tpdo in self._tpdos
                if (self._is_changed(tpdo, now, data(tpdo)) if tpdo.is_on_change else self._is_timed(tpdo, now))]

    def next(self, now: float) -> float:
        """Return the earliest time at which a TPDO may be due again [s]."""
        scans = [now + SCAN for tpdo in self._tpdos if tpdo.is_on_change]
        return min([*scans, *(self._due[tpdo] for tpdo in self._tpdos if not tpdo.is_on_change)],
                   default=now + SCAN)

    def _is_timed(self, tpdo: ConfiguredTpdo, now: float) -> bool:
        if now < self._due[tpdo]:
            return False
        self._due[tpdo] = now + tpdo.event_timer  # each transmission restarts the timer (CiA 301)
        return True

    def _is_changed(self, tpdo: ConfiguredTpdo, now: float, data: bytes) -> bool:
        sent_at, sent = self._sent.get(tpdo.can_id, (-float('inf'), b''))
        wait = tpdo.event_timer if data == sent else tpdo.inhibit_time
        if now - sent_at < wait:
            return False
        self._sent[tpdo.can_id] = now, data
        return True
