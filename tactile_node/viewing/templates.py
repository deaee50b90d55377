"""Jinja2 templates for the HTML pages, with all text escaped."""

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment


ABSENT_TEXT = 'not in this recording'


@cache
def environment() -> 'Environment':
    """Return the Jinja2 environment, which loads the templates from this folder."""
    # Jinja2 is imported here because the import is slow and not every command needs it.
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    found = Environment(loader=FileSystemLoader(Path(__file__).parent), autoescape=True, finalize=printable,
                        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    found.globals['absent_text'] = ABSENT_TEXT
    return found


@cache
def shared() -> Any:
    """Return the macros of shared.html, which the pages of the view and the report share."""
    return environment().get_template('shared.html').module


def printable(value: object) -> object:
    """Replace each unprintable character in ``value`` with U+FFFD, unless ``value`` is already HTML.

    >>> printable('<b>' + chr(7)) == '<b>' + chr(0xFFFD)
    True
    """
    if not isinstance(value, str) or hasattr(value, '__html__'):
        return value
    return printable_text(value, keep='\n')


def printable_text(text: str, keep: str = '') -> str:
    """Replace each unprintable character in ``text`` with U+FFFD, because a terminal would execute escape sequences."""
    return ''.join(each if each.isprintable() or each in keep else '\N{REPLACEMENT CHARACTER}' for each in text)
