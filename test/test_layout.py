"""Skin layouts: decoding, error messages, and the schema for editors."""

import copy
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import write_reference
import yaml
from can_bench import TINY, tiny_layout

from tactile_node.errors import ConfigurationError
from tactile_node.skin.layout_file import load_layout
from tactile_node.skin.layout_keys import LayoutKeys, layout_schema
from tactile_node.skin.pads import PadSettings, check_pads
from tactile_node.skin.taxel_codec import TaxelCodec
from tactile_node.taxel_frame import NO_SIDE, SkinSide, TaxelStatus
from tactile_node.yaml_keys import read_keys
from tactile_node.yaml_section import load_mapping


def one_tpdo(value: str, taxels: str, rows: int = 1, cols: int = 1) -> str:
    return f'''
rows: {rows}
cols: {cols}
pitch: 0.001
value: {{{value}}}
tpdos:
- {{number: 1, cob_id: 0x181, map: [[0x2000, 1, 64]], taxels: {taxels}}}
'''


@pytest.mark.parametrize(('value', 'start_bit', 'payload', 'expected'), [
    ('unit: Pa, scale: 1.0, bits: 8', 8, '00 2A 00 00 00 00 00 00', 42),
    ('unit: Pa, scale: 0.5, bits: 12', 4, '5F 2A 00 00 00 00 00 00', 0x2A5 / 2),
    ('unit: Pa, scale: 1.0, bits: 12, byte_order: big', 4, '0F 2A 00 00 00 00 00 00', 0xF2A),
    ('unit: Pa, scale: 1.0, bits: 16, byte_order: big', 16, '00 00 12 34 00 00 00 00', 0x1234),
    ('unit: N, scale: 1.0, bits: 16, signed: true', 0, 'FE FF 00 00 00 00 00 00', -2),
    ('unit: N, scale: 2.0, bits: 16, signed: true, offset: 100, pressure: falling', 0,
     '5A 00 00 00 00 00 00 00', 20),
    # Without ``offset``, a falling value of 8 bits has the offset 255.
    ('unit: Pa, scale: 1.0, bits: 8, pressure: falling', 0, 'FA 00 00 00 00 00 00 00', 5),
    ('unit: Pa, scale: 1.0, bits: 32', 32, '00 00 00 00 00 00 00 80', 2.0 ** 31),
    ("unit: '1', scale: 1.0, bits: 1", 63, '00 00 00 00 00 00 00 80', 1)])
def test_decodes_and_encodes(tmp_path, value, start_bit, payload, expected):
    codec = TaxelCodec(tiny_layout(tmp_path, one_tpdo(value, f'[[0, 0, {start_bit}]]')))
    values, status = codec.decode(bytes.fromhex(payload), np.array([True]))
    assert values[0, 0] == expected and status[0, 0] == TaxelStatus.VALID
    sent = codec.encode(np.array([[float(expected)]]))
    np.testing.assert_array_equal(codec.decode(sent, np.array([True]))[0], values)


def test_unmapped_and_dead_taxels_are_nan(tmp_path):
    text = one_tpdo('unit: Pa, scale: 1.0, bits: 8', '{first: [0, 0], step: [0, 1], count: 3, bit_step: 8}',
                    cols=4)
    values, status = TaxelCodec(tiny_layout(tmp_path, text + 'dead_taxels: [[0, 1]]\n')).decode(
        bytes(range(8)), np.array([True]))
    np.testing.assert_array_equal(values, [[0, np.nan, 2, np.nan]])
    assert status.tolist() == [[TaxelStatus.VALID, TaxelStatus.DEAD, TaxelStatus.VALID, TaxelStatus.UNMAPPED]]


