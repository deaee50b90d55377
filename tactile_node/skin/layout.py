"""The skin layout, which assigns each taxel to a TPDO, an object and a bit. ``layout_file`` reads layouts from YAML."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from tactile_node.cia301 import objects
from tactile_node.taxel_frame import NO_SIDE, SkinSide

#: fraction of the period within which a sweep must arrive; twice this fraction leaves a tenth of the period for errors
#: in the device's timer and the stamps
SWEEP_SHARE = 0.45


@dataclass(frozen=True)
class EventDriven:
    """Settings of a device that sends without SYNC (CiA 301, transmission types 254 and 255). Times are in seconds."""

    transmission_type: int
    event_timer: float  #: longest time between two transmissions of a TPDO, or 0 to disable the timer
    inhibit_time: float  #: shortest time between two transmissions of a TPDO
    is_sweeps: bool  #: True if all TPDOs of a scan are sent together, in layout order
    period: float  #: shortest time between the starts of two sweeps, or the event timer if taxel frames are snapshots
    max_age: float  #: maximum age of used TPDO values if the frames are not sweeps, else 0

    @property
    def times(self) -> dict[int, int]:
        """Raw values of the times in the TPDO communication record, by sub-index."""
        return {objects.INHIBIT_TIME: round(self.inhibit_time / objects.INHIBIT_UNIT),
                objects.EVENT_TIMER: round(self.event_timer / objects.EVENT_TIMER_UNIT)}

    @property
    def sweep_time(self) -> float:
        """Time window in which all TPDOs of one sweep must arrive [s]."""
        return SWEEP_SHARE * self.period

    @property
    def longest_pause(self) -> float:
        """Longest time without any TPDO from a working device [s]."""
        return max(self.event_timer, self.period)


MAX_DOMAIN_BYTES = 1 << 20  #: limit on the memory that a typing error in a layout can allocate [bytes]
MAX_SIDE = 1024  #: maximum number of rows or columns, which limits the memory that a typing error can allocate


@dataclass(frozen=True)
class MappedObject:
    """One entry of a TPDO mapping record (CiA 301, 0x1A00...)."""

    index: int
    subindex: int
    bits: int

    @property
    def entry(self) -> int:
        """Mapping record entry: index, sub-index and number of bits in one UNSIGNED32."""
        return self.index << 16 | self.subindex << 8 | self.bits


class TaxelField(NamedTuple):
    """Position of a taxel's raw value in a TPDO or DOMAIN.

    In little-endian byte order, as in CANopen mappings, ``start_bit`` counts from the least significant bit of byte 0.
    In big-endian byte order, ``start_bit`` counts from the most significant bit of byte 0.
    """

    row: int
    col: int
    start_bit: int


@dataclass(frozen=True)
class ValueFormat:
    """Format of a taxel's raw counts. The value is scale * (counts - offset), negated if ``falling``."""

    unit: str  #: unit of the values: 'Pa', 'N' or '1' (on/off)
    scale: float  #: unit per count
    offset: int  #: counts without load
    bits: int
    signed: bool
    byte_order: str  #: 'little' or 'big'
    falling: bool  #: True if counts decrease under pressure

    @property
    def raw_range(self) -> tuple[int, int]:
        """Smallest and largest possible count."""
        return raw_range(self.bits, self.signed)

    @property
    def saturated_count(self) -> int | None:
        """Count at full load, or None for on/off taxels, which cannot saturate."""
        return None if self.bits == 1 else self.raw_range[0 if self.falling else 1]

    def to_value(self, counts: np.ndarray) -> np.ndarray:
        """Convert an array of counts into values in ``unit``, float32, with the shape of the array."""
        sign = -1.0 if self.falling else 1.0
        return ((counts - float(self.offset)) * (sign * self.scale)).astype(np.float32)

    def to_counts(self, values: np.ndarray) -> np.ndarray:
        """Convert values in ``unit`` into counts, int64, rounded and clipped to the range. NaN becomes "no load".
        """
        load = np.nan_to_num(np.asarray(values, dtype=float) / self.scale, nan=0.0)
        return np.clip(np.rint(self.offset + (-load if self.falling else load)),
                       *self.raw_range).astype(np.int64)


