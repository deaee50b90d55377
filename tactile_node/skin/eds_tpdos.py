"""The TPDOs as an EDS has them by default."""

from dataclasses import dataclass

from canopen import ObjectDictionary
from canopen.objectdictionary import ODVariable

from tactile_node.cia301.cob_id import ID_MASK, CobId
from tactile_node.cia301.objects import TPDO_COMMUNICATION, TPDO_MAPPING
from tactile_node.cia301.pdo import MAX_PDO_BITS, MAX_TPDOS, SAM_MPDO
from tactile_node.skin.layout import MappedObject


@dataclass(frozen=True)
class EdsTpdo:
    """One TPDO of an EDS; None for what the EDS does not give."""

    number: int
    cob_id: CobId | None
    mapping: tuple[MappedObject, ...]
    unknown: int   #: mapped objects that the EDS counts and does not name
    is_mpdo: bool  #: in source addressing mode: it maps nothing itself


def eds_tpdos(dictionary: ObjectDictionary, node_id: int) -> list[EdsTpdo]:
    """Return the TPDOs of an EDS that was read for ``node_id``, by number."""
    found = []
    for number in range(1, MAX_TPDOS + 1):
        communication, mapping = TPDO_COMMUNICATION + number - 1, TPDO_MAPPING + number - 1
        if communication in dictionary or mapping in dictionary:
            count = _default(dictionary, mapping, 0) or 0
            entries = [] if count > MAX_PDO_BITS else \
                [_default(dictionary, mapping, sub) for sub in range(1, count + 1)]
            found.append(EdsTpdo(number, _cob_id(dictionary, communication, node_id),
                                 tuple(MappedObject(entry >> 16, entry >> 8 & 0xFF, entry & 0xFF)
                                       for entry in entries if entry),
                                 sum(not entry for entry in entries), count == SAM_MPDO))
    return found


def variable_of(dictionary: ObjectDictionary, index: int, sub: int) -> ODVariable | None:
    """Return one value of an EDS; None where it is not there."""
    entry = dictionary[index] if index in dictionary else None
    if isinstance(entry, ODVariable):
        return entry if sub == 0 else None
    return entry[sub] if entry is not None and sub in entry else None


def _default(dictionary: ObjectDictionary, index: int, sub: int) -> int | None:
    variable = variable_of(dictionary, index, sub)
    return variable.default if variable is not None and isinstance(variable.default, int) else None


def _cob_id(dictionary: ObjectDictionary, index: int, node_id: int) -> CobId | None:
    variable, default = variable_of(dictionary, index, 1), _default(dictionary, index, 1)
    if variable is None or not default or not default & ID_MASK:
        return None
    base = default - node_id if variable.relative else default
    return CobId(base & ID_MASK, bool(variable.relative))
