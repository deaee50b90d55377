"""Read a skin layout from YAML. ``layout_keys`` describes the keys."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

from tactile_node.cia301 import objects
from tactile_node.package_files import config_path
from tactile_node.skin.layout import (
    SIDES,
    DomainLayout,
    EventDriven,
    MappedObject,
    SkinLayout,
    TaxelField,
    TpdoLayout,
    ValueFormat,
    raw_range,
)
from tactile_node.skin.layout_keys import (
    MOST_ROWS,
    DomainKeys,
    EventDrivenKeys,
    LayoutKeys,
    MapKeys,
    MpdoKeys,
    RepeatKeys,
    RowsKeys,
    TaxelsKeys,
    TpdoKeys,
    ValueKeys,
)
from tactile_node.skin.layout_rules import layout_checks
from tactile_node.taxel_frame import SkinSide
from tactile_node.yaml_keys import read_keys
from tactile_node.yaml_section import Section, load_mapping


def load_layout(path: str | Path) -> SkinLayout:
    """Read a skin layout and check it.

    Parameters
    ----------
    path
        Path of the layout, or the name of a layout in ``config/``.

    Raises
    ------
    ConfigurationError
        Raised if the layout breaks a rule in ``layout_rules``. The error names the file and the key.
    """
    layout = read_layout(path)
    for check in layout_checks(layout):
        check()
    return layout


def read_layout(path: str | Path) -> SkinLayout:
    """Read a skin layout without checking the layout rules. Raises ConfigurationError for wrong syntax."""
    path = config_path(str(path))
    top = load_mapping(path, 'a skin layout')
    keys = read_keys(LayoutKeys, top)
    return SkinLayout(
        source=str(path), rows=keys.rows, cols=keys.cols, pitch=keys.pitch, value=_value_format(top, keys.value),
        sync_cob_id=keys.sync_cob_id,
        tpdos=tuple(tpdo for position, entry in enumerate(keys.tpdos)
                    for tpdo in _repeated(top, f'tpdos[{position}]', entry)),
        dead=keys.dead_taxels, nodes=keys.nodes,
        domain=None if keys.domain is None else _domain(keys.domain, keys.rows, keys.cols),
        event_driven=None if keys.event_driven is None else _event_driven(top, keys.event_driven),
        finger_ends=SkinSide(sum(side for name, side in SIDES.items() if name in keys.finger_ends)),
        unusual_pitch=keys.unusual_pitch)


def _value_format(top: Section, keys: ValueKeys) -> ValueFormat:
    falling = keys.pressure == 'falling'
    low, high = raw_range(keys.bits, keys.signed)
    offset = keys.offset
    if offset is None:
        offset = high if falling else max(low, 0)
    if not low <= offset <= high:
        top.refuse('value.offset', expected=f'a whole number {low}..{high}, the range of {keys.bits} bits',
                   got=str(offset), remedy='Correct the number, or "bits" or "signed".')
    return ValueFormat(keys.unit, keys.scale, offset, keys.bits, keys.signed, keys.byte_order, falling)


def _event_driven(top: Section, keys: EventDrivenKeys) -> EventDriven:
    timer, is_sweeps = keys.event_timer, keys.frames == 'sweeps'
    other = 'max_age' if is_sweeps else 'period'
    if getattr(keys, other) is not None:
        top.refuse(f'event_driven.{other}', expected=f'no such key, because the frames are {keys.frames}',
                   got=f'"{other}"', remedy='Remove it, or correct "frames".')
    make = partial(EventDriven, keys.transmission_type, timer, keys.inhibit_time, is_sweeps)
    if is_sweeps:
        period = timer if keys.period is None else keys.period
        if not period:
            top.refuse('event_driven.period', expected='a value, because the event timer is off', got='no such key',
                       remedy='Add "period:".')
        return make(period, 0.0)
    if not timer:
        top.refuse('event_driven.event_timer', expected='a time > 0, because each TPDO is sent at its own time',
                   got='0',
                   remedy='Without it, a TPDO that is no longer sent looks like one whose taxels do not change.')
    # the default tolerates two consecutive lost transmissions
    return make(timer, 3 * timer if keys.max_age is None else keys.max_age)


def _domain(keys: DomainKeys, rows: int, cols: int) -> DomainLayout:
    """Return the object with the places of its taxels in their order (row by row or column by column)."""
    places = [(row, col) for row in range(rows) for col in range(cols)]
    if keys.order == 'cols':
        places.sort(key=lambda place: place[::-1])
    return DomainLayout(keys.object, keys.sub, keys.bytes, tuple(
        TaxelField(row, col, keys.start_bit + i * keys.bit_step) for i, (row, col) in enumerate(places)))


def _tpdos(top: Section, key: str, entry: TpdoKeys) -> list[TpdoLayout]:
    """Return the TPDOs of one entry of ``tpdos``, without its repetitions.

    An entry is a plain TPDO, all rows of a multiplexed TPDO, or a series of MPDOs.

    Parameters
    ----------
    top
        Top level of the file, which refuses wrong keys.
    key
        Key of the entry, such as 'tpdos[3]'.
    entry
        The entry.

    Raises
    ------
    ConfigurationError
        Raised if keys of the entry contradict each other.
    """
    taxels = _taxels(entry.taxels)
    make = partial(TpdoLayout, entry.number, entry.cob_id, node=entry.node, key=key)
    rows, mpdo = entry.rows, entry.mpdo
    if mpdo is not None:
        for other in ('map', 'rows'):
            if getattr(entry, other) is not None:
                top.refuse(f'{key}.{other}', expected='no such key beside "mpdo", which names the objects itself',
                           got=f'"{other}"', remedy=f'Remove "{other}" or "mpdo".')
        _check_count(top, f'{key}.mpdo', mpdo.count, objects.MAX_SUBINDEX + 1 - mpdo.sub, 'sub')
        return [make((MappedObject(mpdo.object, mpdo.sub + i, objects.MPDO_DATA_BITS),), shifted, is_mpdo=True)
                for i, shifted in enumerate(_frames(mpdo, taxels))]
    if entry.map is None:
        top.refuse(f'{key}.map', expected='a value', got='no such key', remedy='Add "map:".')
    mapping = _mapping(entry.map)
    if rows is None:
        return [make(mapping, taxels)]
    _check_count(top, f'{key}.rows', rows.count, MOST_ROWS - rows.first, 'first')
    return [make(mapping, shifted, row=rows.first + i) for i, shifted in enumerate(_frames(rows, taxels))]


def _check_count(top: Section, key: str, count: int, most: int, first: str) -> None:
    if count > most:
        top.refuse(f'{key}.count', expected=f'a whole number 1..{most}', got=str(count),
                   remedy=f'Correct count or {first}.')


def _frames(keys: RowsKeys | MpdoKeys, taxels: tuple[TaxelField, ...]) -> Iterator[tuple[TaxelField, ...]]:
    """Yield the taxels of each frame with the same COB-ID."""
    down, right = keys.step
    return (_shift_taxels(taxels, i * down, i * right) for i in range(keys.count))


def _shift_taxels(taxels: tuple[TaxelField, ...], down: int, right: int) -> tuple[TaxelField, ...]:
    return tuple(TaxelField(row + down, col + right, bit) for row, col, bit in taxels)


def _mapping(keys: MapKeys | tuple[tuple[int, int, int], ...]) -> tuple[MappedObject, ...]:
    if isinstance(keys, MapKeys):
        return tuple(MappedObject(keys.object, keys.sub + i, keys.bits) for i in range(keys.count))
    return tuple(MappedObject(*entry) for entry in keys)


def _taxels(keys: TaxelsKeys | tuple[tuple[int, int, int], ...]) -> tuple[TaxelField, ...]:
    if not isinstance(keys, TaxelsKeys):
        return tuple(TaxelField(*entry) for entry in keys)
    (row, col), (down, right) = keys.first, keys.step
    return tuple(TaxelField(row + i * down, col + i * right, keys.start_bit + i * keys.bit_step)
                 for i in range(keys.count))


class Shift(NamedTuple):
    """Offset of a repetition from the original entry."""

    number: int
    cob_id: int
    object: int
    sub: int
    node: int
    down: int   #: number of rows by which all taxels are shifted
    right: int  #: number of columns by which all taxels are shifted


def _repeated(top: Section, key: str, entry: TpdoKeys) -> list[TpdoLayout]:
    """Return the TPDOs of one entry with all its repetitions. If there are several loops, the last is the innermost.

    Its parameters and errors are those of `_tpdos`. A repetition with a number out of range is also an error.
    """
    tpdos = _tpdos(top, key, entry)
    loops = (entry.repeat,) if isinstance(entry.repeat, RepeatKeys) else entry.repeat
    if not loops:
        return tpdos
    total = 1
    for loop in loops:
        total *= loop.count
        if total > objects.MAX_TPDOS:  # a typing error must not allocate too much memory
            top.refuse(f'{key}.repeat', expected=f'at most {objects.MAX_TPDOS} repetitions', got=f'{total} or more',
                       remedy='Correct the counts.')
    steps = [Shift(loop.number, loop.cob_id, loop.object, loop.sub, loop.node, *loop.step) for loop in loops]
    found = []
    for turns in product(*(range(loop.count) for loop in loops)):
        shift = Shift._make(sum(turn * part for turn, part in zip(turns, parts)) for parts in zip(*steps))
        found += [_shift_tpdo(top, key, tpdo, shift) for tpdo in tpdos]
    return found


def _shift_tpdo(top: Section, key: str, tpdo: TpdoLayout, shift: Shift) -> TpdoLayout:
    def check(name: str, value: int, low: int, high: int) -> None:
        if not low <= value <= high:
            top.refuse(f'{key}.repeat', expected=f'repetitions whose "{name}" is {low}..{high}, 0x{low:X}..0x{high:X}',
                       got=f'{value}' if value < 0 else f'{value}, 0x{value:X}', remedy=f'Correct count or {name}.')

    number, node, cob_id = tpdo.number + shift.number, tpdo.node + shift.node, tpdo.cob_id.base + shift.cob_id
    mapping = tuple(MappedObject(mapped.index + shift.object, mapped.subindex + shift.sub, mapped.bits)
                    for mapped in tpdo.mapping)
    check('number', number, 1, objects.MAX_TPDOS)
    check('node', node, 0, objects.MAX_NODE_ID - 1)
    check('cob_id', cob_id, 0, objects.ID_MASK)
    for mapped in mapping:
        check('object', mapped.index, 1, objects.MAX_INDEX)
        check('sub', mapped.subindex, 0, objects.MAX_SUBINDEX)
    what = f'node {node}, TPDO {number}' if shift.node else f'TPDO {number}'
    what += f', object 0x{mapping[0].index:04X}' if tpdo.is_mpdo else ''
    return replace(tpdo, number=number, node=node, cob_id=objects.CobId(cob_id, tpdo.cob_id.relative), mapping=mapping,
                   taxels=_shift_taxels(tpdo.taxels, shift.down, shift.right), key=f'{key} ({what})')
