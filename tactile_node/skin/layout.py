"""The skin layout: which TPDO, object and bit means which taxel. ``layout_file`` reads it from YAML."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tactile_node.cia301 import objects
from tactile_node.taxel_frame import NO_SIDE, SkinSide
from tactile_node.yaml_section import Section

SWEEP_SHARE = 0.45  #: a part of the period; twice that leaves a tenth for the device's timer and our stamps


@dataclass(frozen=True)
class EventDriven:
    """How a device sends without SYNC (CiA 301: transmission types 254 and 255). Times in seconds."""

    transmission_type: int
    event_timer: float  #: the most between two transmissions of a TPDO; 0: off
    inhibit_time: float  #: the least between two transmissions of a TPDO
    is_sweeps: bool  #: sends all TPDOs of a scan together, in the layout's order; else each TPDO at its own time
    period: float  #: the least between the beginnings of two sweeps; without sweeps the event timer
    max_age: float  #: without sweeps, how old the values of a TPDO may become

    @property
    def times(self) -> dict[int, int]:
        """The times as a TPDO's communication record holds them, by sub-index."""
        return {objects.INHIBIT_TIME: round(self.inhibit_time / objects.INHIBIT_UNIT),
                objects.EVENT_TIMER: round(self.event_timer / objects.EVENT_TIMER_UNIT)}

    @property
    def sweep_time(self) -> float:
        """Within which all TPDOs of a sweep come."""
        return SWEEP_SHARE * self.period

    @property
    def longest_pause(self) -> float:
        """Without any TPDO, while the device works."""
        return max(self.event_timer, self.period)


def read_event_driven(top: Section) -> EventDriven | None:
    """Read the key ``event_driven`` of a skin layout; None where it has none. Raises ConfigurationError."""
    if top.take('event_driven', None) is None:
        return None
    section = top.section('event_driven')
    kind = section.integer('transmission_type', objects.MANUFACTURER_EVENT, objects.PROFILE_EVENT)
    timer = _time(section, 'event_timer', objects.EVENT_TIMER_UNIT)
    inhibit = _time(section, 'inhibit_time', objects.INHIBIT_UNIT, 0)
    is_sweeps = section.choice('frames', ('sweeps', 'snapshots')) == 'sweeps'
    period, max_age = timer, 0.0
    if is_sweeps:
        period = section.number('period', *([timer] if timer else []), positive=True)
    elif not timer:
        section.refuse('event_timer', expected='one > 0, as TPDOs come each at its own time', got='0',
                       remedy='Without it a TPDO that is lost for ever looks like one whose taxels do not change.')
    else:
        max_age = section.number('max_age', 3 * timer, positive=True)  # two transmissions in a row may be lost
    section.done()
    return EventDriven(kind, timer, inhibit, is_sweeps, period, max_age)


def _time(section: Section, key: str, unit: float, *default: float) -> float:
    """Read a time [s] that the device holds as a number of ``unit`` [s] in 16 bits."""
    value = section.number(key, *default)
    if not 0 <= value <= objects.MAX_TIME * unit or abs(value - round(value / unit) * unit) > unit / 1000:
        section.refuse(key, expected=f'0..{objects.MAX_TIME * unit:g} s in steps of {unit:g} s', got=f'{value:g}',
                       remedy='Write it in seconds, 20 ms as 0.02.')
    return value


MAX_DOMAIN_BYTES = 1 << 20  # bounds what a mistyped layout can allocate
MAX_SIDE = 1024  # taxels: bounds what a mistyped layout can allocate


@dataclass(frozen=True)
class MappedObject:
    """One entry of a TPDO mapping record (CiA 301, 0x1A00...)."""

    index: int
    subindex: int
    bits: int

    @property
    def entry(self) -> int:
        """Entry as the record holds it: index, sub-index and bits in one UNSIGNED32."""
        return self.index << 16 | self.subindex << 8 | self.bits


class TaxelField(NamedTuple):
    """Where a taxel's raw value starts in its TPDO or DOMAIN.

    ``start_bit`` counts from the least significant bit of byte 0 when the byte order is little (as CANopen
    maps objects), from the most significant bit of byte 0 when it is big.
    """

    row: int
    col: int
    start_bit: int


@dataclass(frozen=True)
class ValueFormat:
    """A taxel's raw counts and their meaning: value = scale (counts - offset), or the negative if falling."""

    unit: str  #: 'Pa', 'N' or '1' (on/off)
    scale: float  #: unit per count
    offset: int  #: counts without load
    bits: int
    signed: bool
    byte_order: str  #: 'little' or 'big'
    falling: bool  #: counts fall under pressure

    @property
    def raw_range(self) -> tuple[int, int]:
        """Smallest and largest count."""
        return raw_range(self.bits, self.signed)

    @property
    def saturated_count(self) -> int | None:
        """The count at the loaded end of the range; None for on/off taxels, which have no such end."""
        return None if self.bits == 1 else self.raw_range[0 if self.falling else 1]

    def to_value(self, counts: np.ndarray) -> np.ndarray:
        """Counts (any shape) -> float32 of the same shape, in ``unit``."""
        sign = -1.0 if self.falling else 1.0
        return ((counts - float(self.offset)) * (sign * self.scale)).astype(np.float32)

    def to_counts(self, values: np.ndarray) -> np.ndarray:
        """Values in ``unit`` (any shape) -> int64 counts, rounded and clipped to the range; NaN becomes no load."""
        load = np.nan_to_num(np.asarray(values, dtype=float) / self.scale, nan=0.0)
        return np.clip(np.rint(self.offset + (-load if self.falling else load)),
                       *self.raw_range).astype(np.int64)


