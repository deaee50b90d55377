"""Draft a skin layout from an EDS, and mark guessed or missing values."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from math import isqrt

from canopen import ObjectDictionary
from canopen.objectdictionary import ODVariable
from canopen.objectdictionary.datatypes import SIGNED_TYPES

from tactile_node.cia301 import objects
from tactile_node.errors import ConfigurationError
from tactile_node.skin.layout import MAX_SIDE, MappedObject


@dataclass(frozen=True)
class EdsTpdo:
    """One TPDO in an EDS."""

    number: int
    cob_id: objects.CobId | None  #: COB-ID of the TPDO, or None if the EDS does not contain one
    mapping: tuple[MappedObject, ...]
    unknown: int   #: number of mapped objects that the EDS includes in the count but does not identify
    is_mpdo: bool  #: True for source addressing mode, in which the TPDO has no fixed mapping


def _eds_tpdos(dictionary: ObjectDictionary, node_id: int) -> list[EdsTpdo]:
    """Return the TPDOs of an EDS, which was read for a node-ID, sorted by number."""
    found = []
    for number in range(1, objects.MAX_TPDOS + 1):
        communication, mapping = objects.TPDO_COMMUNICATION + number - 1, objects.TPDO_MAPPING + number - 1
        if communication in dictionary or mapping in dictionary:
            count = _default(dictionary, mapping, 0) or 0
            entries = [] if count > objects.MAX_PDO_BITS else \
                [_default(dictionary, mapping, sub) for sub in range(1, count + 1)]
            found.append(EdsTpdo(number, _cob_id(dictionary, communication, node_id),
                                 tuple(MappedObject(entry >> 16, entry >> 8 & 0xFF, entry & 0xFF)
                                       for entry in entries if entry),
                                 sum(not entry for entry in entries), count == objects.SAM_MPDO))
    return found


def variable_of(dictionary: ObjectDictionary, index: int, sub: int) -> ODVariable | None:
    """Return one value of an EDS, or None if the EDS does not contain it."""
    entry = dictionary[index] if index in dictionary else None
    if isinstance(entry, ODVariable):
        return entry if sub == 0 else None
    return entry[sub] if entry is not None and sub in entry else None


def _default(dictionary: ObjectDictionary, index: int, sub: int) -> int | None:
    variable = variable_of(dictionary, index, sub)
    return variable.default if variable is not None and isinstance(variable.default, int) else None


def _cob_id(dictionary: ObjectDictionary, index: int, node_id: int) -> objects.CobId | None:
    variable, default = variable_of(dictionary, index, 1), _default(dictionary, index, 1)
    if variable is None or not default or not default & objects.ID_MASK:
        return None
    base = default - node_id if variable.relative else default
    return objects.CobId(base & objects.ID_MASK, bool(variable.relative))


FILL_IN = 'FILL IN'     #: mark of a value that no EDS contains
GUESS = 'GUESS'         #: mark of a value that this EDS does not contain
MAX_BITS = 32           #: maximum number of bits per taxel
TAXELS_IN_LINE = 6      #: number of taxels in each line of a list


@dataclass(frozen=True)
class Known:
    """Properties of the skin that the user has given. A property that is None is guessed."""

    rows: int | None = None
    cols: int | None = None
    bits: int | None = None  #: bits per taxel


@dataclass(frozen=True)
class PadSize:
    rows: int
    cols: int
    is_guess: bool


def draft(dictionary: ObjectDictionary, node_id: int, eds: str, known: Known) -> str:
    """Return the YAML text of a layout draft.

    Parameters
    ----------
    dictionary
        Object dictionary from the EDS.
    node_id
        Node-ID for which the EDS was read.
    eds
        Name of the EDS.
    known
        Properties of the skin that the user has given.

    Raises
    ------
    ConfigurationError
        Raised if the EDS maps no object that could contain taxels, or more taxels than ``known`` allows.
    """
    tpdos = _eds_tpdos(dictionary, node_id)
    bits = known.bits or _commonest_width(tpdos, eds)
    starts = {tpdo.number: _starts(tpdo.mapping, bits, is_packed=known.bits is not None) for tpdo in tpdos}
    taxels = sum(map(len, starts.values()))
    if not taxels:
        raise ConfigurationError(f'{eds}, TPDOs', expected=f'objects of at least {bits} bits that TPDOs map by default',
                                 got='none', remedy='Correct --bits, or write the layout by hand.')
    size = _size(taxels, known, eds)
    lines = [*_head(eds, taxels, size, known.bits is None, bits, _is_signed(dictionary, tpdos, bits)), 'tpdos:']
    place = 0
    for tpdo in tpdos:
        lines += _entry(tpdo, starts[tpdo.number], place, size.cols)
        place += len(starts[tpdo.number])
    return '\n'.join(lines) + '\n'


def _commonest_width(tpdos: list[EdsTpdo], eds: str) -> int:
    widths = Counter(mapped.bits for tpdo in tpdos for mapped in tpdo.mapping if 0 < mapped.bits <= MAX_BITS)
    if not widths:
        raise ConfigurationError(f'{eds}, TPDOs', got='none',
                                 expected=f'objects of up to {MAX_BITS} bits that TPDOs map by default',
                                 remedy='If an object holds several taxels, give --bits. For a DOMAIN or '
                                 'MPDOs, start with domain16x10_16bit.yaml or mpdo8x8_16bit.yaml.')
    return max(widths, key=lambda width: (widths[width], width))


def _starts(mapping: tuple[MappedObject, ...], bits: int, *, is_packed: bool) -> list[int]:
    """Return the start bits of the taxels: one for each object of ``bits`` bits, or every ``bits`` bits if packed."""
    total = min(sum(mapped.bits for mapped in mapping), objects.MAX_PDO_BITS)
    if is_packed:
        return list(range(0, total - bits + 1, bits))
    found, start = [], 0
    for mapped in mapping:
        if mapped.bits == bits and start + bits <= objects.MAX_PDO_BITS:
            found.append(start)
        start += mapped.bits
    return found


def _size(taxels: int, known: Known, eds: str) -> PadSize:
    rows, cols = known.rows, known.cols
    if rows is None and cols is None:
        rows = next(side for side in range(isqrt(taxels), 0, -1) if taxels % side == 0)
    if cols is None:
        cols = -(-taxels // (rows or 1))
    if rows is None:
        rows = -(-taxels // cols)
    if rows * cols < taxels or max(rows, cols) > MAX_SIDE:
        raise ConfigurationError(f'{eds}, TPDOs', expected=f'at most {rows} x {cols} taxels, {MAX_SIDE} on a side',
                                 got=str(taxels), remedy='Correct --rows, --cols or --bits.')
    return PadSize(rows, cols, known.rows is None or known.cols is None)


def _is_signed(dictionary: ObjectDictionary, tpdos: list[EdsTpdo], bits: int) -> bool:
    types = [variable.data_type for tpdo in tpdos for mapped in tpdo.mapping if mapped.bits == bits
             and (variable := variable_of(dictionary, mapped.index, mapped.subindex)) is not None]
    return bool(types) and all(data_type in SIGNED_TYPES for data_type in types)


def _head(eds: str, taxels: int, size: PadSize, is_width_guessed: bool, bits: int, signed: bool) -> Iterator[str]:
    guess = f'  # {GUESS}: the EDS maps {taxels} taxels; give --rows or --cols' if size.is_guess else ''
    yield f'# Draft of a skin layout, from {eds}. Replace the values marked {FILL_IN}, and verify those marked {GUESS}'
    yield "# with the device's manual. Then run: tactile check THIS_FILE EDS. sim16x16.yaml explains the keys."
    yield f'rows: {size.rows}{guess}'
    yield f'cols: {size.cols}{guess}'
    yield f'pitch: 1.0  # {FILL_IN}: distance between the centres of neighbouring taxels [m]'
    yield f'finger_ends: []  # {GUESS}: the finger extends beyond the skin at every side, see sim16x16.yaml'
    yield 'value:'
    yield f'  unit: Pa  # {FILL_IN}: Pa, N, or 1 for on/off taxels'
    yield f'  scale: 1.0  # {FILL_IN}: unit per count'
    yield f'  offset: 0  # {FILL_IN}: counts without load'
    yield f'  bits: {bits}' + (f'  # {GUESS}: most common width of a mapped object; give --bits' if is_width_guessed
                               else '')
    yield f'  signed: {str(signed).lower()}  # by the types in the EDS'
    yield f'  pressure: rising  # {GUESS}: or falling, if counts fall under pressure'
    yield f'# {GUESS}: the TPDOs map the taxels row by row, and the device sends its TPDOs by number'


def _entry(tpdo: EdsTpdo, starts: list[int], place: int, cols: int) -> Iterator[str]:
    if not starts:
        mapped = ', '.join(f'0x{m.index:04X} sub {m.subindex} ({m.bits} bits)' for m in tpdo.mapping)
        what = 'sends MPDOs: see mpdo8x8_16bit.yaml' if tpdo.is_mpdo else f'maps {mapped or "nothing"}'
        yield f'# TPDO {tpdo.number} is left out: it {what}'
        return
    cob_id, mark = tpdo.cob_id, ''
    if cob_id is None:
        cob_id, mark = _usual_cob_id(tpdo.number), f'  # {GUESS}: the EDS gives none'
    yield f'- number: {tpdo.number}'
    yield f'  cob_id: {cob_id}{mark}'
    yield f'  map: {_mapping(tpdo.mapping)}' + (f'  # {FILL_IN}: the EDS does not name {tpdo.unknown} more objects'
                                                if tpdo.unknown else '')
    fields = [(*divmod(place + i, cols), start) for i, start in enumerate(starts)]
    yield from _taxels(fields)


def _usual_cob_id(number: int) -> objects.CobId:
    """Return the default COB-ID of TPDOs 1 to 4 (CiA 301, 7.5.2.36), or a free COB-ID for any other TPDO."""
    return objects.CobId(0x180 + 0x100 * ((number - 1) % 4) + (number - 1) // 4, True)


def _mapping(mapping: tuple[MappedObject, ...]) -> str:
    first = mapping[0]
    if all(mapped == MappedObject(first.index, first.subindex + i, first.bits) for i, mapped in enumerate(mapping)):
        return f'{{object: 0x{first.index:04X}, sub: {first.subindex}, bits: {first.bits}, count: {len(mapping)}}}'
    return '[' + ', '.join(f'[0x{each.index:04X}, {each.subindex}, {each.bits}]' for each in mapping) + ']'


def _taxels(fields: list[tuple[int, int, int]]) -> Iterator[str]:
    row, col, start = fields[0]
    step = fields[1][2] - start if len(fields) > 1 else 1
    if fields == [(row, col + i, start + i * step) for i in range(len(fields))]:
        yield (f'  taxels: {{first: [{row}, {col}], step: [0, 1], count: {len(fields)}, start_bit: {start}, '
               f'bit_step: {step}}}')
        return
    lines = [', '.join(f'[{row}, {col}, {bit}]' for row, col, bit in fields[i:i + TAXELS_IN_LINE])
             for i in range(0, len(fields), TAXELS_IN_LINE)]
    yield '  taxels: [' + ',\n           '.join(lines) + ']'
