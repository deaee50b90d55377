"""The key ``repeat`` of a layout's TPDO: one entry that stands for many, each a step further than the one before."""

from dataclasses import replace
from itertools import product
from typing import NamedTuple

from tactile_node.cia301.cob_id import ID_MASK, CobId
from tactile_node.cia301.node_id import MAX_NODE_ID
from tactile_node.cia301.objects import MAX_INDEX, MAX_SUBINDEX
from tactile_node.cia301.pdo import MAX_TPDOS
from tactile_node.skin.layout import MAX_SIDE, MappedObject, TaxelField, TpdoLayout
from tactile_node.yaml_section import Section

MOST = MAX_TPDOS  #: repetitions of one entry: bounds what a mistyped layout can allocate


class Shift(NamedTuple):
    """How far a repetition is from the entry as it is written."""

    number: int = 0
    cob_id: int = 0
    object: int = 0
    sub: int = 0
    node: int = 0
    down: int = 0   #: of all taxels
    right: int = 0


#: what each step may be at most, either way
LARGEST = {'number': MAX_TPDOS, 'cob_id': ID_MASK, 'object': MAX_INDEX, 'sub': MAX_SUBINDEX, 'node': MAX_NODE_ID}


def repeated(section: Section, tpdos: tuple[TpdoLayout, ...]) -> tuple[TpdoLayout, ...]:
    """Return the ``tpdos`` of an entry in all repetitions that its key ``repeat`` asks for, the last loop fastest.

    Raises ConfigurationError, also where a repetition leaves the range of a number.
    """
    if (written := section.take('repeat', None)) is None:
        return tpdos
    loops = [section.subsection('repeat', written)] if not isinstance(written, list) else \
        [section.subsection(f'repeat[{i}]', loop) for i, loop in enumerate(written)]
    shifts, total = [], 1
    for loop in loops:
        count, step = _loop(loop)
        total *= count
        if total > MOST:
            section.refuse('repeat', expected=f'at most {MOST} repetitions', got=f'{total} or more',
                           remedy='Correct the counts.')
        shifts.append([Shift._make(i * part for part in step) for i in range(count)])
    return tuple(_shifted(section, tpdo, _total(parts)) for parts in product(*shifts) for tpdo in tpdos)


def _total(parts: tuple[Shift, ...]) -> Shift:
    return Shift._make(sum(part[i] for part in parts) for i in range(len(Shift._fields)))


def _loop(loop: Section) -> tuple[int, Shift]:
    count = loop.integer('count', 1, MOST)
    numbers = [loop.integer(key, -most, most, 0) for key, most in LARGEST.items()]
    down, right = loop.checked_integers('step', loop.take('step', [0, 0]), count=2, low=-MAX_SIDE, high=MAX_SIDE)
    loop.done()
    return count, Shift._make((*numbers, down, right))


def _shifted(section: Section, tpdo: TpdoLayout, shift: Shift) -> TpdoLayout:
    number, node, cob_id = tpdo.number + shift.number, tpdo.node + shift.node, tpdo.cob_id.base + shift.cob_id
    mapping = tuple(MappedObject(mapped.index + shift.object, mapped.subindex + shift.sub, mapped.bits)
                    for mapped in tpdo.mapping)
    _check(section, 'number', number, 1, MAX_TPDOS)
    _check(section, 'node', node, 0, MAX_NODE_ID - 1)
    _check(section, 'cob_id', cob_id, 0, ID_MASK)
    for mapped in mapping:
        _check(section, 'object', mapped.index, 1, MAX_INDEX)
        _check(section, 'sub', mapped.subindex, 0, MAX_SUBINDEX)
    taxels = tuple(TaxelField(row + shift.down, col + shift.right, bit) for row, col, bit in tpdo.taxels)
    what = f'node {node}, TPDO {number}' if shift.node else f'TPDO {number}'
    what += f', object 0x{mapping[0].index:04X}' if tpdo.is_mpdo else ''
    return replace(tpdo, number=number, node=node, cob_id=CobId(cob_id, tpdo.cob_id.relative), mapping=mapping,
                   taxels=taxels, key=f'{tpdo.key} ({what})')


def _check(section: Section, key: str, value: int, low: int, high: int) -> None:
    if not low <= value <= high:
        section.refuse('repeat', expected=f'repetitions whose "{key}" is {low}..{high}, 0x{low:X}..0x{high:X}',
                       got=f'{value}' if value < 0 else f'{value}, 0x{value:X}', remedy=f'Correct count or {key}.')
