"""Check that an EDS matches a skin layout and correctly declares the objects that the driver sets.

canopen truncates each value that it reads to the size declared in the EDS. If an EDS declares an object with too few
bits or a wrong type, the driver could therefore wrongly conclude that the object is already set.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

from canopen import ObjectDictionary
from canopen.objectdictionary import ODArray, ODRecord, ODVariable

from tactile_node.cia301 import objects
from tactile_node.errors import ConfigurationError
from tactile_node.skin.eds import EdsText, refuse_eds
from tactile_node.skin.layout import DomainLayout, MappedObject, SkinLayout, TpdoLayout
from tactile_node.skin.layout_draft import variable_of


class Identity(NamedTuple):
    """Object 0x1018. In the identity read from an EDS, None or 0 means that the EDS does not specify the value."""

    vendor: int | None
    product: int | None
    revision: int | None

    def accepts(self, device: 'Identity') -> bool:
        """Return True if this EDS describes ``device``.

        If the EDS specifies vendor and product, they must be equal. The upper half of the revision (CiA 301: major, "a
        specific CANopen behaviour") must be equal. The lower half of the revision (minor: same behaviour) must not be
        older than in the EDS.
        """
        same = all(ours in (None, 0, theirs) for ours, theirs in zip(self[:2], device[:2]))
        if not same or self.revision in (None, 0):
            return same
        theirs = device.revision or 0
        return theirs >> 16 == self.revision >> 16 and theirs & 0xFFFF >= self.revision & 0xFFFF

    @property
    def not_given(self) -> tuple[str, ...]:
        """Names of the values that the EDS does not specify, which `accepts` ignores."""
        return tuple(name for name, value in zip(self._fields, self) if value in (None, 0))

    def __str__(self) -> str:
        return ', '.join(f'{name} {"not given" if value is None else f"0x{value:X}"}'
                         for name, value in zip(self._fields, self))


def identity_of(dictionary: ObjectDictionary, eds: str) -> Identity:
    """Return the identity (object 0x1018) in an EDS, with None for values that the EDS does not contain.

    Parameters
    ----------
    dictionary
        Object dictionary from the EDS.
    eds
        Name of the EDS to show in messages.

    Raises
    ------
    ConfigurationError
        Raised if the EDS contains a value that cannot be compared with the identity of a device.
    """
    entry = dictionary[objects.IDENTITY] if objects.IDENTITY in dictionary else None
    if entry is None:
        return Identity(None, None, None)
    if isinstance(entry, ODVariable):
        refuse_eds(eds, f'section [{objects.IDENTITY:04X}]', expected='a RECORD (ObjectType=0x9)',
                   got='a single value (VAR)')
    vendor, product, revision = (_number(entry, sub, eds) for sub in (1, 2, 3))
    return Identity(vendor, product, revision)


def _number(record: ODRecord | ODArray, sub: int, eds: str) -> int | None:
    """Return the default value of ``sub``, or None for an ARRAY element that canopen has made up."""
    variable = record.subindices.get(sub)
    default = None if variable is None else variable.default
    if default is None or isinstance(default, int):
        return default
    refuse_eds(eds, f'section [{objects.IDENTITY:04X}sub{sub}]', expected='an UNSIGNED32 (DataType=0x7)',
               got=repr(default))


#: size of the COB-ID and the transmission type [bits], by sub-index (CiA 301)
COMMUNICATION_BITS = {1: 32, objects.TRANSMISSION_TYPE: 8}
#: size of the inhibit time and the event timer [bits], by sub-index
TIME_BITS = {objects.INHIBIT_TIME: 16, objects.EVENT_TIMER: 16}
#: size of the object count and of the mapped objects [bits], by sub-index
MAPPING_BITS = {0: 8} | dict.fromkeys(range(1, objects.MAX_PDO_BITS + 1), 32)


def check_against(dictionary: ObjectDictionary, layout: SkinLayout, eds: str) -> None:
    """Raise ConfigurationError if the EDS does not match the layout or cannot be used."""
    for check in eds_checks(dictionary, layout, eds):
        check()


def eds_checks(dictionary: ObjectDictionary, layout: SkinLayout, eds: str) -> Iterator[Callable[[], object]]:
    """Yield check functions. Each function raises ConfigurationError for the first problem of an object or a TPDO."""
    text = EdsText(eds)
    yield partial(identity_of, dictionary, eds)
    yield partial(_check_value, dictionary, objects.PRODUCER_HEARTBEAT_TIME, 16, text)
    if layout.needs_sync:
        yield partial(_check_value, dictionary, objects.COB_ID_SYNC, 32, text)
    if layout.domain is not None:
        yield partial(_check_domain, dictionary, layout.domain, layout.source, eds)
    communication_bits = COMMUNICATION_BITS if layout.event_driven is None else COMMUNICATION_BITS | TIME_BITS
    for tpdo in layout.tpdos:
        where = f'{layout.source}, TPDO {tpdo.number}'
        yield partial(_check_record, dictionary, objects.TPDO_COMMUNICATION + tpdo.number - 1, bits=communication_bits,
                      where=where, text=text)
        yield partial(_check_record, dictionary, objects.TPDO_MAPPING + tpdo.number - 1, bits=MAPPING_BITS, where=where,
                      text=text)
        yield partial(_check_mapping, dictionary, tpdo, where, text)


def _check_value(dictionary: ObjectDictionary, index: int, bits: int, text: EdsText) -> None:
    """Check that an object, if present, is a single value with at least ``bits`` bits."""
    if index not in dictionary:
        return
    entry = dictionary[index]
    if not isinstance(entry, ODVariable):
        refuse_eds(text.eds, text.place(f'{index:04X}'), expected='a single value (ObjectType=0x7)',
                   got=f'{type(entry).__name__[2:].upper()} with sub-indices')
    _check_bits(entry, bits, f'{index:04X}', text)


def _check_record(dictionary: ObjectDictionary, index: int, bits: dict[int, int], where: str, text: EdsText) -> None:
    """Check that an object is a record or array whose sub-indices have at least ``bits`` bits."""
    if index not in dictionary:
        raise ConfigurationError(where, expected=f'object 0x{index:04X} in {text.eds}', got='no such object',
                                 remedy='Correct the TPDO number, or use the EDS that belongs to this skin.')
    entry = dictionary[index]
    if isinstance(entry, ODVariable):
        refuse_eds(text.eds, text.place(f'{index:04X}'), expected='a RECORD (ObjectType=0x9)',
                   got='a single value (VAR)')
    for sub, variable in entry.subindices.items():
        _check_bits(variable, bits.get(sub, 0), f'{index:04X}sub{sub:X}', text)


def _check_bits(variable: ODVariable, bits: int, section: str, text: EdsText) -> None:
    if len(variable) < bits:
        refuse_eds(text.eds, text.place(section, 'DataType'), expected=f'a DataType of {bits} bits',
                   got=f'one of {len(variable)} bits')


def _check_domain(dictionary: ObjectDictionary, domain: DomainLayout, source: str, eds: str) -> None:
    if variable_of(dictionary, domain.index, domain.subindex) is None:
        raise ConfigurationError(f'{source}, domain', got='no such object',
                                 expected=f'object 0x{domain.index:04X} sub {domain.subindex} in {eds}',
                                 remedy='Correct "domain", or use the EDS that belongs to this skin.')


def _check_mapping(dictionary: ObjectDictionary, tpdo: TpdoLayout, where: str, text: EdsText) -> None:
    for mapped in tpdo.mapping:
        _check_elements(dictionary, mapped, text)
        variable = variable_of(dictionary, mapped.index, mapped.subindex)
        if variable is None or len(variable) != mapped.bits:
            raise ConfigurationError(
                where, got='no such object' if variable is None else f'{len(variable)} bits',
                expected=f'object 0x{mapped.index:04X} sub {mapped.subindex} with {mapped.bits} bits in {text.eds}',
                remedy='Correct "map", or use the EDS that belongs to this skin.')
        _check_mappable(variable, text)


def _check_elements(dictionary: ObjectDictionary, mapped: MappedObject, text: EdsText) -> None:
    """Check that CompactSubObj declares an unlisted ARRAY element, because canopen guesses such elements from sub 1."""
    title, sub = f'{mapped.index:04X}', mapped.subindex
    entry = dictionary[mapped.index] if mapped.index in dictionary else None
    if not isinstance(entry, ODArray) or text.entry(title) is None or text.entry(f'{title}sub{sub:X}') is not None:
        return
    elements = text.number(title, 'CompactSubObj')
    if not elements:
        refuse_eds(text.eds, text.place(title), got='none, and no "CompactSubObj"',
                   expected=f'a section [{title}sub{sub:X}] for the element that the layout maps')
    if sub > elements:
        refuse_eds(text.eds, text.place(title, 'CompactSubObj'), got=str(elements),
                   expected=f'{sub} elements or more, as the layout maps')


def _check_mappable(variable: ODVariable, text: EdsText) -> None:
    """Check that the network can read a mapped object, and that PDOMapping permits the mapping (CiA 306)."""
    title = f'{variable.index:04X}'
    section = f'{title}sub{variable.subindex:X}'
    # a VAR or CompactSubObj has no section for the sub-index
    section = section if text.entry(section) is not None else title
    if variable.access_type in ('wo', 'rww'):  # the network can only write wo and rww objects; rww is for RPDOs
        refuse_eds(text.eds, text.place(section, 'AccessType'), got=variable.access_type,
                   expected='ro, rw, rwr or const for an object that a TPDO sends')
    if text.number(section, 'PDOMapping') == 0:
        refuse_eds(text.eds, text.place(section, 'PDOMapping'), got='0',
                   expected='PDOMapping=1 for an object that the layout maps')
