"""The keys of a skin layout file: the kind, range, default and meaning of each key.

``layout_file`` reads a file with these keys. `make reference` writes ``config/skin_layout.schema.json`` from them.
Rules that involve several keys are in ``layout_file`` and ``layout_rules``.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

from tactile_node.cia301 import objects
from tactile_node.skin.layout import MAX_DOMAIN_BYTES, MAX_SIDE, SIDES
from tactile_node.yaml_keys import ListOf, MappingOf, Number, OneOf, Switch, Whole, Wholes, key, schema_of
from tactile_node.yaml_section import Section, shown

UNITS = ('Pa', 'N', '1')  #: units of the values; '1' means on/off
MOST_ROWS = 256  #: number of frames that the number in byte 0 can distinguish

INDEX = Whole(1, objects.MAX_INDEX)
SUBINDEX = Whole(0, objects.MAX_SUBINDEX)
PDO_BITS = Whole(1, objects.MAX_PDO_BITS)
MAX_DOMAIN_BITS = 8 * MAX_DOMAIN_BYTES
TAXEL = Wholes(2, 0, MAX_SIDE)
STEP = Wholes(2, -MAX_SIDE, MAX_SIDE)


class CobIdText(NamedTuple):
    """A COB-ID, written as in an EDS."""

    def read(self, section: Section, key: str, value: Any) -> objects.CobId:
        try:
            return objects.parse_cob_id(value)
        except ValueError:
            section.refuse(key, expected="an 11-bit COB-ID such as 0x1A0 or '$NODEID+0x180'", got=shown(value),
                           remedy='Write it as in the EDS, but without the flags in bits 29 to 31.')

    def schema(self) -> dict[str, Any]:
        term = r'(\$[Nn][Oo][Dd][Ee][Ii][Dd]|0[Xx][0-9A-Fa-f]+|[0-9]+)'
        return {'anyOf': [Whole(0, objects.ID_MASK).schema(),
                          {'type': 'string', 'pattern': rf'^ *{term}( *\+ *{term})* *$'}]}


class DeviceTime(NamedTuple):
    """A time [s] that the device stores as a 16-bit multiple of ``unit`` [s]."""

    unit: float

    def read(self, section: Section, key: str, value: Any) -> float:
        time = Number().read(section, key, value)
        longest = objects.MAX_TIME * self.unit
        if not 0 <= time <= longest or abs(time - round(time / self.unit) * self.unit) > self.unit / 1000:
            section.refuse(key, expected=f'0..{longest:g} s in steps of {self.unit:g} s', got=f'{time:g}',
                           remedy='Write it in seconds: 20 ms is 0.02.')
        return time

    def schema(self) -> dict[str, Any]:
        return {'type': 'number', 'minimum': 0, 'maximum': objects.MAX_TIME * self.unit}


@dataclass(frozen=True, kw_only=True)
class ValueKeys:
    unit: str = key(OneOf(UNITS), 'Pressure, force, or 1 for on/off taxels.')
    scale: float = key(Number(positive=True), 'Unit per count.')
    offset: int | None = key(Whole(-1 << 31, (1 << 32) - 1), 'Counts without load (default: the unloaded end of the '
                             'range, or 0 for signed counts that rise).', None)
    bits: int = key(Whole(1, 32), 'Number of bits per taxel.')
    signed: bool = key(Switch(), "true: two's complement.", False)
    byte_order: str = key(OneOf(('little', 'big')), 'little: as CANopen maps objects. big: start_bit counts from the '
                          'top bit of byte 0.', 'little')
    pressure: str = key(OneOf(('rising', 'falling')), 'Direction in which counts change under pressure.', 'rising')


@dataclass(frozen=True, kw_only=True)
class MapKeys:
    object: int = key(INDEX, 'Index of the object.')
    sub: int = key(SUBINDEX, 'Sub-index of the first object.')
    bits: int = key(PDO_BITS, 'Number of bits of each object.')
    count: int = key(PDO_BITS, 'Number of consecutive sub-indices.', 1)


@dataclass(frozen=True, kw_only=True)
class TaxelsKeys:
    first: tuple[int, int] = key(TAXEL, 'Place of the first taxel: [row, col].')
    step: tuple[int, int] = key(STEP, 'Step from one taxel to the next: [down, right].')
    count: int = key(PDO_BITS, 'Number of taxels.')
    start_bit: int = key(Whole(0, objects.MAX_PDO_BITS - 1), 'First bit of the first taxel.', 0)
    bit_step: int = key(PDO_BITS, 'Number of bits from one taxel to the next.')


@dataclass(frozen=True, kw_only=True)
class RowsKeys:
    first: int = key(Whole(0, MOST_ROWS - 1), 'Number in byte 0 of the first frame.', 0)
    count: int = key(Whole(1, MOST_ROWS), 'Number of frames.')
    step: tuple[int, int] = key(STEP, 'Step of the taxels from one frame to the next: [down, right].')


@dataclass(frozen=True, kw_only=True)
class MpdoKeys:
    object: int = key(INDEX, 'Index of the object.')
    sub: int = key(SUBINDEX, 'Sub-index of the object in the first frame.')
    count: int = key(Whole(1, objects.MAX_SUBINDEX + 1), 'Number of frames.')
    step: tuple[int, int] = key(STEP, 'Step of the taxels from one frame to the next: [down, right].')


@dataclass(frozen=True, kw_only=True)
class RepeatKeys:
    count: int = key(Whole(1, objects.MAX_TPDOS), 'Number of repetitions.')
    number: int = key(Whole(-objects.MAX_TPDOS, objects.MAX_TPDOS), 'Step of the number of the TPDO.', 0)
    cob_id: int = key(Whole(-objects.ID_MASK, objects.ID_MASK), 'Step of the COB-ID.', 0)
    object: int = key(Whole(-objects.MAX_INDEX, objects.MAX_INDEX), 'Step of the index of every object.', 0)
    sub: int = key(Whole(-objects.MAX_SUBINDEX, objects.MAX_SUBINDEX), 'Step of the sub-index of every object.', 0)
    node: int = key(Whole(-objects.MAX_NODE_ID, objects.MAX_NODE_ID), 'Step of the number of the node.', 0)
    step: tuple[int, int] = key(STEP, 'Step of all taxels: [down, right].', (0, 0))


@dataclass(frozen=True, kw_only=True)
class TpdoKeys:
    number: int = key(Whole(1, objects.MAX_TPDOS), 'Number of the TPDO: 1 stands for the objects 0x1800 and 0x1A00.')
    cob_id: objects.CobId = key(CobIdText(), "As in the EDS: 0x1A0 or '$NODEID+0x180', but without the flags in bits "
                                '29 to 31.')
    node: int = key(Whole(0, objects.MAX_NODE_ID - 1), 'Number of the node that sends this TPDO, if the pad has '
                    'several.', 0)
    map: MapKeys | tuple[tuple[int, int, int], ...] | None = key(
        MappingOf(MapKeys, Wholes(3, 0, objects.MAX_INDEX)), 'Objects that are mapped into this TPDO, '
        'or a list of [index, sub-index, bits]. The driver writes them to 0x1A00 and following. Required unless the '
        'entry has "mpdo".', None)
    taxels: TaxelsKeys | tuple[tuple[int, int, int], ...] = key(
        MappingOf(TaxelsKeys, Wholes(3, 0, MAX_SIDE)), 'Place of the taxels on the pad and in the CAN '
        'frame, or a list of [row, col, start bit].')
    rows: RowsKeys | None = key(MappingOf(RowsKeys), 'Many frames with one COB-ID, distinguished by a number in byte '
                                '0.', None)
    mpdo: MpdoKeys | None = key(MappingOf(MpdoKeys), 'Many objects with one COB-ID, sent as MPDOs with source '
                                'addressing. Used instead of map and rows.', None)
    repeat: RepeatKeys | tuple[RepeatKeys, ...] | None = key(
        MappingOf(RepeatKeys, MappingOf(RepeatKeys)), 'This entry stands for "count" TPDOs. From each '
        'TPDO to the next, the named keys increase by the given values, and "step" moves the taxels. A list of such '
        'entries makes nested loops, the outermost one first.', None)


@dataclass(frozen=True, kw_only=True)
class DomainKeys:
    object: int = key(INDEX, 'Index of the object.')
    sub: int = key(SUBINDEX, 'Sub-index of the object.', 0)
    bytes: int = key(Whole(1, MAX_DOMAIN_BYTES), 'Size of the object in bytes.')
    start_bit: int = key(Whole(0, MAX_DOMAIN_BITS), 'First bit of the first taxel.', 0)
    bit_step: int = key(Whole(1, MAX_DOMAIN_BITS), 'Number of bits from one taxel to the next.')
    order: str = key(OneOf(('rows', 'cols')), 'Order of the taxels: row by row (rows) or column by column (cols).',
                     'rows')


@dataclass(frozen=True, kw_only=True)
class EventDrivenKeys:
    transmission_type: int = key(Whole(objects.MANUFACTURER_EVENT, objects.PROFILE_EVENT), 'Transmission type of '
                                 'CiA 301: 254 (defined by the maker) or 255 (defined by the device profile).')
    event_timer: float = key(DeviceTime(objects.EVENT_TIMER_UNIT), 'Longest time between two transmissions of a TPDO '
                             '[s]; 0: off.')
    inhibit_time: float = key(DeviceTime(objects.INHIBIT_UNIT), 'Shortest time between two transmissions of a TPDO '
                              '[s].', 0.0)
    frames: str = key(OneOf(('sweeps', 'snapshots')), 'sweeps: all TPDOs of a scan are sent together. snapshots: each '
                      'TPDO is sent at its own time.')
    period: float | None = key(Number(positive=True), 'With sweeps: shortest time between the beginnings of two sweeps '
                               '[s] (default event_timer).', None)
    max_age: float | None = key(Number(positive=True), 'With snapshots: largest age at which the values of a TPDO are '
                                'used [s] (default 3 event timers).', None)


@dataclass(frozen=True, kw_only=True)
class LayoutKeys:
    """Keys at the top of the file."""

    rows: int = key(Whole(1, MAX_SIDE), 'Number of rows of taxels.')
    cols: int = key(Whole(1, MAX_SIDE), 'Number of columns of taxels.')
    pitch: float = key(Number(positive=True), 'Distance between the centres of neighbouring taxels [m].')
    unusual_pitch: bool = key(Switch(), 'true: accept a pitch below 0.3 mm or above 25 mm.', False)
    value: ValueKeys = key(MappingOf(ValueKeys), "Meaning of a taxel's counts: value = scale (counts - offset), or the "
                           'negative of it if counts fall.')
    sync_cob_id: int = key(Whole(1, objects.ID_MASK), 'COB-ID of the SYNC that starts a sweep; 0x080 by default.',
                           objects.SYNC)
    dead_taxels: tuple[tuple[int, int], ...] = key(ListOf(TAXEL), 'Taxels known to be dead, each as [row, col]. Their '
                                                   'values are NaN.', ())
    finger_ends: tuple[str, ...] = key(
        ListOf(OneOf(tuple(SIDES), 'Name the sides at which the finger ends with the skin, or [] if there is no such '
                     'side.')), 'Sides at which the finger ends together with the skin. At the other sides, the finger '
        'extends beyond the skin.', ())
    nodes: int = key(Whole(1, objects.MAX_NODE_ID), 'Number of CANopen nodes that form the pad.', 1)
    tpdos: tuple[TpdoKeys, ...] = key(ListOf(MappingOf(TpdoKeys)), 'The TPDOs that carry the taxels, in the order in '
                                      'which the device sends them. Required unless the layout has "domain".', ())
    domain: DomainKeys | None = key(MappingOf(DomainKeys), 'Used instead of tpdos: the taxels are one DOMAIN object, '
                                    'which is polled by SDO.', None)
    event_driven: EventDrivenKeys | None = key(MappingOf(EventDrivenKeys), 'Settings of a skin that sends without '
                                               'SYNC.', None)


def layout_schema() -> dict[str, Any]:
    """Return the JSON schema of a skin layout."""
    return {'$schema': 'https://json-schema.org/draft/2020-12/schema', 'title': 'Skin layout of tactile_skin',
            'description': 'How the taxels of a pad are transmitted over CANopen. All values are in SI units.',
            **schema_of(LayoutKeys)}
