"""Load an EDS (CiA 306) with canopen. Errors name the section and the key."""

import pickle
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable
from configparser import DuplicateOptionError, DuplicateSectionError, RawConfigParser, SectionProxy
from configparser import Error as ParserError
from contextlib import suppress
from functools import lru_cache
from io import StringIO
from pathlib import Path
from typing import NamedTuple, NoReturn

from canopen import ObjectDictionary
from canopen.objectdictionary.datatypes import BOOLEAN, INTEGER_TYPES
from canopen.objectdictionary.eds import import_eds

from tactile_node.cia301.objects import IDENTITY, read_octal
from tactile_node.errors import ConfigurationError
from tactile_node.package_files import config_path

_OBJECT = re.compile(r'[0-9A-Fa-f]{4}')
_SUBOBJECT = re.compile(r'([0-9A-Fa-f]{4})[Ss][Uu][Bb]([0-9A-Fa-f]+)')
_INFO_NUMBERS = ('VendorNumber', 'ProductNumber', 'RevisionNumber', 'Granularity', 'NrOfRXPDO', 'NrOfTXPDO',
                 'SimpleBootUpMaster', 'SimpleBootUpSlave', 'DynamicChannelsSupported', 'GroupMessaging',
                 'LSS_Supported')
_NUMBERS = (*_INFO_NUMBERS, 'ObjectType', 'DataType', 'PDOMapping', 'SubNumber', 'CompactSubObj',
            *(f'BaudRate_{rate}' for rate in (10, 20, 50, 125, 250, 500, 800, 1000)))
# keys whose values are numbers if the DataType is numeric
_VALUES = 'DefaultValue', 'ParameterValue', 'LowLimit', 'HighLimit'
#: spelling that canopen expects for each lower-case key, because CiA 306 does not specify upper or lower case
_KEYS = {key.lower(): key for key in (
    *_NUMBERS, *_VALUES, 'VendorName', 'ProductName', 'OrderCode', 'ParameterName', 'AccessType', 'StorageLocation',
    'Denotation', 'Factor', 'Unit', 'Description', 'SupportedObjects', 'NrOfEntries')}
_TITLES = {'deviceinfo': 'DeviceInfo', 'fileinfo': 'FileInfo'}
_PLAIN_TYPES = ('0x7', '0x07', '7', '0x2', '0x02', '2')  # VAR and DOMAIN, which hold a value themselves
#: Number of EDS files that stay in memory. `tactile scan` reads all files of config/ in turn, and a smaller cache would
#: drop each file before its next use.
CACHED_FILES = 16
_REMEDY = "Use the device maker's EDS, or correct this one (CiA 306)."
_import_eds: Callable[[StringIO, int], ObjectDictionary] = import_eds  # canopen has no type annotations


class _Parser(RawConfigParser):
    """Parser that converts keys to the spelling that canopen expects."""

    def optionxform(self, optionstr: str) -> str:
        return _KEYS.get(optionstr.lower(), optionstr)


def load_eds(path: str | Path, node_id: int) -> ObjectDictionary:
    """Return the object dictionary of an EDS.

    Parameters
    ----------
    path
        Path of the EDS, or the name of an EDS in ``config/``.
    node_id
        Node-ID for which the EDS is read.

    Raises
    ------
    ConfigurationError
        Raised if the file is not an EDS, or if canopen cannot read the EDS.
    """
    path = config_path(str(path))
    try:
        text = read_eds(path)
    except OSError as error:
        raise ConfigurationError(str(path), expected='an EDS file', got=error.strerror or str(error),
                                 remedy='Check the path and its permissions.') from error
    dictionary: ObjectDictionary = pickle.loads(_pickled(path, text, node_id))
    return dictionary