@dataclass(frozen=True)
class TpdoLayout:
    """One CAN frame of a pad's sweep: its TPDO's number (1 = 0x1800), COB-ID, mapped objects and the taxels in it.

    Several may share a number and COB-ID. Their first bytes then distinguish them: a manufacturer-specific row number
    in byte 0, or, as MPDOs in source addressing mode (CiA 301), node-ID, index and sub-index.
    """

    number: int
    cob_id: objects.CobId
    mapping: tuple[MappedObject, ...]
    taxels: tuple[TaxelField, ...]
    row: int | None = None  #: byte 0 of a row-multiplexed TPDO
    is_mpdo: bool = False  #: ``mapping`` is then the one object it carries
    node: int = 0  #: which of the pad's nodes sends it
    key: str = ''  #: in the layout file, for messages

    @property
    def is_multiplexed(self) -> bool:
        return self.is_mpdo or self.row is not None

    @property
    def name(self) -> str:
        """Its number; of a multiplexed one also what distinguishes the frame."""
        if self.is_mpdo:
            return f'{self.number} object {objects.ObjectAddress(self.mapping[0].index, self.mapping[0].subindex)}'
        return str(self.number) if self.row is None else f'{self.number} row {self.row}'

    @property
    def bits(self) -> int:
        """Bits of the CAN frame, node-ID, index and sub-index of an MPDO included."""
        return objects.MAX_PDO_BITS if self.is_mpdo else sum(mapped.bits for mapped in self.mapping)

    def prefix(self, node_id: int) -> bytes:
        """The first bytes that identify a multiplexed frame. Bit 7 of an MPDO's byte 0 is 0: source addressing."""
        if self.is_mpdo:
            mapped = self.mapping[0]
            return bytes([node_id, mapped.index & 0xFF, mapped.index >> 8, mapped.subindex])
        return b'' if self.row is None else bytes([self.row])

    @property
    def length(self) -> int:
        """Bytes of the CAN frame."""
        return (self.bits + 7) // 8


@dataclass(frozen=True)
class DomainLayout:
    """A DOMAIN object (CiA 301) that holds all taxels of one sample and is read by SDO, by block where possible."""

    index: int
    subindex: int
    length: int  #: bytes
    taxels: tuple[TaxelField, ...]


#: sides of a pad by their names in a layout
SIDES = {'first_row': SkinSide.FIRST_ROW, 'last_row': SkinSide.LAST_ROW, 'first_col': SkinSide.FIRST_COL,
         'last_col': SkinSide.LAST_COL}


@dataclass(frozen=True)
class SkinLayout:
    """A pad's taxels and their carriers: TPDOs, in the order in which the device sends them, or one DOMAIN."""

    source: str  #: the file, for messages
    rows: int
    cols: int
    pitch: float  #: between neighbouring taxels [m]
    value: ValueFormat
    sync_cob_id: int
    tpdos: tuple[TpdoLayout, ...]
    dead: tuple[tuple[int, int], ...] = ()  #: (row, col) of taxels known to be dead
    nodes: int = 1  #: CANopen nodes that make up the pad
    domain: DomainLayout | None = None  #: polled by SDO; ``tpdos`` is then empty
    event_driven: EventDriven | None = None  #: its TPDOs are not sampled by SYNC
    finger_ends: SkinSide = NO_SIDE  #: the sides at which the finger ends with the skin
    unusual_pitch: bool = False  #: meant, where it is outside PITCHES of ``layout_rules``

    @property
    def needs_sync(self) -> bool:
        """Whether SYNC makes the pad's nodes send."""
        return self.domain is None and self.event_driven is None

    def frame_period(self, sync_period: float) -> float:
        """Time between two taxel frames, where ``sync_period`` is that of two SYNCs or polls [s]."""
        return sync_period if self.event_driven is None else self.event_driven.longest_pause

    @property
    def carriers(self) -> 'tuple[TpdoLayout | DomainLayout, ...]':
        """The TPDOs that carry the taxels of one period, or the DOMAIN."""
        return self.tpdos if self.domain is None else (self.domain,)

    def of_node(self, node: int) -> 'SkinLayout':
        """The part of the layout that the pad's node number ``node`` (from 0) sends."""
        return replace(self, tpdos=tuple(tpdo for tpdo in self.tpdos if tpdo.node == node))


def raw_range(bits: int, signed: bool) -> tuple[int, int]:
    """Smallest and largest number of ``bits`` bits."""
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