@dataclass(frozen=True)
class TpdoLayout:
    """One CAN frame of a pad's sweep.

    Several CAN frames may share a number and a COB-ID. CAN frames with the same number and COB-ID differ in their first
    bytes. In a row-multiplexed TPDO, byte 0 contains a manufacturer-specific row number. In an MPDO in source
    addressing mode (CiA 301), the first bytes contain node-ID, index and sub-index.
    """

    number: int  #: number of the TPDO (1 = 0x1800)
    cob_id: objects.CobId
    mapping: tuple[MappedObject, ...]
    taxels: tuple[TaxelField, ...]
    row: int | None = None  #: byte 0 of a row-multiplexed TPDO
    is_mpdo: bool = False  #: True for an MPDO; ``mapping`` is then the only object in the frame
    node: int = 0  #: number of the sending node among the pad's nodes
    key: str = ''  #: key in the layout file to show in messages

    @property
    def is_multiplexed(self) -> bool:
        return self.is_mpdo or self.row is not None

    @property
    def name(self) -> str:
        """Number of the TPDO, followed by the row or the object if the TPDO is multiplexed."""
        if self.is_mpdo:
            return f'{self.number} object {objects.ObjectAddress(self.mapping[0].index, self.mapping[0].subindex)}'
        return str(self.number) if self.row is None else f'{self.number} row {self.row}'

    @property
    def bits(self) -> int:
        """Number of bits in the CAN frame, including node-ID, index and sub-index for an MPDO."""
        return objects.MAX_PDO_BITS if self.is_mpdo else sum(mapped.bits for mapped in self.mapping)

    def prefix(self, node_id: int) -> bytes:
        """Return the first bytes, which identify a frame of a multiplexed TPDO.

        Bit 7 in byte 0 of an MPDO is 0 for source addressing.
        """
        if self.is_mpdo:
            mapped = self.mapping[0]
            return bytes([node_id, mapped.index & 0xFF, mapped.index >> 8, mapped.subindex])
        return b'' if self.row is None else bytes([self.row])

    @property
    def length(self) -> int:
        """Number of bytes in the CAN frame."""
        return (self.bits + 7) // 8


@dataclass(frozen=True)
class DomainLayout:
    """A DOMAIN object (CiA 301) with all taxels of one sample.

    The driver reads the object by SDO, with block transfer if supported.
    """

    index: int
    subindex: int
    length: int  #: number of bytes
    taxels: tuple[TaxelField, ...]


#: sides of the pad by their names in a layout
SIDES = {'first_row': SkinSide.FIRST_ROW, 'last_row': SkinSide.LAST_ROW, 'first_col': SkinSide.FIRST_COL,
         'last_col': SkinSide.LAST_COL}


@dataclass(frozen=True)
class SkinLayout:
    """Taxels of a pad, and the TPDOs (in the device's sending order) or the DOMAIN that carry the taxels."""

    source: str  #: path of the layout file to show in messages
    rows: int
    cols: int
    pitch: float  #: distance between neighbouring taxels [m]
    value: ValueFormat
    sync_cob_id: int
    tpdos: tuple[TpdoLayout, ...]
    dead: tuple[tuple[int, int], ...] = ()  #: (row, col) of taxels known to be dead
    nodes: int = 1  #: number of CANopen nodes that form the pad
    domain: DomainLayout | None = None  #: object polled by SDO; ``tpdos`` is then empty
    event_driven: EventDriven | None = None  #: settings of a skin that sends without SYNC, or None for any other skin
    finger_ends: SkinSide = NO_SIDE  #: sides at which the finger does not extend beyond the skin
    unusual_pitch: bool = False  #: True if a pitch outside ``layout_rules.PITCHES`` is intended
    is_mirrored: bool = False  #: True if the columns are counted from the other side than in the layout file

    @property
    def needs_sync(self) -> bool:
        """True if the pad's nodes send their TPDOs at SYNC."""
        return self.domain is None and self.event_driven is None

    def frame_period(self, sync_period: float) -> float:
        """Return the longest time between two taxel frames [s].

        Parameters
        ----------
        sync_period
            Time between two SYNCs or two polls [s]. An event-driven skin ignores this period.
        """
        return sync_period if self.event_driven is None else self.event_driven.longest_pause

    @property
    def carriers(self) -> 'tuple[TpdoLayout | DomainLayout, ...]':
        """The TPDOs, or the DOMAIN, with the taxels of one period."""
        return self.tpdos if self.domain is None else (self.domain,)

    def mirrored(self) -> 'SkinLayout':
        """Return the layout of a pad whose columns run in the other direction.

        >>> SkinLayout('', 1, 4, 0.002, None, 0x80, (), dead=((0, 1),), finger_ends=SkinSide.FIRST_COL).mirrored().dead
        ((0, 2),)
        """
        def of(carrier: TpdoLayout | DomainLayout) -> Any:
            taxels = tuple(field._replace(col=self.cols - 1 - field.col) for field in carrier.taxels)
            return replace(carrier, taxels=taxels)
        ends, both = self.finger_ends, SkinSide.FIRST_COL | SkinSide.LAST_COL
        return replace(self, tpdos=tuple(map(of, self.tpdos)), domain=self.domain and of(self.domain),
                       dead=tuple((row, self.cols - 1 - col) for row, col in self.dead),
                       finger_ends=ends if ends & both in (NO_SIDE, both) else ends ^ both,
                       is_mirrored=not self.is_mirrored)

    def of_node(self, node: int) -> 'SkinLayout':
        """Return the part of the layout that the pad's node number ``node`` (from 0) sends."""
        return replace(self, tpdos=tuple(tpdo for tpdo in self.tpdos if tpdo.node == node))


def raw_range(bits: int, signed: bool) -> tuple[int, int]:
    """Return the smallest and the largest number that ``bits`` bits can represent."""
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