BAD = {
    'empty': ('', 'nothing'),
    'missing key': (TINY.replace('pitch: 0.003', ''), 'key "pitch"'),
    'misspelt key': (TINY.replace('pitch', 'pich'), 'or rename "pich" to it'),
    'unknown key': (TINY + 'colour: red\n', 'key "colour"'),
    'unknown inner key': (TINY.replace('bits: 8', 'bits: 8, scal: 3'), 'Rename it to "scale"'),
    'wrong type': (TINY.replace('rows: 3', 'rows: many'), 'key "rows"'),
    'true as number': (TINY.replace('rows: 3', 'rows: true'), 'key "rows"'),
    'pitch of 0': (TINY.replace('0.003', '0'), 'key "pitch"'),
    'pitch in millimetres': (TINY.replace('0.003', '3'), 'key "pitch": expected 0.0003 to 0.025 m, got 3 m'),
    'unit': (TINY.replace('unit: Pa', 'unit: psi'), 'key "value.unit"'),
    'bits': (TINY.replace('bits: 8', 'bits: 33'), 'key "value.bits"'),
    'no TPDO': (TINY.split('tpdos')[0] + 'tpdos: []\n', 'at least one TPDO'),
    'taxel twice': (TINY.replace('[2, 1, 8]', '[0, 0, 8]'), 'taxel (0, 0) also in tpdos[0]'),
    'taxel twice in one TPDO': (TINY.replace('[2, 1, 8]', '[2, 0, 8]'), 'taxel (2, 0)'),
    'taxel outside': (TINY.replace('[2, 1, 8]', '[3, 1, 8]'), 'taxel (3, 1)'),
    'dead taxel outside': (TINY + 'dead_taxels: [[0, 2]]\n', 'key "dead_taxels"'),
    'beyond the mapped bits': (TINY.replace('[2, 1, 8]', '[2, 1, 9]'), 'within the 16 mapped bits'),
    'beyond the frame': (TINY.replace('[2, 1, 8]', '[2, 1, 60]'), 'within the 16 mapped bits'),
    'overlap': (TINY.replace('[2, 1, 8]', '[2, 1, 7]'), 'do not overlap'),
    'too much mapped': (TINY.replace('[[0x2000, 3, 16]]', '[[0x2000, 3, 64], [0x2000, 4, 8]]'), '72 bits'),
    'nothing mapped': (TINY.replace('[[0x2000, 3, 16]]', '[]'), '0 bits'),
    'COB-ID twice': (TINY.replace('0x380', '0x180'), 'tpdos[2].cob_id'),
    'COB-ID kept by CiA 301': (TINY.replace('$NODEID+0x380', '0x601'), 'SDO requests'),
    'COB-ID no number': (TINY.replace('$NODEID+0x380', '$NODE+0x380'), 'key "tpdos[2].cob_id"'),
    'COB-ID too large': (TINY.replace('$NODEID+0x380', '0x800'), 'key "tpdos[2].cob_id"'),
    'TPDO number twice': (TINY.replace('number: 3', 'number: 2'), 'tpdos[2].number'),
    'side of a finger': (TINY + 'finger_ends: [last_col, top]\n',
                         'key "finger_ends[1]": expected one of \'first_row\', \'last_row\', \'first_col\', '
                         "'last_col', got str 'top'"),
    'sides that are no list': (TINY + 'finger_ends: first_row\n', 'key "finger_ends": expected a list'),
    'offset beyond the bits': (TINY.replace('offset: 10', 'offset: 256'),
                               'key "value.offset": expected a whole number 0..255'),
    'a wrong number in a list': (TINY.replace('[2, 1, 8]', '[2, x, 8]'), 'taxels[1][1]": expected a whole number'),
    'map that is no mapping': (TINY.replace('[[0x2000, 3, 16]]', '16'),
                               '.map": expected a mapping of keys to values, or a list'),
    'no map': (TINY.replace('map: [[0x2000, 3, 16]], ', ''), '.map": expected a value, got no such key'),
    'no way to carry the taxels': (TINY.split('tpdos')[0], 'at least one TPDO'),
    'a key without its value': (TINY.replace('offset: 10', 'offset: null'), 'key "value.offset"'),
    'a mapping without its keys': (TINY + 'event_driven:\n', 'key "event_driven": expected a mapping'),
    'SYNC on a kept COB-ID': (TINY + 'sync_cob_id: 0x701\n', 'key "sync_cob_id"')}


@pytest.mark.parametrize(('text', 'says'), BAD.values(), ids=BAD)
def test_bad_layout_is_refused_with_file_and_key(tmp_path, text, says):
    with pytest.raises(ConfigurationError, match=re.escape(says)) as refused:
        tiny_layout(tmp_path, text)
    assert 'layout.yaml' in str(refused.value) and refused.value.remedy


def test_an_unusual_pitch_can_be_meant(tmp_path):
    assert tiny_layout(tmp_path, TINY.replace('0.003', '0.04') + 'unusual_pitch: true\n').pitch == 0.04


def test_the_finger_ends_at_no_side_unless_the_layout_names_it(tmp_path):
    assert tiny_layout(tmp_path, TINY).finger_ends == NO_SIDE
    named = tiny_layout(tmp_path, TINY + 'finger_ends: [first_row, last_col]\n')
    assert named.finger_ends == SkinSide.FIRST_ROW | SkinSide.LAST_COL


@pytest.mark.parametrize('name', ['nowhere.yaml', 'binary.yaml'])
def test_a_file_that_is_not_text_is_refused_by_name(tmp_path, name):
    (tmp_path / 'binary.yaml').write_bytes(b'\x80\xff\x00\x01')
    with pytest.raises(ConfigurationError, match=name):
        load_layout(tmp_path / name if name == 'binary.yaml' else name)


