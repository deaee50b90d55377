"""Reads a skin layout from YAML; ``config/sim16x16.yaml`` shows every key with its meaning."""

from functools import partial
from pathlib import Path

from tactile_node.cia301.cob_id import ID_MASK, CobId, parse_cob_id
from tactile_node.cia301.connection_set import SYNC
from tactile_node.cia301.node_id import MAX_NODE_ID
from tactile_node.cia301.objects import MAX_INDEX, MAX_SUBINDEX
from tactile_node.cia301.pdo import MAX_PDO_BITS, MAX_TPDOS, MPDO_DATA_BITS
from tactile_node.package_files import config_path
from tactile_node.skin.event_driven import read_event_driven
from tactile_node.skin.layout import (
    MAX_DOMAIN_BYTES,
    MAX_SIDE,
    DomainLayout,
    MappedObject,
    SkinLayout,
    TaxelField,
    TpdoLayout,
    ValueFormat,
    raw_range,
)
from tactile_node.skin.layout_rules import check_layout
from tactile_node.skin.tpdo_repeat import repeated
from tactile_node.yaml_section import Section, load_mapping, shown

UNITS = ('Pa', 'N', '1')  # '1': on/off


def load_layout(path: str | Path) -> SkinLayout:
    """Read a skin layout; ``path`` is a file or the name of one in ``config/``.

    Raises ConfigurationError naming file and key for anything wrong: see the module ``layout_rules``.
    """
    layout = read_layout(path)
    check_layout(layout)
    return layout


def read_layout(path: str | Path) -> SkinLayout:
    """Read a skin layout as it is written, whether or not it obeys the rules. Raises ConfigurationError."""
    path = config_path(str(path))
    top = load_mapping(path, 'a skin layout')
    rows = top.integer('rows', 1, MAX_SIDE)
    cols = top.integer('cols', 1, MAX_SIDE)
    domain = _domain(top, rows, cols)
    tpdos = top.sequence('tpdos') if domain is None else top.sequence('tpdos', [])
    sections = [top.subsection(f'tpdos[{i}]', item) for i, item in enumerate(tpdos)]
    layout = SkinLayout(
        source=str(path), rows=rows, cols=cols, pitch=top.number('pitch', positive=True),
        value=_value_format(top.section('value')), sync_cob_id=top.integer('sync_cob_id', 1, ID_MASK, SYNC),
        tpdos=tuple(tpdo for section in sections for tpdo in _tpdos(section)),
        dead=tuple(_taxel(top, taxel) for taxel in top.sequence('dead_taxels', [])),
        nodes=top.integer('nodes', 1, MAX_NODE_ID, 1), domain=domain,
        event_driven=read_event_driven(top), unusual_pitch=top.choice('unusual_pitch', (False, True), False))
    top.done()
    return layout


def _taxel(top: Section, written: object) -> tuple[int, int]:
    row, col = top.checked_integers('dead_taxels', written, count=2, low=0, high=MAX_SIDE)
    return row, col


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
    """Read ``domain``: where the object is and how the taxels lie in it, row by row or column by column."""
    if top.take('domain', None) is None:
        return None
    section = top.section('domain')
    index, sub = section.integer('object', 1, MAX_INDEX), section.integer('sub', 0, MAX_SUBINDEX, 0)
    length = section.integer('bytes', 1, MAX_DOMAIN_BYTES)
    start, step = section.integer('start_bit', 0, 8 * length, 0), section.integer('bit_step', 1, 8 * length)
    places = [(row, col) for row in range(rows) for col in range(cols)]
    if section.choice('order', ('rows', 'cols'), 'rows') == 'cols':
        places.sort(key=lambda place: place[::-1])
    section.done()
    return DomainLayout(index, sub, length,
                        tuple(TaxelField(row, col, start + i * step) for i, (row, col) in enumerate(places)))


