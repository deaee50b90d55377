"""Read a skin layout from YAML. Comments in ``config/sim16x16.yaml`` and the other layouts explain the keys."""

from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

from tactile_node.cia301 import objects
from tactile_node.package_files import config_path
from tactile_node.skin.layout import (
    MAX_DOMAIN_BYTES,
    MAX_SIDE,
    SIDES,
    DomainLayout,
    MappedObject,
    SkinLayout,
    TaxelField,
    TpdoLayout,
    ValueFormat,
    raw_range,
    read_event_driven,
)
from tactile_node.skin.layout_rules import layout_checks
from tactile_node.taxel_frame import SkinSide
from tactile_node.yaml_section import Section, load_mapping, shown


class Shift(NamedTuple):
    """Offset of a repetition from the original entry."""

    number: int = 0
    cob_id: int = 0
    object: int = 0
    sub: int = 0
    node: int = 0
    down: int = 0   #: number of rows by which all taxels are shifted
    right: int = 0  #: number of columns by which all taxels are shifted


#: largest absolute value of each step
LARGEST_STEPS = {'number': objects.MAX_TPDOS, 'cob_id': objects.ID_MASK, 'object': objects.MAX_INDEX,
                 'sub': objects.MAX_SUBINDEX, 'node': objects.MAX_NODE_ID}


def repeat_tpdos(section: Section, tpdos: tuple[TpdoLayout, ...]) -> tuple[TpdoLayout, ...]:
    """Return all repetitions requested by the key ``repeat`` of an entry.

    If there are several loops, the last loop is the innermost.

    Parameters
    ----------
    section
        Section of the entry in the layout.
    tpdos
        TPDOs of the original entry.

    Raises
    ------
    ConfigurationError
        Raised if ``repeat`` is invalid, or if a number in a repetition is out of range.
    """
    if (written := section.take('repeat', None)) is None:
        return tpdos
    loops = [section.subsection('repeat', written)] if not isinstance(written, list) else \
        [section.subsection(f'repeat[{i}]', loop) for i, loop in enumerate(written)]
    shifts, total = [], 1
    for loop in loops:
        count, step = _loop(loop)
        total *= count
        if total > objects.MAX_TPDOS:  # a typing error must not allocate too much memory
            section.refuse('repeat', expected=f'at most {objects.MAX_TPDOS} repetitions', got=f'{total} or more',
                           remedy='Correct the counts.')
        shifts.append([Shift._make(i * part for part in step) for i in range(count)])
    return tuple(_shift_tpdo(section, tpdo, Shift._make(map(sum, zip(*parts))))
                 for parts in product(*shifts) for tpdo in tpdos)


def _loop(loop: Section) -> tuple[int, Shift]:
    count = loop.integer('count', 1, objects.MAX_TPDOS)
    numbers = [loop.integer(key, -most, most, 0) for key, most in LARGEST_STEPS.items()]
    down, right = loop.checked_integers('step', loop.take('step', [0, 0]), count=2, low=-MAX_SIDE, high=MAX_SIDE)
    loop.done()
    return count, Shift._make((*numbers, down, right))


def _shift_tpdo(section: Section, tpdo: TpdoLayout, shift: Shift) -> TpdoLayout:
    number, node, cob_id = tpdo.number + shift.number, tpdo.node + shift.node, tpdo.cob_id.base + shift.cob_id
    mapping = tuple(MappedObject(mapped.index + shift.object, mapped.subindex + shift.sub, mapped.bits)
                    for mapped in tpdo.mapping)
    _check(section, 'number', number, 1, objects.MAX_TPDOS)
    _check(section, 'node', node, 0, objects.MAX_NODE_ID - 1)
    _check(section, 'cob_id', cob_id, 0, objects.ID_MASK)
    for mapped in mapping:
        _check(section, 'object', mapped.index, 1, objects.MAX_INDEX)
        _check(section, 'sub', mapped.subindex, 0, objects.MAX_SUBINDEX)
    taxels = tuple(TaxelField(row + shift.down, col + shift.right, bit) for row, col, bit in tpdo.taxels)
    what = f'node {node}, TPDO {number}' if shift.node else f'TPDO {number}'
    what += f', object 0x{mapping[0].index:04X}' if tpdo.is_mpdo else ''
    return replace(tpdo, number=number, node=node, cob_id=objects.CobId(cob_id, tpdo.cob_id.relative), mapping=mapping,
                   taxels=taxels, key=f'{tpdo.key} ({what})')


