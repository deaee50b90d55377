"""The TPDOs of a simulated device, by its communication and mapping records (CiA 301, 7.5.2.37 on); their events."""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from canopen.objectdictionary import ODRecord

from tactile_node.cia301 import objects
from tactile_node.skin.layout import SkinLayout
from tactile_node.skin.pads import CanopenNode

#: {index << 8 | sub: (rank, first bit, bits)} of every object that holds taxels
Places = dict[int, tuple[int, int, int]]


class Piece(NamedTuple):
    """A mapped object's place: from which word of the taxels, which bits, to which bits of the TPDO."""

    rank: int | None  #: None: the object holds no taxels
    start: int
    bits: int
    to: int


class ConfiguredTpdo(NamedTuple):
    """A TPDO as the master has configured it, or one frame of a multiplexed one."""

    can_id: int
    every: int  #: sent at each so many SYNCs; 0: when its bytes have changed
    length: int
    pieces: tuple[Piece, ...]
    whole: int | None  #: the rank of the layout's TPDO that it equals
    rank: int = 0  #: its place in the layout; those that are not in it come last
    head: bytes = b''  #: the first bytes of the frame of a multiplexed one
    event_timer: float = 0.0  #: > 0: not sent at a SYNC, but at least so often [s]
    inhibit_time: float = 0.0  #: at most so often [s]
    is_on_change: bool = False  #: without SYNC: also when its bytes have changed


class TpdoRecords:
    """Compiles the records of one node; ``number(index, sub)`` reads its objects."""

    def __init__(self, node: CanopenNode, number: Callable[[int, int], int]):
        self._node = node
        self._number = number
        self.places = _object_places(node.layout)

    @property
    def has_event_timers(self) -> bool:
        return any(self._has(number, objects.EVENT_TIMER) for number in range(objects.MAX_TPDOS))

    def compile(self, numbers: Iterable[int]) -> list[ConfiguredTpdo]:
        """Return the TPDOs ``numbers`` (from 0) that are sent, as their records stand now, in the layout's order."""
        found = []
        for number in numbers:
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
                                  event_timer=timer)  # without it: a scan for each SYNC
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
        """A time of TPDO ``number`` [s]; 0 where the device does not have it."""
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
    """{index << 8 | sub: (rank, first bit, bits)} of every object that holds taxels."""
    places: Places = {}
    for rank, tpdo in enumerate(layout.tpdos):
        start = 0
        for mapped in tpdo.mapping:
            places[mapped.index << 8 | mapped.subindex] = (rank, start, mapped.bits)
            start += mapped.bits
    return places


SCAN = 0.005  # s between two looks at the taxels for what has changed


class EventSchedule:
    """Schedule of the ``tpdos`` that have an event timer, from ``now`` on; others are never due.

    Type 254: all that have the same event timer are due together, one scan after another. Type 255: each when its
    bytes have changed, not sooner than its inhibit time after it was sent, and at the latest after its event timer.
    """

    def __init__(self, tpdos: Sequence[ConfiguredTpdo], now: float):
        self._tpdos = [tpdo for tpdo in tpdos if tpdo.event_timer]
        self._due = {tpdo: now for tpdo in self._tpdos}
        self._sent: dict[int, tuple[float, bytes]] = {}  # when and what, by COB-ID

    def due(self, now: float, data: Callable[[ConfiguredTpdo], bytes]) -> list[ConfiguredTpdo]:
        """Return those to send now, in order; ``data``: what each would send."""
        return [tpdo for tpdo in self._tpdos
                if (self._is_changed(tpdo, now, data(tpdo)) if tpdo.is_on_change else self._is_timed(tpdo, now))]

    def next(self, now: float) -> float:
        """When something may be due again."""
        scans = [now + SCAN for tpdo in self._tpdos if tpdo.is_on_change]
        return min([*scans, *(self._due[tpdo] for tpdo in self._tpdos if not tpdo.is_on_change)],
                   default=now + SCAN)

    def _is_timed(self, tpdo: ConfiguredTpdo, now: float) -> bool:
        if now < self._due[tpdo]:
            return False
        self._due[tpdo] = now + tpdo.event_timer  # CiA 301: the timer begins again with each transmission
        return True

    def _is_changed(self, tpdo: ConfiguredTpdo, now: float, data: bytes) -> bool:
        sent_at, sent = self._sent.get(tpdo.can_id, (-float('inf'), b''))
        wait = tpdo.event_timer if data == sent else tpdo.inhibit_time
        if now - sent_at < wait:
            return False
        self._sent[tpdo.can_id] = now, data
        return True
