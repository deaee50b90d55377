"""Find taxel fields that contradict the mapped objects that carry them.

The driver accepts such a layout, because a device may use a part of an object, or ignore CiA 301. In most cases, the
layout is wrong, and the pad then shows wrong values that look like taxels.
"""

from collections.abc import Iterator
from typing import NamedTuple

from canopen import ObjectDictionary
from canopen.objectdictionary.datatypes import INTEGER_TYPES, SIGNED_TYPES

from tactile_node.skin.layout import MappedObject, SkinLayout, TaxelField, TpdoLayout
from tactile_node.skin.layout_draft import variable_of

LEAST_INDEX = 0x1000  #: Smaller indices are data types, which a mapping may repeat to leave a gap (CiA 301).


class _CarriedField(NamedTuple):
    field: TaxelField
    mapped: MappedObject  #: object that carries this taxel and no other

    def __str__(self) -> str:
        return (f'object 0x{self.mapped.index:04X} sub {self.mapped.subindex} for taxel ({self.field.row}, '
                f'{self.field.col})')


def field_hints(layout: SkinLayout, dictionary: ObjectDictionary | None) -> list[str]:
    """Return a sentence for each way in which the taxel fields contradict the mapped objects.

    Parameters
    ----------
    layout
        Layout that the driver accepts.
    dictionary
        Object dictionary from the EDS, or None if it cannot be read. Without it, the sign is not checked.
    """
    value = layout.value
    tpdos = [tpdo for tpdo in layout.tpdos if not tpdo.is_multiplexed]
    carried = [each for tpdo in tpdos for each in _carried_alone(tpdo, value.bits)]
    wider = [each for each in carried if each.mapped.bits > value.bits]
    whole = [each for each in carried if each.mapped.bits == value.bits]
    of_other_sign = [] if dictionary is None else [
        each for each in whole if _is_signed(dictionary, each.mapped) not in (None, value.signed)]
    repeated = _repeated(tpdos)
    found = []
    if wider:
        found.append(f'"value.bits" is {value.bits}, but {wider[0]} has {wider[0].mapped.bits} bits. Write '
                     f'bits: {wider[0].mapped.bits}, unless the other bits do not belong to the value')
    if whole and value.bits > 8 and value.byte_order == 'big':
        found.append(f'"value.byte_order" is big, but {whole[0]} is one number, and CiA 301 sends the least '
                     'significant byte of a number first. Write byte_order: little, unless the device is known to '
                     'deviate')
    if of_other_sign:
        found.append(f'"value.signed" is {str(value.signed).lower()}, but in the EDS {of_other_sign[0]} is '
                     f'{"unsigned" if value.signed else "signed"}. Correct "signed", unless the EDS is wrong')
    if repeated:
        mapped, first, second = repeated[0]
        more = f', and {len(repeated) - 1} more are mapped twice' if len(repeated) > 1 else ''
        found.append(f'object 0x{mapped.index:04X} sub {mapped.subindex} is mapped in {first} and in {second}{more}. '
                     'Correct "map", unless the device sends an object twice')
    return found


def _carried_alone(tpdo: TpdoLayout, bits: int) -> Iterator[_CarriedField]:
    """Yield each field that lies within one mapped object, if that object carries no other field."""
    end = 0
    for mapped in tpdo.mapping:
        begin, end = end, end + mapped.bits
        touching = [field for field in tpdo.taxels if field.start_bit < end and field.start_bit + bits > begin]
        if len(touching) == 1 and begin <= touching[0].start_bit and touching[0].start_bit + bits <= end:
            yield _CarriedField(touching[0], mapped)


def _is_signed(dictionary: ObjectDictionary, mapped: MappedObject) -> bool | None:
    """Return True if the EDS declares a signed integer, and None if it declares no integer."""
    variable = variable_of(dictionary, mapped.index, mapped.subindex)
    if variable is None or variable.data_type not in INTEGER_TYPES:
        return None
    return variable.data_type in SIGNED_TYPES


def _repeated(tpdos: list[TpdoLayout]) -> list[tuple[MappedObject, str, str]]:
    """Return the objects that a node sends twice, with the keys of both TPDOs."""
    seen: dict[tuple[int, MappedObject], str] = {}
    found = []
    for tpdo in tpdos:
        for mapped in tpdo.mapping:
            first = seen.setdefault((tpdo.node, mapped), tpdo.key)
            if first != tpdo.key and mapped.index >= LEAST_INDEX:
                found.append((mapped, first, tpdo.key))
    return found