# The dictionary is cached as a pickle, because callers may change their copy. Reading the EDS again would take ten
# times as long.
@lru_cache(maxsize=CACHED_FILES)
def _pickled(path: Path, text: str, node_id: int) -> bytes:
    """Return the pickled object dictionary of the EDS content ``text``. Raises ConfigurationError."""
    checked = _checked(path, text)
    try:
        return pickle.dumps(_import_eds(StringIO(checked), node_id))
    except Exception as error:  # canopen also raises KeyError, ValueError and configparser errors
        _refuse(path, 'an EDS that canopen can read', f'{type(error).__name__}: {error}'.replace('\n', ' '))


@lru_cache(maxsize=CACHED_FILES)  # several nodes share an EDS, and one check takes 0.1 s
def _checked(path: Path, text: str) -> str:
    """Rewrite the EDS content ``text`` in a form that canopen can read. Raises ConfigurationError."""
    checked = StringIO()
    _check_text(path, text).write(checked)
    return checked.getvalue()


def read_eds(path: Path) -> str:
    """Return the text of an EDS, up to a DOS end-of-file character. Raises OSError."""
    return _decode(path.read_bytes()).split('\x1a', 1)[0]  # old DOS editors end a file with this character


def _decode(content: bytes) -> str:
    if content.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return content.decode('utf-16', 'replace')
    try:
        return content.decode('utf-8-sig')
    except UnicodeDecodeError:  # vendor tools write names and comments in a national code page
        return content.decode('latin-1')


def _check_text(path: Path, text: str) -> _Parser:
    """Reject content that canopen cannot read, and name its section and key. Correct or drop harmless content."""
    parser = _Parser(inline_comment_prefixes=(';',))
    try:
        parser.read_string(text)
    except (DuplicateSectionError, DuplicateOptionError) as error:
        key = f', key "{error.option}"' if isinstance(error, DuplicateOptionError) else ''
        _refuse(path, 'every section and key once',
                f'section [{error.section}]{key} again in line {error.lineno}')
    except ParserError as error:
        _refuse(path, 'an EDS file ("[section]" lines with "key=value" lines)', str(error).splitlines()[0])
    parser = _tidy(path, parser)
    objects = [name for name in parser.sections() if _OBJECT.fullmatch(name) or _SUBOBJECT.fullmatch(name)]
    if not objects:
        _refuse(path, 'an EDS file with object sections such as [1018]',
                f'{len(parser.sections())} other sections')
    for name in objects:
        _check_object(path, parser, name)
    _check_identity(path, parser)
    for key, value in parser.items('DeviceInfo') if parser.has_section('DeviceInfo') else ():
        if key in _INFO_NUMBERS or key.startswith('BaudRate_'):
            _check_number(path, 'DeviceInfo', key, value)
    return parser


def _tidy(path: Path, parser: _Parser) -> _Parser:
    """Convert section names to canopen's spelling. Drop comment sections. Drop empty values, which mean "absent"."""
    tidied = _Parser()
    for name in parser.sections():
        sub = _SUBOBJECT.fullmatch(name)
        title = f'{sub[1]}sub{sub[2]}' if sub else _TITLES.get(name.lower(), name)
        if title in ('Comments', 'DummyUsage', 'DeviceComissioning'):  # sections that do not concern taxels
            continue
        if tidied.has_section(title):
            _refuse(path, 'every section once', f'section [{title}] again as [{name}]')
        tidied[title] = {key: value for key, value in parser.items(name) if value}
        _tidy_numbers(tidied[title])
    return tidied


def _tidy_numbers(section: SectionProxy) -> None:
    """Rewrite octal numbers in a form that canopen can read."""
    section.update({key: read_octal(section[key]) for key in _NUMBERS if key in section})
    with suppress(ValueError):  # a DataType that is not a number is rejected later
        if int(section.get('DataType', '0'), 0) in (BOOLEAN, *INTEGER_TYPES):
            section.update({key: read_octal(section[key]) for key in _VALUES if key in section})


