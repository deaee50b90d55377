"""Generate the tables of layout keys from the keys in the code."""

import json
from collections.abc import Iterator
from typing import Any

from reference import markdown as md
from tactile_node.skin.layout_keys import layout_schema

Schema = dict[str, Any]


def markdown() -> str:
    return '\n\n'.join(_section(key, kind) for key, kind in sections('', layout_schema()))


def sections(key: str, kind: Schema) -> Iterator[tuple[str, Schema]]:
    """Yield the key and the schema of each mapping, outer mappings first. The outermost mapping has the key ''."""
    yield key, kind
    for name, inner in kind['properties'].items():
        mapping = _mapping(inner)
        if mapping is not None:
            is_list = inner.get('type') == 'array'
            yield from sections(f'{key}.{name}'.lstrip('.') + '[]' * is_list, {
                **mapping, 'description': inner.get('description', '')})


def _mapping(kind: Schema) -> Schema | None:
    """Return the schema of a mapping, or None if the value contains no mapping.

    The mapping is the value itself, one of its alternatives, or an entry of a list.
    """
    forms = [kind, kind.get('items', {}), *kind.get('anyOf', ())]
    return next((form for form in forms if 'properties' in form), None)


def _section(key: str, kind: Schema) -> str:
    rows = ((md.code(name), md.code(written(inner)), 'required' if name in kind['required'] else _default(inner),
             md.prose(inner.get('description', ''))) for name, inner in kind['properties'].items())
    heading = f'## {md.code(key)}' if key else '## At the top'
    return '\n\n'.join((heading, md.paragraph(kind.get('description', '')),
                        md.table(('key', 'value', 'default', 'meaning'), rows)))


def _default(kind: Schema) -> str:
    return md.code(json.dumps(kind['default'])) if 'default' in kind else ''


def written(kind: Schema) -> str:
    """Return a short description of the values that a schema allows."""
    if 'enum' in kind:
        return ', '.join(map(str, kind['enum']))
    if 'anyOf' in kind:
        return ' or '.join(map(written, kind['anyOf']))
    name = kind['type']
    if name == 'array':
        inner = written(kind['items'])
        return f'[{", ".join([inner] * kind["minItems"])}]' if 'minItems' in kind else f'list of {inner}'
    if name in ('integer', 'number') and 'minimum' in kind:
        return f'{kind["minimum"]:.10g}..{kind["maximum"]:.10g}'
    return {'object': '{...}', 'number': '> 0', 'integer': 'integer', 'string': "'$NODEID+0x180'",
            'boolean': 'true, false'}[name]