def _check(section: Section, key: str, value: int, low: int, high: int) -> None:
    if not low <= value <= high:
        section.refuse('repeat', expected=f'repetitions whose "{key}" is {low}..{high}, 0x{low:X}..0x{high:X}',
                       got=f'{value}' if value < 0 else f'{value}, 0x{value:X}', remedy=f'Correct count or {key}.')


UNITS = ('Pa', 'N', '1')  #: units of the values; '1' means on/off


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
    rows = top.integer('rows', 1, MAX_SIDE)
    cols = top.integer('cols', 1, MAX_SIDE)
    domain = _domain(top, rows, cols)
    tpdos = top.sequence('tpdos') if domain is None else top.sequence('tpdos', [])
    sections = [top.subsection(f'tpdos[{i}]', item) for i, item in enumerate(tpdos)]
    layout = SkinLayout(
        source=str(path), rows=rows, cols=cols, pitch=top.number('pitch', positive=True),
        value=_value_format(top.section('value')),
        sync_cob_id=top.integer('sync_cob_id', 1, objects.ID_MASK, objects.SYNC),
        tpdos=tuple(tpdo for section in sections for tpdo in _tpdos(section)),
        dead=tuple((row, col) for row, col in (
            top.checked_integers('dead_taxels', taxel, count=2, low=0, high=MAX_SIDE)
            for taxel in top.sequence('dead_taxels', []))),
        nodes=top.integer('nodes', 1, objects.MAX_NODE_ID, 1), domain=domain,
        event_driven=read_event_driven(top), finger_ends=_finger_ends(top),
        unusual_pitch=top.choice('unusual_pitch', (False, True), False))
    top.done()
    return layout


def _finger_ends(top: Section) -> SkinSide:
    """Read ``finger_ends``, the sides at which the finger does not extend beyond the skin."""
    named = top.sequence('finger_ends', [])
    for name in named:
        if name not in tuple(SIDES):
            top.refuse('finger_ends', expected=f'some of {", ".join(SIDES)}', got=shown(name),
                       remedy='Name the sides at which the finger ends with the skin, or [] if there is no such side.')
    return SkinSide(sum(side for name, side in SIDES.items() if name in named))


def _value_format(section: Section) -> ValueFormat:
    bits = section.integer('bits', 1, 32)
    signed = section.choice('signed', (False, True), False)
    falling = section.choice('pressure', ('rising', 'falling'), 'rising') == 'falling'
    low, high = raw_range(bits, signed)
    value = ValueFormat(
        unit=section.choice('unit', UNITS), scale=section.number('scale', positive=True),
        offset=section.integer('offset', low, high, high if falling else max(low, 0)), bits=bits, signed=signed,
        byte_order=section.choice('byte_order', ('little', 'big'), 'little'), falling=falling)
    section.done()
    return value


def _domain(top: Section, rows: int, cols: int) -> DomainLayout | None:
    """Read ``domain``, which specifies the object and the order of its taxels (row by row or column by column)."""
    if top.take('domain', None) is None:
        return None
    section = top.section('domain')
    index, sub = section.integer('object', 1, objects.MAX_INDEX), section.integer('sub', 0, objects.MAX_SUBINDEX, 0)
    length = section.integer('bytes', 1, MAX_DOMAIN_BYTES)
    start, step = section.integer('start_bit', 0, 8 * length, 0), section.integer('bit_step', 1, 8 * length)
    places = [(row, col) for row in range(rows) for col in range(cols)]
    if section.choice('order', ('rows', 'cols'), 'rows') == 'cols':
        places.sort(key=lambda place: place[::-1])
    section.done()
    return DomainLayout(index, sub, length,
                        tuple(TaxelField(row, col, start + i * step) for i, (row, col) in enumerate(places)))