def _tpdos(section: Section) -> tuple[TpdoLayout, ...]:
    """Read one entry of ``tpdos``: a plain TPDO, all rows of a multiplexed one, or a run of MPDOs, each repeated."""
    number = section.integer('number', 1, MAX_TPDOS)
    cob_id = _cob_id(section)
    node = section.integer('node', 0, MAX_NODE_ID - 1, 0)
    make = partial(TpdoLayout, number, cob_id, node=node, key=section.path)
    if section.take('mpdo', None) is not None:
        run = section.section('mpdo')
        index, first = run.integer('object', 1, MAX_INDEX), run.integer('sub', 0, MAX_SUBINDEX)
        tpdos = [make((MappedObject(index, first + i, MPDO_DATA_BITS),), taxels, is_mpdo=True)
                 for i, taxels in enumerate(_shifted(section, _repeats(run, MAX_SUBINDEX + 1 - first)))]
    elif section.take('rows', None) is not None:
        run, mapping = section.section('rows'), _mapping(section)
        first = run.integer('first', 0, 255, 0)
        tpdos = [make(mapping, taxels, row=first + i)
                 for i, taxels in enumerate(_shifted(section, _repeats(run, 256 - first)))]
    else:
        tpdos = [make(_mapping(section), _taxels(section))]
    repetitions = repeated(section, tuple(tpdos))
    section.done()
    return repetitions


def _repeats(run: Section, most: int) -> list[tuple[int, int]]:
    """Read ``count`` and ``step``: how far [row, col] each frame's taxels are from the first's."""
    count = run.integer('count', 1, most)
    down, right = run.integers('step', 2, -MAX_SIDE, MAX_SIDE)
    run.done()
    return [(i * down, i * right) for i in range(count)]


def _shifted(section: Section, shifts: list[tuple[int, int]]) -> list[tuple[TaxelField, ...]]:
    fields = _taxels(section)
    return [tuple(TaxelField(row + down, col + right, bit) for row, col, bit in fields) for down, right in shifts]


def _cob_id(section: Section) -> CobId:
    written = section.take('cob_id')
    try:
        return parse_cob_id(written)
    except ValueError:
        section.refuse('cob_id', expected="an 11-bit COB-ID such as 0x1A0 or '$NODEID+0x180'",
                       got=shown(written),
                       remedy='Write it as in the EDS, without the flags of bits 29 to 31.')


def _mapping(section: Section) -> tuple[MappedObject, ...]:
    """Read ``map``: a list of [index, sub, bits], or {object, sub, bits, count} for consecutive subs."""
    written = section.take('map')
    if isinstance(written, dict):
        run = section.subsection('map', written)
        index, first = run.integer('object', 1, MAX_INDEX), run.integer('sub', 0, MAX_SUBINDEX)
        bits, count = run.integer('bits', 1, MAX_PDO_BITS), run.integer('count', 1, MAX_PDO_BITS, 1)
        run.done()
        return tuple(MappedObject(index, first + i, bits) for i in range(count))
    entries = section.sequence('map')
    return tuple(MappedObject(*section.checked_integers('map', entry, count=3, low=0, high=MAX_INDEX))
                 for entry in entries)


def _taxels(section: Section) -> tuple[TaxelField, ...]:
    """Read ``taxels``: a list of [row, col, start_bit], or {first, step, count, start_bit, bit_step}."""
    written = section.take('taxels')
    if not isinstance(written, dict):
        entries = section.sequence('taxels')
        return tuple(TaxelField(*section.checked_integers('taxels', entry, count=3, low=0, high=MAX_SIDE))
                     for entry in entries)
    run = section.subsection('taxels', written)
    row, col = run.integers('first', 2, 0, MAX_SIDE)
    down, right = run.integers('step', 2, -MAX_SIDE, MAX_SIDE)
    count, start = run.integer('count', 1, MAX_PDO_BITS), run.integer('start_bit', 0, MAX_PDO_BITS - 1, 0)
    step = run.integer('bit_step', 1, MAX_PDO_BITS)
    run.done()
    return tuple(TaxelField(row + i * down, col + i * right, start + i * step) for i in range(count))
