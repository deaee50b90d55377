"""Loads an EDS (CiA 306) through canopen; what that cannot read becomes a sentence with section and key."""

import re
from configparser import DuplicateOptionError, DuplicateSectionError, RawConfigParser
from configparser import Error as ParserError
from io import StringIO
from pathlib import Path
from typing import NamedTuple, NoReturn

from canopen import ObjectDictionary
from canopen.objectdictionary import ODVariable
from canopen.objectdictionary.eds import import_eds

from tactile_node.cia301.objects import IDENTITY, TPDO_COMMUNICATION, TPDO_MAPPING
from tactile_node.errors import ConfigurationError
from tactile_node.package_files import config_path
from tactile_node.skin.layout import SkinLayout, TpdoLayout

_OBJECT = re.compile(r'[0-9A-Fa-f]{4}')
_SUBOBJECT = re.compile(r'([0-9A-Fa-f]{4})[Ss][Uu][Bb]([0-9A-Fa-f]+)')
_INFO_NUMBERS = ('VendorNumber', 'ProductNumber', 'RevisionNumber', 'Granularity', 'NrOfRXPDO', 'NrOfTXPDO',
                 'SimpleBootUpMaster', 'SimpleBootUpSlave', 'DynamicChannelsSupported', 'GroupMessaging',
                 'LSS_Supported')
_TITLES = {'deviceinfo': 'DeviceInfo', 'fileinfo': 'FileInfo'}
_IGNORED = ('Comments', 'DummyUsage', 'DeviceComissioning')  # nothing in these speaks of taxels
_PLAIN_TYPES = ('0x7', '0x07', '7', '0x2', '0x02', '2')  # VAR and DOMAIN: these carry the value themselves


class Identity(NamedTuple):
    """Object 0x1018; None where the EDS gives no value (then it is not checked)."""

    vendor: int | None
    product: int | None
    revision: int | None

    def accepts(self, device: 'Identity') -> bool:
        """Whether ``device`` is what this EDS describes.

        Vendor and product must be equal. Of the revision, the upper half (CiA 301: major, "a specific CANopen
        behaviour") must be equal and the lower half (minor: same behaviour) must not be older.
        """
        same = all(ours in (None, 0, theirs) for ours, theirs in zip(self[:2], device[:2]))
        if not same or self.revision in (None, 0):
            return same
        theirs = device.revision or 0
        return theirs >> 16 == self.revision >> 16 and theirs & 0xFFFF >= self.revision & 0xFFFF

    def __str__(self) -> str:
        return ', '.join(f'{name} {"not given" if value is None else f"0x{value:X}"}'
                         for name, value in zip(self._fields, self))


def load_eds(path: str | Path, node_id: int) -> ObjectDictionary:
    """Return the object dictionary of ``path`` (a file or the name of one in ``config/``) for ``node_id``.

    Raises ConfigurationError when it is no EDS or canopen cannot make sense of it.
    """
    path = config_path(str(path))
    try:
        text = _decode(path.read_bytes())
    except OSError as error:
        raise ConfigurationError(str(path), expected='an EDS file', got=error.strerror or str(error),
                                 remedy='Check the path and its permissions.') from error
    tidied = StringIO()
    _checked(path, text).write(tidied)
    tidied.seek(0)
    try:
        return import_eds(tidied, node_id)
    except Exception as error:  # canopen lets KeyError, ValueError, configparser's and others through
        _refuse(path, 'an EDS that canopen can read', f'{type(error).__name__}: {error}'.replace('\n', ' '))


def identity_of(dictionary: ObjectDictionary) -> Identity:
    """What the EDS says of 0x1018."""
    subs = dictionary[IDENTITY] if IDENTITY in dictionary else {}
    return Identity(*(subs[sub].default if sub in subs else None for sub in (1, 2, 3)))


def check_against(dictionary: ObjectDictionary, layout: SkinLayout, eds: str) -> None:
    """Raise ConfigurationError where ``layout`` uses a TPDO or an object that the EDS does not have."""
    if (domain := layout.domain) is not None and _variable(dictionary, domain.index, domain.subindex) is None:
        raise ConfigurationError(f'{layout.source}, domain', got='no such object',
                                 expected=f'object 0x{domain.index:04X} sub {domain.subindex} in {eds}',
                                 remedy='Correct "domain", or use the EDS that belongs to this skin.')
    for tpdo in layout.tpdos:
        where = f'{layout.source}, TPDO {tpdo.number}'
        for record in (TPDO_COMMUNICATION, TPDO_MAPPING):
            if record + tpdo.number - 1 not in dictionary:
                raise ConfigurationError(
                    where, expected=f'object 0x{record + tpdo.number - 1:04X} in {eds}', got='no such object',
                    remedy='Correct the TPDO number, or use the EDS that belongs to this skin.')
        _check_mapping(dictionary, tpdo, where, eds)


