"""The text of an EDS beside what canopen makes of it: what a section says, and in which line."""

from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple

from tactile_node.errors import ConfigurationError
from tactile_node.package_files import config_path
from tactile_node.skin.eds import read_eds


class Entry(NamedTuple):
    """A key of a section, or the section's title with the value ''."""

    line: int
    value: str


class EdsText:
    """The sections and keys of the EDS named ``eds``, in any case; without any where the file cannot be read."""

    def __init__(self, eds: str):
        self.eds = eds

    def entry(self, section: str, key: str = '') -> Entry | None:
        """Return the entry of ``key``, or of the section's title; None where there is none."""
        return self._entries.get((section.lower(), key.lower()))

    def number(self, section: str, key: str) -> int | None:
        """Return the value of ``key`` as a number; None where it is not given, or empty."""
        entry = self.entry(section, key)
        return int(entry.value, 0) if entry is not None and entry.value else None

    def place(self, section: str, key: str = '') -> str:
        """Name a section or key with its line, for messages; by the section alone where there is no such key."""
        entry = self.entry(section, key) or self.entry(section)
        return (f'section [{section}]' + (f', key "{key}"' if key and self.entry(section, key) else '')
                + (f', line {entry.line}' if entry else ''))

    @cached_property
    def _entries(self) -> Mapping[tuple[str, str], Entry]:
        found: dict[tuple[str, str], Entry] = {}
        try:
            lines = read_eds(config_path(self.eds)).splitlines()
        except (OSError, ConfigurationError):
            return found
        section = ''
        for number, line in enumerate(lines, 1):
            stripped = line.split(';', 1)[0].strip()
            if stripped.startswith('[') and stripped.endswith(']'):
                section = stripped[1:-1].lower()
                found[section, ''] = Entry(number, '')
            elif '=' in stripped:
                key, value = stripped.split('=', 1)
                found[section, key.strip().lower()] = Entry(number, value.strip())
        return found
