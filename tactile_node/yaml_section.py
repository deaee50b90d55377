"""Read the keys of a YAML mapping. Every error is a ConfigurationError that names the file and the key."""

import re
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from reprlib import Repr
from typing import Any, NoReturn, Protocol

import yaml

from tactile_node.errors import ConfigurationError

REQUIRED = object()  #: stands for the default of a key that must be given
LARGEST_NUMBER = 1e300  #: Largest number accepted. A whole number in YAML may be larger than any float.

#: Largest size of a file [bytes]. No pad on a CAN bus needs a larger file, and a larger file takes seconds to read.
MOST_BYTES = 1 << 19
SHOWN = 80           #: Number of characters after which an error message cuts off a value.
LONGEST_SHOWN = 128  #: Largest whole number that an error message shows in full [bits].


class _Loader(getattr(yaml, 'CSafeLoader', yaml.SafeLoader)):  # type: ignore[misc]  # libyaml: ten times faster
    """Loader that rejects duplicate keys, because PyYAML would silently use the last value."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode) and key.tag != 'tag:yaml.org,2002:merge':
                if key.value in seen:
                    raise yaml.constructor.ConstructorError(None, None, f'the key {key.value!r} is given twice',
                                                            key.start_mark)
                seen.add(key.value)
        return super().construct_mapping(node, deep)


def load_mapping(path: Path, about: str) -> 'Section':
    """Return the top-level mapping of a YAML file.

    Parameters
    ----------
    path : Path
        The file.
    about : str
        What the file should contain, for error messages, such as 'a skin layout'.

    Raises
    ------
    ConfigurationError
        Raised if the file cannot be read or is not a YAML mapping.
    """
    try:
        with Path(path).open('rb') as stream:
            written = stream.read(MOST_BYTES + 1)
        if len(written) > MOST_BYTES:
            raise ConfigurationError(str(path), expected=f'{about} (YAML) of at most {MOST_BYTES >> 10} KiB',
                                     got='a larger file', remedy='Check the path.')
        content = yaml.load(written.decode(), _Loader)
    except OSError as error:
        raise ConfigurationError(str(path), expected=f'{about} (YAML)', got=error.strerror or str(error),
                                 remedy='Check the path and its permissions.') from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(str(path), expected=f'{about} (YAML text in UTF-8)',
                                 got='bytes that are not text',
                                 remedy='Give a YAML file instead of a binary file.') from error
    except yaml.YAMLError as error:
        raise ConfigurationError(str(path), expected=f'{about} (YAML)', got=_one_line(error),
                                 remedy='Correct the YAML syntax in that line.') from error
    # PyYAML raises these errors for odd scalars
    except (ValueError, KeyError, IndexError, AttributeError, RecursionError) as error:
        raise ConfigurationError(str(path), expected=f'{about} (YAML)', got=f'{type(error).__name__}: {error}'[:200],
                                 remedy='Correct the YAML.') from error
    if not isinstance(content, dict):
        raise ConfigurationError(str(path), expected=f'{about}: a YAML mapping of keys to values',
                                 got=shown_with_type(content), remedy='Start from a file in config/.')
    return Section(content, str(path))


def line_of(path: Path, key: str) -> int | None:
    """Return the line of a key in a YAML file. If the key is missing, return the line of the deepest part that exists.

    Parameters
    ----------
    path : Path
        The file.
    key : str
        Key, written as in error messages, such as 'tpdos[3].taxels'. Remarks in brackets are ignored, as in 'tpdos[3]
        (TPDO 9).taxels'.

    Returns
    -------
    int or None
        Line number, or None if the file has no matching line.
    """
    try:
        node = yaml.compose(Path(path).read_text(encoding='utf-8'), yaml.SafeLoader)
    except (OSError, ValueError, yaml.YAMLError):
        return None
    line = None
    for part in re.findall(r'[^.\[\]]+', re.sub(r' \([^)]*\)', '', key)):
        if isinstance(node, yaml.SequenceNode) and part.isdecimal() and int(part) < len(node.value):
            node = node.value[int(part)]
            line = node.start_mark.line + 1
        elif isinstance(node, yaml.MappingNode):
            found = next(((name, value) for name, value in node.value if name.value == part), None)
            if found is None:
                break
            line, node = found[0].start_mark.line + 1, found[1]
        else:
            break
    return line


def _one_line(error: yaml.YAMLError) -> str:
    mark = getattr(error, 'problem_mark', None)
    where = f' in line {mark.line + 1}' if mark else ''
    return f'{getattr(error, "problem", None) or "no YAML"}{where}'


class _Short(Repr):
    """A ``Repr`` that writes only the beginning of a value.

    Aliases in a small file can describe a value that does not fit into memory.
    """

    def repr_int(self, x: int, level: int) -> str:
        return super().repr_int(x, level) if x.bit_length() <= LONGEST_SHOWN else f'of {x.bit_length()} bits'


def shown(value: Any) -> str:
    """Return a YAML value as error messages show it."""
    return _Short().repr(value)[:SHOWN]


def shown_with_type(value: Any) -> str:
    """Return the type and the beginning of a YAML value as error messages show them."""
    return 'nothing' if value is None else f'{type(value).__name__} {shown(value)}'[:SHOWN]


class ValueKind(Protocol):
    """Interface of a kind of value: ``yaml_keys`` has a class for each kind."""

    def read(self, section: 'Section', key: str, value: Any) -> Any:
        """Return ``value`` in an immutable form. Raise the ConfigurationError for ``key`` if the value is not valid."""

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of the valid values."""


