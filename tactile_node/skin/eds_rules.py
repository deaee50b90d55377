"""Whether an EDS and a skin layout agree, and whether the EDS declares the objects that the driver sets as they are.

canopen cuts a value that it reads to the size that the EDS declares. An object declared too narrow, or with another
shape, could therefore seem to be set already.
"""

from collections.abc import Callable, Iterator
from functools import partial

from canopen import ObjectDictionary
from canopen.objectdictionary import ODVariable

from tactile_node.cia301.objects import COB_ID_SYNC, PRODUCER_HEARTBEAT_TIME, TPDO_COMMUNICATION, TPDO_MAPPING
from tactile_node.cia301.pdo import EVENT_TIMER, INHIBIT_TIME, MAX_PDO_BITS, TRANSMISSION_TYPE
from tactile_node.errors import ConfigurationError
from tactile_node.skin.eds import refuse_eds
from tactile_node.skin.identity import identity_of
from tactile_node.skin.layout import DomainLayout, SkinLayout, TpdoLayout
from tactile_node.skin.problems import raised_by

#: Bits of the sub-indices (CiA 301): COB-ID, transmission type; inhibit time, event timer; number of mapped objects,
#: mapped objects
COMMUNICATION_BITS = {1: 32, TRANSMISSION_TYPE: 8}
TIME_BITS = {INHIBIT_TIME: 16, EVENT_TIMER: 16}
MAPPING_BITS = {0: 8} | dict.fromkeys(range(1, MAX_PDO_BITS + 1), 32)


def check_against(dictionary: ObjectDictionary, layout: SkinLayout, eds: str) -> None:
    """Raise ConfigurationError where ``layout`` and the EDS named ``eds`` disagree, or the EDS cannot be used."""
    for check in _checks(dictionary, layout, eds):
        check()


def eds_problems(dictionary: ObjectDictionary, layout: SkinLayout, eds: str) -> list[ConfigurationError]:
    """Return all in which ``layout`` and the EDS named ``eds`` disagree: the first problem of each object and TPDO."""
    return raised_by(_checks(dictionary, layout, eds))


def _checks(dictionary: ObjectDictionary, layout: SkinLayout, eds: str) -> Iterator[Callable[[], object]]:
    """Give the rules, each as a call that raises ConfigurationError."""
    yield partial(identity_of, dictionary, eds)
    yield partial(_check_value, dictionary, PRODUCER_HEARTBEAT_TIME, 16, eds)
    if layout.needs_sync:
        yield partial(_check_value, dictionary, COB_ID_SYNC, 32, eds)
    if layout.domain is not None:
        yield partial(_check_domain, dictionary, layout.domain, layout.source, eds)
    communication_bits = COMMUNICATION_BITS if layout.event_driven is None else COMMUNICATION_BITS | TIME_BITS
    for tpdo in layout.tpdos:
        where = f'{layout.source}, TPDO {tpdo.number}'
        yield partial(_check_record, dictionary, TPDO_COMMUNICATION + tpdo.number - 1, bits=communication_bits,
                      where=where, eds=eds)
        yield partial(_check_record, dictionary, TPDO_MAPPING + tpdo.number - 1, bits=MAPPING_BITS, where=where,
                      eds=eds)
        yield partial(_check_mapping, dictionary, tpdo, where, eds)


def _check_value(dictionary: ObjectDictionary, index: int, bits: int, eds: str) -> None:
    """An object that may be absent must be a single value of at least ``bits`` bits."""
    if index not in dictionary:
        return
    entry = dictionary[index]
    if not isinstance(entry, ODVariable):
        refuse_eds(eds, f'section [{index:04X}]', expected='a single value (ObjectType=0x7)',
                   got=f'{type(entry).__name__[2:].upper()} with sub-indices')
    _check_bits(entry, bits, f'section [{index:04X}]', eds)


def _check_record(dictionary: ObjectDictionary, index: int, bits: dict[int, int], where: str, eds: str) -> None:
    """A record, or an array, whose subs have at least ``bits`` bits."""
    if index not in dictionary:
        raise ConfigurationError(where, expected=f'object 0x{index:04X} in {eds}', got='no such object',
                                 remedy='Correct the TPDO number, or use the EDS that belongs to this skin.')
    entry = dictionary[index]
    if isinstance(entry, ODVariable):
        refuse_eds(eds, f'section [{index:04X}]', expected='a RECORD (ObjectType=0x9)', got='a single value (VAR)')
    for sub, variable in entry.subindices.items():
        _check_bits(variable, bits.get(sub, 0), f'section [{index:04X}sub{sub:X}]', eds)


def _check_bits(variable: ODVariable, bits: int, section: str, eds: str) -> None:
    if len(variable) < bits:
        refuse_eds(eds, section, expected=f'a DataType of {bits} bits', got=f'one of {len(variable)} bits')


def _check_domain(dictionary: ObjectDictionary, domain: DomainLayout, source: str, eds: str) -> None:
    if _variable(dictionary, domain.index, domain.subindex) is None:
        raise ConfigurationError(f'{source}, domain', got='no such object',
                                 expected=f'object 0x{domain.index:04X} sub {domain.subindex} in {eds}',
                                 remedy='Correct "domain", or use the EDS that belongs to this skin.')


def _check_mapping(dictionary: ObjectDictionary, tpdo: TpdoLayout, where: str, eds: str) -> None:
    for mapped in tpdo.mapping:
        variable = _variable(dictionary, mapped.index, mapped.subindex)
        if variable is None or len(variable) != mapped.bits:
            raise ConfigurationError(
                where, expected=f'object 0x{mapped.index:04X} sub {mapped.subindex} with {mapped.bits} bits in {eds}',
                got='no such object' if variable is None else f'{len(variable)} bits',
                remedy='Correct "map", or use the EDS that belongs to this skin.')


def _variable(dictionary: ObjectDictionary, index: int, subindex: int) -> ODVariable | None:
    entry = dictionary[index] if index in dictionary else None
    if isinstance(entry, ODVariable):
        return entry if subindex == 0 else None
    return entry[subindex] if entry is not None and subindex in entry else None
