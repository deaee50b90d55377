"""The identity object 0x1018: which device an EDS describes."""

from typing import NamedTuple

from canopen import ObjectDictionary
from canopen.objectdictionary import ODArray, ODRecord, ODVariable

from tactile_node.cia301.objects import IDENTITY
from tactile_node.skin.eds import refuse_eds


class Identity(NamedTuple):
    """Object 0x1018. In the identity of an EDS, None or 0 stands for a value that is not given."""

    vendor: int | None
    product: int | None
    revision: int | None

    def accepts(self, device: 'Identity') -> bool:
        """Whether ``device`` is what this EDS describes.

        Vendor and product must be equal, as far as they are given. Of the revision, the upper half (CiA 301: major,
        "a specific CANopen behaviour") must be equal and the lower half (minor: same behaviour) must not be older.
        """
        same = all(ours in (None, 0, theirs) for ours, theirs in zip(self[:2], device[:2]))
        if not same or self.revision in (None, 0):
            return same
        theirs = device.revision or 0
        return theirs >> 16 == self.revision >> 16 and theirs & 0xFFFF >= self.revision & 0xFFFF

    @property
    def not_given(self) -> tuple[str, ...]:
        """Names of the values that are not given: of these, ``accepts`` accepts any."""
        return tuple(name for name, value in zip(self._fields, self) if value in (None, 0))

    def __str__(self) -> str:
        return ', '.join(f'{name} {"not given" if value is None else f"0x{value:X}"}'
                         for name, value in zip(self._fields, self))


def identity_of(dictionary: ObjectDictionary, eds: str) -> Identity:
    """Return object 0x1018 of the EDS named ``eds``; None for what it does not give.

    Raises ConfigurationError when the EDS gives something that cannot be compared with a device's identity.
    """
    entry = dictionary[IDENTITY] if IDENTITY in dictionary else None
    if entry is None:
        return Identity(None, None, None)
    if isinstance(entry, ODVariable):
        refuse_eds(eds, f'section [{IDENTITY:04X}]', expected='a RECORD (ObjectType=0x9)', got='a single value (VAR)')
    vendor, product, revision = (_number(entry, sub, eds) for sub in (1, 2, 3))
    return Identity(vendor, product, revision)


def _number(record: ODRecord | ODArray, sub: int, eds: str) -> int | None:
    """The default of ``sub``. A sub that the EDS does not list is not looked up: canopen makes it up in an ARRAY."""
    variable = record.subindices.get(sub)
    default = None if variable is None else variable.default
    if default is None or isinstance(default, int):
        return default
    refuse_eds(eds, f'section [{IDENTITY:04X}sub{sub}]', expected='an UNSIGNED32 (DataType=0x7)', got=repr(default))
