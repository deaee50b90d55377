"""HTML from text that is not trusted: a device's name comes from the bus, a file's name from anywhere."""

from collections.abc import Iterable, Sequence
from html import escape

ABSENT = 'not in this recording'


class Html(str):
    """HTML that was made here; every other text is escaped."""


def safe(value: object) -> Html:
    """Return ``value`` escaped, None as ABSENT, characters that do not print as U+FFFD.

    >>> safe('<script>' + chr(7)) == '&lt;script&gt;' + chr(0xFFFD)
    True
    """
    if isinstance(value, Html):
        return value
    if value is None:
        return Html(f'<span class="absent">{ABSENT}</span>')
    text = ''.join(each if each.isprintable() or each == '\n' else '\N{REPLACEMENT CHARACTER}' for each in str(value))
    return Html(escape(text))


def table(header: Sequence[object], rows: Iterable[Sequence[object]]) -> Html:
    body = ''.join(_row('td', row) for row in rows)
    return Html(f'<table><thead>{_row("th", header)}</thead><tbody>{body}</tbody></table>')


def facts(pairs: Iterable[tuple[str, object]]) -> Html:
    """A list of names and values."""
    rows = ''.join(f'<tr><th>{safe(name)}</th><td>{safe(value)}</td></tr>' for name, value in pairs)
    return Html(f'<table class="facts">{rows}</table>')


def folded(summary: str, content: Html, *, is_open: bool = False) -> Html:
    return Html(f'<details{" open" if is_open else ""}><summary>{safe(summary)}</summary>{content}</details>')


def joined(parts: Iterable[str]) -> Html:
    """Of Html and of nothing else."""
    return Html(''.join(safe(part) for part in parts))


def paragraph(text: object, style: str = '') -> Html:
    return Html(f'<p class="{style}">{safe(text)}</p>')


def legend_of(entries: Iterable[tuple[str, str]]) -> Html:
    """Colours and what they stand for."""
    spans = ''.join(f'<span><i style="background:{safe(colour)}"></i>{safe(text)}</span>' for colour, text in entries)
    return Html(f'<div class="legend">{spans}</div>')


def _row(kind: str, cells: Iterable[object]) -> str:
    return f'<tr>{"".join(f"<{kind}>{safe(cell)}</{kind}>" for cell in cells)}</tr>'