@pytest.mark.parametrize(('pads', 'says'), [
    ([('a', 32), ('b', 34)], 'COB-ID that is used only once'), ([('a', 32), ('a', 64)], 'a different name'),
    ([('a', 32), ('b', 32)], 'a different node-ID'), ([('pad32', 32), ('pad32', 32)], 'a different node-ID'),
    ([], 'at least one')])
def test_pads_that_cannot_share_a_bus(pads, says):
    layout = load_layout('sim16x16.yaml')
    with pytest.raises(ConfigurationError, match=says):
        check_pads(tuple(PadSettings(name, (node,), layout) for name, node in pads))


def test_node_id_may_move_a_cob_id_to_a_kept_one(tmp_path):
    layout = tiny_layout(tmp_path, TINY.replace('0x380', '0x570'))
    check_pads((PadSettings('a', (0x0F,), layout),))  # 0x57F is the last COB-ID below the range of the SDO responses.
    with pytest.raises(ConfigurationError, match='0x590 .SDO answers'):
        check_pads((PadSettings('a', (0x20,), layout),))


def test_sync_must_be_no_tpdo(tmp_path):
    layout = tiny_layout(tmp_path, TINY + 'sync_cob_id: 0x185\n')
    with pytest.raises(ConfigurationError, match='as pad .*SYNC'):
        check_pads((PadSettings('a', (5,), layout),))


ROOT = Path(__file__).resolve().parents[1]
LAYOUTS = sorted(path for path in (ROOT / 'config').glob('*.yaml') if path.with_suffix('.eds').exists())
#: Together, the layouts in this list contain every key.
DIFFERENT = [path for path in LAYOUTS if path.stem.split('_')[0] in ('sim16x16', 'rows12x5', 'mpdo8x8', 'domain16x10',
                                                                    'event8x8')]
VALIDATOR = jsonschema.Draft202012Validator(layout_schema())
#: Wrong values that replace each value of a layout in turn. Few keys accept even one of these values.
WRONG = (None, 'many', True, -1, 1 << 40, [1], {})


@pytest.mark.parametrize('path', DIFFERENT, ids=lambda path: path.stem)
def test_a_mirrored_layout_reverses_the_columns_of_every_kind_of_skin(path):
    layout = replace(load_layout(path), dead=((0, 1),), finger_ends=SkinSide.FIRST_COL | SkinSide.FIRST_ROW)
    codec, mirrored = TaxelCodec(layout), TaxelCodec(layout.mirrored())
    payload = np.random.default_rng(4).integers(0, 256, codec.payload_bytes, np.uint8).tobytes()
    fresh = np.arange(len(layout.carriers)) % 3 > 0 if len(layout.carriers) > 1 else np.array([True])
    for ours, theirs in zip(mirrored.decode(payload, fresh), codec.decode(payload, fresh)):
        np.testing.assert_array_equal(ours, theirs[:, ::-1])
    assert layout.mirrored().finger_ends == SkinSide.LAST_COL | SkinSide.FIRST_ROW
    assert layout.mirrored().mirrored() == layout


def test_the_schema_file_is_current():
    """`make reference` writes the file from the keys in the code."""
    jsonschema.Draft202012Validator.check_schema(layout_schema())
    assert write_reference.SCHEMA.read_text(encoding='utf-8') == write_reference.schema_text()


@pytest.mark.parametrize('path', LAYOUTS, ids=lambda path: path.stem)
def test_every_shipped_layout_is_valid(path):
    assert not list(VALIDATOR.iter_errors(yaml.safe_load(path.read_text(encoding='utf-8'))))
    assert len(LAYOUTS) >= 9 and len(DIFFERENT) == 5


def places(value: object, at: tuple = ()) -> Iterator[tuple]:
    """Yield the path to every value below the top level, with only the first element of each list."""
    items = value.items() if isinstance(value, dict) else enumerate(value[:1]) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*at, key)
        yield from places(inner, (*at, key))


def broken(layout: dict) -> Iterator[tuple[str, dict]]:
    """Yield the layout with one key removed, one key added, or one value replaced."""
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


def is_read(path: Path, layout: dict) -> bool:
    path.write_text(json.dumps(layout), encoding='utf-8')  # JSON is a subset of YAML.
    try:
        read_keys(LayoutKeys, load_mapping(path, 'a skin layout'))
    except ConfigurationError:
        return False
    return True


@pytest.mark.slow
@pytest.mark.parametrize('path', DIFFERENT, ids=lambda path: path.stem)
def test_schema_and_reader_refuse_the_same(path, tmp_path):
    found = [(change, is_read(tmp_path / 'skin.yaml', layout), VALIDATOR.is_valid(layout))
             for change, layout in broken(yaml.safe_load(path.read_text(encoding='utf-8')))]
    assert not [change for change, by_reader, by_schema in found if by_reader != by_schema]
    assert sum(not by_reader for _, by_reader, _ in found) > 100
