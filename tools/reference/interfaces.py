"""Generate the tables of all message, service and action fields from the files in msg/, srv/ and action/.

The module does not use rosidl_adapter, because rosidl_adapter assigns a comment above several fields to the first of
these fields, and separates constants from fields. This module keeps comments and constants in the order of the file.
"""

import re
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

from reference import markdown as md

ROOT = Path(__file__).resolve().parents[2]
#: Heading on the page, and names of the file sections, by folder. In the files, --- separates the sections.
KINDS = {'msg': ('Messages', ('',)), 'srv': ('Services', ('Request', 'Response')),
         'action': ('Actions', ('Goal', 'Result', 'Feedback'))}
UNIT = re.compile(r'\s*\[([^\]]*)\]')
DECLARED = re.compile(r'(?P<type>[\w/<=]+(?:\[[^\]]*\])?)\s+(?P<name>\w+)(?:\s*=\s*(?P<value>\S+)|\s+\S+)?$')


class InterfaceLine(NamedTuple):
    """A field or a constant of an interface, with its comment. Only a constant has a ``value``."""

    type: str
    name: str
    value: str | None
    comment: str


def markdown() -> str:
    parts = []
    for folder, (heading, _) in KINDS.items():
        if files := files_of(folder):
            parts += [f'## {heading}', *map(page_part, files)]
    return '\n\n'.join(parts)


def files_of(folder: str) -> list[Path]:
    return sorted((ROOT / folder).glob(f'*.{folder}'))


def first_sentence(path: Path) -> str:
    """Return the first sentence of the comment at the top of an interface file."""
    top = path.read_text(encoding='utf-8').split('\n---\n')[0]
    text = next((block for block in _blocks(top) if isinstance(block, str)), '')
    return re.split(r'(?<=[a-z)])[.:;](?: |$)', text)[0]


def page_part(path: Path) -> str:
    parts = [f'### {path.stem}']
    names = KINDS[path.suffix[1:]][1]
    for name, text in zip(names, re.split(r'(?m)^---$', path.read_text(encoding='utf-8')), strict=True):
        parts += [f'**{name}**'] if name else []
        blocks = _blocks(text)
        while blocks and isinstance(blocks[0], str):
            parts.append(md.paragraph(blocks.pop(0)))
        parts += [_table(blocks)] if blocks else []
    return '\n\n'.join(parts)


def _table(blocks: list[str | list[InterfaceLine]]) -> str:
    """Return the table of an interface. A comment paragraph between fields becomes a row without a name."""
    rows = []
    for block in blocks:
        rows += [('', '', '', f'*{md.prose(block)}*')] if isinstance(block, str) else map(_row, block)
    return md.table(('type', 'name', 'unit', 'meaning'), rows)


def _row(line: InterfaceLine) -> tuple[str, str, str, str]:
    name = line.name if line.value is None else f'{line.name} = {line.value}'
    return (_linked(line.type), md.code(name), ', '.join(UNIT.findall(line.comment)),
            md.prose(UNIT.sub('', line.comment).lstrip(' ,;:')))


def _linked(kind: str) -> str:
    """Return the name of a type as Markdown. For a message of this package, link to the table of its fields."""
    name = kind.split('[')[0]
    return f'[{md.code(kind)}](#{name.lower()})' if (ROOT / f'msg/{name}.msg').is_file() else md.code(kind)


def _blocks(text: str) -> list[str | list[InterfaceLine]]:
    """Return comment paragraphs (str) and groups of adjacent fields and constants (list), in the order of the file."""
    found: list[tuple[object, str | InterfaceLine]] = []
    paragraph, before = 0, ''
    for raw in text.splitlines():
        declared, _, comment = raw.partition('#')
        comment = comment.strip().removeprefix('---').strip()
        if declared.strip():
            match = DECLARED.match(declared.strip())
            if match is None:
                raise ValueError(f'{raw!r} is neither a field nor a constant')
            found.append((InterfaceLine, InterfaceLine(match['type'], match['name'], match['value'], comment)))
        elif declared and comment and found and isinstance(found[-1][1], InterfaceLine):
            # This line continues the comment.
            line = found[-1][1]
            found[-1] = (InterfaceLine, line._replace(comment=f'{line.comment} {comment}'))
        elif comment:
            paragraph += not before.startswith('#')
            found.append((paragraph, comment))
        else:
            paragraph += 1
        before = raw
    return [[line for _, line in group] if key is InterfaceLine else ' '.join(line for _, line in group)
            for key, group in groupby(found, key=lambda pair: pair[0])]