def _tpdos(section: Section) -> tuple[TpdoLayout, ...]:
    """Read one entry of ``tpdos``, including its repetitions.

    An entry is a plain TPDO, all rows of a multiplexed TPDO, or a series of MPDOs.
    """
    number = section.integer('number', 1, objects.MAX_TPDOS)
    cob_id = _cob_id(section)
    node = section.integer('node', 0, objects.MAX_NODE_ID - 1, 0)
    make = partial(TpdoLayout, number, cob_id, node=node, key=section.path)
    if section.take('mpdo', None) is not None:
        run = section.section('mpdo')
        index, first = run.integer('object', 1, objects.MAX_INDEX), run.integer('sub', 0, objects.MAX_SUBINDEX)
        tpdos = [make((MappedObject(index, first + i, objects.MPDO_DATA_BITS),), taxels, is_mpdo=True)
                 for i, taxels in enumerate(_shifted(section, _repeats(run, objects.MAX_SUBINDEX + 1 - first)))]
    elif section.take('rows', None) is not None:
        run, mapping = section.section('rows'), _mapping(section)
        first = run.integer('first', 0, 255, 0)
        tpdos = [make(mapping, taxels, row=first + i)
                 for i, taxels in enumerate(_shifted(section, _repeats(run, 256 - first)))]
    else:
        tpdos = [make(_mapping(section), _taxels(section))]
    repetitions = repeat_tpdos(section, tuple(tpdos))
    section.done()
    return repetitions


def _repeats(run: Section, most: int) -> list[tuple[int, int]]:
    """Read ``count`` and ``step``. Return the offset [row, col] of each frame's taxels relative to the first frame."""
    count = run.integer('count', 1, most)
    down, right = run.integers('step', 2, -MAX_SIDE, MAX_SIDE)
    run.done()
    return [(i * down, i * right) for i in range(count)]


def _shifted(section: Section, shifts: list[tuple[int, int]]) -> list[tuple[TaxelField, ...]]:
    fields = _taxels(section)
    return [tuple(TaxelField(row + down, col + right, bit) for row, col, bit in fields) for down, right in shifts]


def _cob_id(section: Section) -> objects.CobId:
    written = section.take('cob_id')
    try:
        return objects.parse_cob_id(written)
    except ValueError:
        section.refuse('cob_id', expected="an 11-bit COB-ID such as 0x1A0 or '$NODEID+0x180'",
                       got=shown(written),
                       remedy='Write it as in the EDS, but without the flags in bits 29 to 31.')


def _mapping(section: Section) -> tuple[MappedObject, ...]:
    """Read ``map``, which is a list of [index, sub, bits] or {object, sub, bits, count} for consecutive sub-indices."""
    written = section.take('map')
    if isinstance(written, dict):
        run = section.subsection('map', written)
        index, first = run.integer('object', 1, objects.MAX_INDEX), run.integer('sub', 0, objects.MAX_SUBINDEX)
        bits, count = run.integer('bits', 1, objects.MAX_PDO_BITS), run.integer('count', 1, objects.MAX_PDO_BITS, 1)
        run.done()
        return tuple(MappedObject(index, first + i, bits) for i in range(count))
    entries = section.sequence('map')
    return tuple(MappedObject(*section.checked_integers('map', entry, count=3, low=0, high=objects.MAX_INDEX))
                 for entry in entries)


def _taxels(section: Section) -> tuple[TaxelField, ...]:
    """Read ``taxels``, which is a list of [row, col, start_bit] or {first, step, count, start_bit, bit_step}."""
    written = section.take('taxels')
    if not isinstance(written, dict):
        entries = section.sequence('taxels')
        return tuple(TaxelField(*section.checked_integers('taxels', entry, count=3, low=0, high=MAX_SIDE))
                     for entry in entries)
    run = section.subsection('taxels', written)
    row, col = run.integers('first', 2, 0, MAX_SIDE)
    down, right = run.integers('step', 2, -MAX_SIDE, MAX_SIDE)
    most = objects.MAX_PDO_BITS
    count, start = run.integer('count', 1, most), run.integer('start_bit', 0, most - 1, 0)
    step = run.integer('bit_step', 1, most)
    run.done()
    return tuple(TaxelField(row + i * down, col + i * right, start + i * step) for i in range(count))