def _check_mapping(dictionary: ObjectDictionary, tpdo: TpdoLayout, where: str, eds: str) -> None:
    for index, subindex, bits in tpdo.mapping:
        variable = _variable(dictionary, index, subindex)
        if variable is None or len(variable) != bits:
            raise ConfigurationError(
                where, expected=f'object 0x{index:04X} sub {subindex} with {bits} bits in {eds}',
                got='no such object' if variable is None else f'{len(variable)} bits',
                remedy='Correct "map", or use the EDS that belongs to this skin.')


def _variable(dictionary: ObjectDictionary, index: int, subindex: int) -> ODVariable | None:
    entry = dictionary[index] if index in dictionary else None
    if isinstance(entry, ODVariable):
        return entry if subindex == 0 else None
    return entry[subindex] if entry is not None and subindex in entry else None


def _decode(content: bytes) -> str:
    try:
        return content.decode('utf-8-sig')
    except UnicodeDecodeError:  # vendors' tools write their national code page in names and comments
        return content.decode('latin-1')


def _checked(path: Path, text: str) -> RawConfigParser:
    """Find, with section and key, what canopen would stumble over; what is harmless is put right or left out."""
    parser = RawConfigParser(inline_comment_prefixes=(';',))
    parser.optionxform = str
    try:
        parser.read_string(text)
    except (DuplicateSectionError, DuplicateOptionError) as error:
        key = f', key "{error.option}"' if isinstance(error, DuplicateOptionError) else ''
        _refuse(path, 'every section and key once',
                f'section [{error.section}]{key} again in line {error.lineno}')
    except ParserError as error:
        _refuse(path, 'an EDS file ("[section]" lines with "key=value" lines)', str(error).splitlines()[0])
    parser = _tidied(path, parser)
    objects = [name for name in parser.sections() if _OBJECT.fullmatch(name) or _SUBOBJECT.fullmatch(name)]
    if not objects:
        _refuse(path, 'an EDS file with object sections such as [1018]',
                f'{len(parser.sections())} other sections')
    for name in objects:
        _check_object(path, parser, name)
    for key, value in parser.items('DeviceInfo') if parser.has_section('DeviceInfo') else ():
        if key in _INFO_NUMBERS or key.startswith('BaudRate_'):
            _check_number(path, 'DeviceInfo', key, value)
    return parser


def _tidied(path: Path, parser: RawConfigParser) -> RawConfigParser:
    """Section names as canopen wants them, no empty values (as good as absent), no comments."""
    tidied = RawConfigParser()
    tidied.optionxform = str
    for name in parser.sections():
        sub = _SUBOBJECT.fullmatch(name)
        title = f'{sub[1]}sub{sub[2]}' if sub else _TITLES.get(name.lower(), name)
        if title in _IGNORED:
            continue
        if tidied.has_section(title):
            _refuse(path, 'every section once', f'section [{title}] again as [{name}]')
        tidied[title] = {key: value for key, value in parser.items(name) if value}
    return tidied


def _check_object(path: Path, parser: RawConfigParser, name: str) -> None:
    sub = _SUBOBJECT.fullmatch(name)
    if sub and not any(parser.has_section(f(sub[1])) for f in (str.upper, str.lower, str)):
        _refuse(path, f'a section [{sub[1]}] before [{name}]', 'no such section')
    carries_value = sub or parser.get(name, 'ObjectType', fallback='0x7').strip() in _PLAIN_TYPES
    for key in ('ParameterName', 'DataType', 'AccessType') if carries_value else ('ParameterName',):
        if not parser.has_option(name, key):
            _refuse(path, f'key "{key}" in section [{name}]', 'no such key')
    for key in ('ObjectType', 'DataType', 'PDOMapping'):
        _check_number(path, name, key, parser.get(name, key, fallback='0').strip())
    if parser.has_option(name, 'CompactSubObj') and not parser.has_option(name, 'DataType'):
        _refuse(path, f'key "DataType" in section [{name}], which has "CompactSubObj"', 'no such key')


def _check_number(path: Path, section: str, key: str, value: str) -> None:
    try:
        int(value, 0)
    except ValueError:
        _refuse(path, f'a number in section [{section}], key "{key}"', repr(value))


def _refuse(path: Path, expected: str, got: str) -> NoReturn:
    raise ConfigurationError(str(path), expected=expected, got=got,
                             remedy="Use the device maker's EDS, or correct this one (CiA 306).")
