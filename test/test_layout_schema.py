"""config/skin_layout.schema.json says what the reader says: an editor that goes by it does not mislead.

Every shipped layout is broken in one place after the other. The schema may refuse nothing that the reader accepts; what
the reader refuses by the keys alone, the schema refuses too.
"""

import copy
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import jsonschema
import pytest
import yaml

from tactile_node.errors import ConfigurationError
from tactile_node.skin.layout_file import load_layout, read_layout

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / 'tools'))
import make_schema  # noqa: E402

LAYOUTS = sorted(path for path in (ROOT / 'config').glob('*.yaml') if path.with_suffix('.eds').exists())
#: together they have every key
DIFFERENT = [path for path in LAYOUTS if path.stem.split('_')[0] in ('sim16x16', 'rows12x5', 'mpdo8x8', 'domain16x10',
                                                                    'event8x8')]
SCHEMA = json.loads((ROOT / 'config/skin_layout.schema.json').read_text(encoding='utf-8'))
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)
#: in place of any value; of those that few keys take
WRONG = (None, 'many', True, -1, 1 << 40, [1], {})


def test_the_file_is_what_the_tool_writes():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert make_schema.written() == make_schema.FILE.read_text(encoding='utf-8')


@pytest.mark.parametrize('path', LAYOUTS, ids=lambda path: path.stem)
def test_every_shipped_layout_is_valid(path):
    assert not list(VALIDATOR.iter_errors(yaml.safe_load(path.read_text(encoding='utf-8'))))
    assert len(LAYOUTS) >= 9 and len(DIFFERENT) == 5


def places(value: object, at: tuple = ()) -> Iterator[tuple]:
    """The way to every value below the top, of lists to the first."""
    items = value.items() if isinstance(value, dict) else enumerate(value[:1]) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*at, key)
        yield from places(inner, (*at, key))


def broken(layout: dict) -> Iterator[tuple[str, dict]]:
    """The layout with one key removed, one added, or one value replaced."""
    for place in [(), *places(layout)]:
        parent = layout
        for key in place[:-1]:
            parent = parent[key]
        if place:
            for wrong in WRONG:
                yield f'{place} = {wrong!r}', replaced(layout, place, wrong)
            if isinstance(parent, dict):
                yield f'{place} removed', replaced(layout, place)
        if isinstance(parent[place[-1]] if place else layout, dict):
            yield f'{place} + colour', replaced(layout, (*place, 'colour'), 'red')


def replaced(layout: dict, place: tuple, *value: object) -> dict:
    changed = copy.deepcopy(layout)
    parent = changed
    for key in place[:-1]:
        parent = parent[key]
    if value:
        parent[place[-1]] = value[0]
    else:
        del parent[place[-1]]
    return changed


def refusal(path: Path, layout: dict, read=load_layout) -> ConfigurationError | None:
    path.write_text(json.dumps(layout), encoding='utf-8')  # JSON is YAML
    try:
        read(path)
    except ConfigurationError as error:
        return error
    return None


def relates_keys(change: str) -> bool:
    """No schema can say it: these bounds are those of other keys."""
    return bool(re.search(r"'(offset|start_bit|bit_step|repeat)'|'domain', 'bytes'", change))


@pytest.mark.slow
@pytest.mark.parametrize('path', DIFFERENT, ids=lambda path: path.stem)
def test_schema_and_reader_refuse_the_same(path, tmp_path):
    accepted, missed, counts = [], [], [0, 0]
    for change, layout in broken(yaml.safe_load(path.read_text(encoding='utf-8'))):
        by_schema = not VALIDATOR.is_valid(layout)
        by_reader = refusal(tmp_path / 'skin.yaml', layout, read_layout) is not None
        if by_schema and not by_reader and refusal(tmp_path / 'skin.yaml', layout) is None:
            accepted.append(change)
        if by_reader and not by_schema and not relates_keys(change):
            missed.append(change)
        counts[by_schema] += 1
    assert not accepted and not missed and counts[True] > 100, (accepted, missed, counts)


KEYS = {
    (): 'sim16x16', ('value',): 'sim16x16', ('tpdos', 0): 'sim16x16', ('tpdos', 0, 'map'): 'sim16x16',
    ('tpdos', 0, 'taxels'): 'sim16x16', ('tpdos', 0, 'repeat', 0): 'sim16x16', ('tpdos', 0, 'rows'): 'rows12x5_10bit',
    ('tpdos', 0, 'mpdo'): 'mpdo8x8_16bit', ('domain',): 'domain16x10_16bit', ('event_driven',): 'event8x8_16bit'}


@pytest.mark.parametrize('place', KEYS, ids=str)
def test_the_keys_are_those_of_the_reader(place, tmp_path):
    layout = yaml.safe_load((ROOT / f'config/{KEYS[place]}.yaml').read_text(encoding='utf-8'))
    error = refusal(tmp_path / 'skin.yaml', replaced(layout, (*place, 'no such key'), 1))
    known = set(error.expected.removeprefix('one of the keys ').split(', '))
    kind = SCHEMA
    for key in place:
        kind = kind['properties'][key] if isinstance(key, str) else kind.get('items') or kind['anyOf'][1]['items']
        kind = kind['anyOf'][0] if 'anyOf' in kind and 'properties' in kind['anyOf'][0] and key != 'repeat' else kind
    left_out = {'mpdo': {'map', 'rows'}}  # the reader asks for these only without an mpdo
    assert known <= set(kind['properties'])
    assert set(kind['properties']) - known <= {'period', 'max_age'} | left_out.get(KEYS[place][:4], set())
