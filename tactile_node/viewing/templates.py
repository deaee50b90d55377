"""Templates of the pages: HTML by Jinja2, with every text escaped."""

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment


@cache
def environment() -> 'Environment':
    """Return the Jinja2 environment, which finds the templates in this folder."""
    # imported here because it is slow to import and not every command needs it
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(loader=FileSystemLoader(Path(__file__).parent), autoescape=True, finalize=printable,
                       undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)


def printable(value: object) -> object:
    """Return ``value`` with U+FFFD for each unprintable character; a value that is already HTML is not changed.

    >>> printable('<b>' + chr(7)) == '<b>' + chr(0xFFFD)
    True
    """
    if not isinstance(value, str) or hasattr(value, '__html__'):
        return value
    return printable_text(value, keep='\n')


def printable_text(text: str, keep: str = '') -> str:
    """Return ``text`` with U+FFFD for each unprintable character, because a terminal would execute escape sequences."""
    return ''.join(each if each.isprintable() or each in keep else '\N{REPLACEMENT CHARACTER}' for each in text)
