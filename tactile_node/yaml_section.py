"""Reads typed keys of a YAML mapping; whatever is wrong becomes a ConfigurationError naming file and key."""

from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

import yaml

from tactile_node.errors import ConfigurationError

_NO_DEFAULT = object()


class _Loader(yaml.SafeLoader):
    """Refuses a key that is given twice, of which PyYAML takes the last."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
        seen = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode) and key.tag != 'tag:yaml.org,2002:merge':
                if key.value in seen:
                    raise yaml.constructor.ConstructorError(None, None, f'the key {key.value!r} is given twice',
                                                            key.start_mark)
                seen.add(key.value)
        return super().construct_mapping(node, deep)


def load_mapping(path: Path, about: str) -> 'Section':
    """Return the mapping at the top of the YAML file ``path``; ``about`` says what the file should be."""
    try:
        text = Path(path).read_text(encoding='utf-8')
        content = yaml.load(text, _Loader)
    except OSError as error:
        raise ConfigurationError(str(path), expected=f'{about} (YAML)', got=error.strerror or str(error),
                                 remedy='Check the path and its permissions.') from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(str(path), expected=f'{about} (YAML text in UTF-8)',
                                 got='bytes that are no text',
                                 remedy='Give the YAML file, not a binary one.') from error
    except yaml.YAMLError as error:
        raise ConfigurationError(str(path), expected=f'{about} (YAML)', got=_one_line(error),
                                 remedy='Correct the YAML at that line.') from error
    except (ValueError, KeyError, IndexError, AttributeError, RecursionError) as error:  # PyYAML over odd scalars
        raise ConfigurationError(str(path), expected=f'{about} (YAML)', got=f'{type(error).__name__}: {error}'[:200],
                                 remedy='Correct the YAML.') from error
    if not isinstance(content, dict):
        raise ConfigurationError(str(path), expected=f'{about}: a YAML mapping of keys to values',
                                 got=_kind(content), remedy='Start from a file in config/.')
    return Section(content, str(path))


def _one_line(error: yaml.YAMLError) -> str:
    mark = getattr(error, 'problem_mark', None)
    where = f' in line {mark.line + 1}' if mark else ''
    return f'{getattr(error, "problem", None) or "no YAML"}{where}'


def _kind(value: Any) -> str:
    return 'nothing' if value is None else f'{type(value).__name__} {value!r}'[:80]


class Section:
    """A mapping whose keys are taken one by one; ``done()`` rejects the keys that nobody took."""

    def __init__(self, mapping: dict, where: str, path: str = ''):
        self._mapping, self._where, self._path, self._asked = mapping, where, path, []

    @property
    def path(self) -> str:
        """Its key in the file, '' at the top."""
        return self._path

    def refuse(self, key: str, *, expected: str, got: str, remedy: str) -> NoReturn:
        """Raise the ConfigurationError of ``key``."""
        raise ConfigurationError(f'{self._where}, key "{self._name(key)}"', expected=expected, got=got,
                                 remedy=remedy)

    def take(self, key: str, default: Any = _NO_DEFAULT) -> Any:
        self._asked.append(key)
        if key in self._mapping:
            return self._mapping[key]
        if default is _NO_DEFAULT:
            self.refuse(key, expected='a value', got='no such key', remedy=f'Add "{key}:".{self._hint(key)}')
        return default

    def integer(self, key: str, low: int, high: int, default: Any = _NO_DEFAULT) -> int:
        return self.checked_integer(key, self.take(key, default), low, high)

    def checked_integer(self, key: str, value: Any, low: int, high: int) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            self.refuse(key, expected=f'a whole number {low}..{high}', got=_kind(value),
                        remedy='Correct the number.')
        return value

    def number(self, key: str, default: Any = _NO_DEFAULT, *, positive: bool = False) -> float:
        value = self.take(key, default)
        good = isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < float('inf')
        if not good or (positive and value <= 0):
            self.refuse(key, expected=f'a{" positive" if positive else ""} number', got=_kind(value),
                        remedy='Write it in SI units, 2 mm as 0.002.')
        return float(value)

    def choice(self, key: str, options: tuple, default: Any = _NO_DEFAULT) -> Any:
        value = self.take(key, default)
        if value not in options or isinstance(value, bool) != isinstance(options[0], bool):
            self.refuse(key, expected=f'one of {", ".join(map(repr, options))}', got=_kind(value),
                        remedy='Choose one of these.')
        return value

    def sequence(self, key: str, default: Any = _NO_DEFAULT) -> list:
        value = self.take(key, default)
        if not isinstance(value, (list, tuple)):
            self.refuse(key, expected='a list', got=_kind(value),
                        remedy='Write it as [a, b] or as lines with "-".')
        return list(value)

    def integers(self, key: str, count: int, low: int, high: int) -> tuple[int, ...]:
        return self.checked_integers(key, self.take(key), count, low, high)

    def checked_integers(self, key: str, value: Any, count: int, low: int, high: int) -> tuple[int, ...]:
        if not isinstance(value, (list, tuple)) or len(value) != count:
            self.refuse(key, expected=f'a list of {count} whole numbers', got=_kind(value),
                        remedy='Correct the list.')
        return tuple(self.checked_integer(key, item, low, high) for item in value)

    def section(self, key: str, default: Any = _NO_DEFAULT) -> 'Section':
        return self.subsection(key, self.take(key, default))

    def subsection(self, key: str, value: Any) -> 'Section':
        if not isinstance(value, dict):
            self.refuse(key, expected='a mapping of keys to values', got=_kind(value),
                        remedy='Write it as {key: value, ...} or as indented lines.')
        return Section(value, self._where, self._name(key))

    def done(self) -> None:
        for key in self._mapping:
            if key not in self._asked:
                self.refuse(str(key), expected=f'one of the keys {", ".join(self._asked)}',
                            got='an unknown key',
                            remedy=f'Remove it.{self._hint(str(key), self._asked)}')

    def _name(self, key: str) -> str:
        return f'{self._path}.{key}' if self._path else key

    def _hint(self, key: str, among: list | None = None) -> str:
        names = [str(k) for k in (self._mapping if among is None else among)]
        close = get_close_matches(key, names, n=1)
        return f' Did you mean "{close[0]}"?' if close and close[0] != key else ''