class Section:
    """A mapping whose keys are read one by one.

    A key without a ``default`` is required. The method `done` rejects all keys that were not read. Every violation
    raises a ConfigurationError that names the file and the key. YAML values can have any type, hence ``Any``.

    >>> from tactile_node.yaml_keys import OneOf, Whole
    >>> section = Section({'rows': 16, 'unit': 'Pa'}, 'skin.yaml')
    >>> section.read('rows', Whole(1, 1024)), section.read('unit', OneOf(('Pa', 'N')))
    (16, 'Pa')
    >>> section.done()
    """

    def __init__(self, mapping: dict[Any, Any], where: str, path: str = ''):
        self._mapping = mapping
        self._where = where
        self._path = path
        self._taken: list[str] = []

    def refuse(self, key: str, *, expected: str, got: str, remedy: str) -> NoReturn:
        """Raise the ConfigurationError for ``key``."""
        raise ConfigurationError(f'{self._where}, key "{self._name(key)}"', expected=expected, got=got,
                                 remedy=remedy)

    def take(self, key: str, default: Any = REQUIRED) -> Any:
        """Return the value of ``key``, which may have any type."""
        self._taken.append(key)
        if key in self._mapping:
            return self._mapping[key]
        if default is REQUIRED:
            close = self._close(key, self._mapping)
            self.refuse(key, expected='a value', got='no such key',
                        remedy=f'Add "{key}:", or rename "{close}" to it.' if close else f'Add "{key}:".')
        return default

    def read(self, key: str, kind: ValueKind, default: Any = REQUIRED) -> Any:
        """Return the value of ``key``, checked by its kind, or ``default`` if the key is missing."""
        value = self.take(key, default)
        return kind.read(self, key, value) if key in self._mapping else value

    def section(self, key: str, default: Any = REQUIRED) -> 'Section':
        """Return a mapping as a separate section."""
        return self.subsection(key, self.take(key, default))

    def subsection(self, key: str, value: Any) -> 'Section':
        """Return ``value``, which belongs to ``key``, as a separate section."""
        if not isinstance(value, dict):
            self.refuse(key, expected='a mapping of keys to values', got=shown_with_type(value),
                        remedy='Write it as {key: value, ...} or as indented lines.')
        return Section(value, self._where, self._name(key))

    def done(self) -> None:
        """Raise an error for the first key that was not read."""
        for key in self._mapping:
            if key not in self._taken:
                close = self._close(str(key), self._taken)
                self.refuse(str(key), expected=f'one of the keys {", ".join(self._taken)}',
                            got='an unknown key',
                            remedy=f'Rename it to "{close}", or remove it.' if close else 'Remove it.')

    def _name(self, key: str) -> str:
        return f'{self._path}.{key}' if self._path else key

    @staticmethod
    def _close(key: str, among: Iterable[Any]) -> str:
        """Return the name in ``among`` whose spelling is closest to ``key``, or '' if no name is close."""
        close = get_close_matches(key, map(str, among), n=1)
        return close[0] if close and close[0] != key else ''