def _check_object(path: Path, parser: RawConfigParser, name: str) -> None:
    sub = _SUBOBJECT.fullmatch(name)
    if sub and not any(parser.has_section(f(sub[1])) for f in (str.upper, str.lower, str)):
        _refuse(path, f'a section [{sub[1]}] before [{name}]', 'no such section')
    carries_value = sub or parser.get(name, 'ObjectType', fallback='0x7').strip() in _PLAIN_TYPES
    for key in ('ParameterName', 'DataType', 'AccessType') if carries_value else ('ParameterName',):
        if not parser.has_option(name, key):
            _refuse(path, f'key "{key}" in section [{name}]', 'no such key')
    for key in ('ObjectType', 'DataType', 'PDOMapping', 'CompactSubObj'):
        _check_number(path, name, key, parser.get(name, key, fallback='0').strip())
    if parser.has_option(name, 'CompactSubObj') and not parser.has_option(name, 'DataType'):
        _refuse(path, f'key "DataType" in section [{name}], which has "CompactSubObj"', 'no such key')


def _check_identity(path: Path, parser: RawConfigParser) -> None:
    """Reject an identity that canopen would skip, because no device could be compared with it."""
    title = f'{IDENTITY:04X}'
    if not parser.has_section(title):
        return
    if int(parser.get(title, 'ObjectType', fallback='0x7'), 0) not in (0x8, 0x9):  # ARRAY, RECORD
        _refuse(path, f'a RECORD (ObjectType=0x9) in section [{title}]', 'an object without sub-indices')
    for name in parser.sections():
        sub = _SUBOBJECT.fullmatch(name)
        if sub and sub[1] == title and int(sub[2], 16) in (1, 2, 3):
            _check_number(path, name, 'DefaultValue', parser.get(name, 'DefaultValue', fallback='0'))


def _check_number(path: Path, section: str, key: str, value: str) -> None:
    try:
        int(value, 0)
    except ValueError:
        _refuse(path, f'a number in section [{section}], key "{key}"', repr(value))


def refuse_eds(eds: str, section: str, *, expected: str, got: str) -> NoReturn:
    """Raise ConfigurationError about a section of an EDS."""
    raise ConfigurationError(f'{eds}, {section}', expected=expected, got=got, remedy=_REMEDY)


def _refuse(path: Path, expected: str, got: str) -> NoReturn:
    raise ConfigurationError(str(path), expected=expected, got=got, remedy=_REMEDY)


class Entry(NamedTuple):
    """A key of a section, with its value, or a section title, with the value ''."""

    line: int
    value: str


class EdsText:
    """Sections and keys of an EDS with their line numbers. Section and key names are not case-sensitive."""

    def __init__(self, eds: str):
        self.eds = eds
        self._entries: dict[tuple[str, str], Entry] = {}
        section = ''
        for number, line in enumerate(read_eds(config_path(eds)).splitlines(), 1):
            stripped = line.split(';', 1)[0].strip()
            if stripped.startswith('[') and stripped.endswith(']'):
                section = stripped[1:-1].lower()
                self._entries[section, ''] = Entry(number, '')
            elif '=' in stripped:
                key, value = stripped.split('=', 1)
                self._entries[section, key.strip().lower()] = Entry(number, value.strip())

    def entry(self, section: str, key: str = '') -> Entry | None:
        """Return the entry of a key, or of the section title if no key is given, or None if the entry is missing."""
        return self._entries.get((section.lower(), key.lower()))

    def number(self, section: str, key: str) -> int | None:
        """Return the value of ``key`` as a number, or None if the value is missing or empty."""
        entry = self.entry(section, key)
        return int(read_octal(entry.value), 0) if entry is not None and entry.value else None

    def place(self, section: str, key: str = '') -> str:
        """Describe a key with its line number for messages, or only the section if the key is missing or not given."""
        entry = self.entry(section, key) or self.entry(section)
        return (f'section [{section}]' + (f', key "{key}"' if key and self.entry(section, key) else '')
                + (f', line {entry.line}' if entry else ''))
