"""Describe the keys of a YAML file once, for its reader and for its JSON schema.

Each mapping in the file is a frozen dataclass. Each key of the mapping is a field, made by the function `key` from the
kind of the value, the meaning and the default. `read_keys` reads a mapping, and `schema_of` returns its JSON schema.
"""

from dataclasses import MISSING, Field, field, fields
from typing import Any, NamedTuple, TypeVar

from tactile_node.yaml_section import LARGEST_NUMBER, REQUIRED, Section, ValueKind, shown_with_type

Keys = TypeVar('Keys')


def key(kind: ValueKind, about: str, default: Any = REQUIRED) -> Any:
    """Return a dataclass field that defines a key.

    Parameters
    ----------
    kind
        Kind of the value.
    about
        Meaning of the key, for editors and the documentation.
    default
        Value if the key is missing.
    """
    metadata = {'kind': kind, 'about': about}
    return field(metadata=metadata) if default is REQUIRED else field(default=default, metadata=metadata)


def read_keys(keys: type[Keys], section: Section) -> Keys:
    """Return a mapping of the file as the dataclass ``keys``.

    Parameters
    ----------
    keys
        Dataclass whose fields are made by `key`. Its parameters must be keyword-only.
    section
        The mapping.

    Raises
    ------
    ConfigurationError
        Raised if a key is missing, unknown or has a wrong value.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True, kw_only=True)
    ... class GridKeys:
    ...     rows: int = key(Whole(1, 1024), 'Number of rows.')
    ...     unit: str = key(OneOf(('Pa', 'N')), 'Unit of the taxels.', 'Pa')
    >>> read_keys(GridKeys, Section({'rows': 16}, 'skin.yaml')).unit
    'Pa'
    >>> schema_of(GridKeys)['required']
    ['rows']
    """
    values = {each.name: section.read(each.name, each.metadata['kind'], _default(each))
              for each in fields(keys)}  # type: ignore[arg-type]  # Python has no type for "class of a dataclass"
    section.done()
    return keys(**values)


def schema_of(keys: type) -> dict[str, Any]:
    """Return the JSON schema of a mapping whose keys are the fields of the dataclass ``keys``."""
    return {'type': 'object', 'properties': {each.name: _schema_of_key(each) for each in fields(keys)},
            'required': [each.name for each in fields(keys) if _default(each) is REQUIRED],
            'additionalProperties': False}


def _default(each: 'Field[Any]') -> Any:
    return REQUIRED if each.default is MISSING else each.default


def _schema_of_key(each: 'Field[Any]') -> dict[str, Any]:
    default = {} if _default(each) in (REQUIRED, None) else {'default': each.default}
    return {'description': each.metadata['about'], **each.metadata['kind'].schema(), **default}


class Whole(NamedTuple):
    """A whole number from ``low`` to ``high``, inclusive."""

    low: int
    high: int

    def read(self, section: Section, key: str, value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not self.low <= value <= self.high:
            section.refuse(key, expected=f'a whole number {self.low}..{self.high}', got=shown_with_type(value),
                           remedy='Correct the number.')
        return value

    def schema(self) -> dict[str, Any]:
        return {'type': 'integer', 'minimum': self.low, 'maximum': self.high}


class Wholes(NamedTuple):
    """A list of ``length`` whole numbers from ``low`` to ``high``, inclusive."""

    length: int
    low: int
    high: int

    def read(self, section: Section, key: str, value: Any) -> tuple[int, ...]:
        if not isinstance(value, list) or len(value) != self.length:
            section.refuse(key, expected=f'a list of {self.length} whole numbers', got=shown_with_type(value),
                           remedy='Correct the list.')
        return ListOf(Whole(self.low, self.high)).read(section, key, value)

    def schema(self) -> dict[str, Any]:
        return {**ListOf(Whole(self.low, self.high)).schema(), 'minItems': self.length, 'maxItems': self.length}


class Number(NamedTuple):
    """A finite number in SI units, above 0 if it is ``positive``."""

    positive: bool = False
    remedy: str = 'Write it in SI units, 2 mm as 0.002.'

    def read(self, section: Section, key: str, value: Any) -> float:
        good = isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < LARGEST_NUMBER
        if not good or (self.positive and value <= 0):
            section.refuse(key, expected=f'a{" positive" if self.positive else ""} number',
                           got=shown_with_type(value), remedy=self.remedy)
        return float(value)

    def schema(self) -> dict[str, Any]:
        return {'type': 'number', 'exclusiveMinimum': 0 if self.positive else -LARGEST_NUMBER,
                'exclusiveMaximum': LARGEST_NUMBER}


class Switch(NamedTuple):
    """Either true or false."""

    def read(self, section: Section, key: str, value: Any) -> bool:
        if not isinstance(value, bool):
            section.refuse(key, expected='true or false', got=shown_with_type(value), remedy='Write true or false.')
        return value

    def schema(self) -> dict[str, Any]:
        return {'type': 'boolean'}


class OneOf(NamedTuple):
    """One of several texts."""

    options: tuple[str, ...]
    remedy: str = 'Choose one of these.'

    def read(self, section: Section, key: str, value: Any) -> str:
        if value not in self.options:
            section.refuse(key, expected=f'one of {", ".join(map(repr, self.options))}', got=shown_with_type(value),
                           remedy=self.remedy)
        return value

    def schema(self) -> dict[str, Any]:
        return {'enum': list(self.options)}


class ListOf(NamedTuple):
    """A list of values of one kind, of any length."""

    kind: ValueKind

    def read(self, section: Section, key: str, value: Any) -> tuple[Any, ...]:
        if not isinstance(value, list):
            section.refuse(key, expected='a list', got=shown_with_type(value),
                           remedy='Write it as [a, b] or as lines with "-".')
        return tuple(self.kind.read(section, f'{key}[{position}]', item) for position, item in enumerate(value))

    def schema(self) -> dict[str, Any]:
        return {'type': 'array', 'items': self.kind.schema()}


class MappingOf(NamedTuple):
    """A mapping whose keys are the fields of a dataclass, or a list of values of another kind, if there is one."""

    keys: type
    or_list_of: ValueKind | None = None

    def read(self, section: Section, key: str, value: Any) -> Any:
        if self.or_list_of is None or isinstance(value, dict):
            return read_keys(self.keys, section.subsection(key, value))
        if not isinstance(value, list):
            section.refuse(key, expected='a mapping of keys to values, or a list', got=shown_with_type(value),
                           remedy='Write it as {key: value, ...}, as [a, b], or as indented lines.')
        return ListOf(self.or_list_of).read(section, key, value)

    def schema(self) -> dict[str, Any]:
        mapping = schema_of(self.keys)
        return mapping if self.or_list_of is None else {'anyOf': [mapping, ListOf(self.or_list_of).schema()]}
