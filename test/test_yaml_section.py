"""Layout files: sections that are read by key, and repeated TPDOs."""


import pytest

from tactile_node.errors import ConfigurationError
from tactile_node.skin.layout_file import load_layout, read_layout
from tactile_node.yaml_keys import Whole
from tactile_node.yaml_section import MOST_BYTES, line_of, load_mapping


def written(folder, text):
    path = folder / 'skin.yaml'
    path.write_text(text, encoding='utf-8')
    return path


@pytest.mark.parametrize('text, got', [
    ('a: 2026-99-99', 'ValueError'), ('- a list', 'list'), ('a: 1\na: 2', 'twice'), ('a: [', 'line'),
    # The reader refuses a file of this size, because no skin needs it.
    ('rows: [' + '1, ' * MOST_BYTES + '1]', 'a larger file')],
    ids=['no date', 'a list', 'a key twice', 'cut', 'too large'])
def test_a_file_that_is_not_a_mapping_is_refused_by_name(text, got, tmp_path):
    path = written(tmp_path, text)
    with pytest.raises(ConfigurationError) as refused:
        load_mapping(path, 'a skin layout')
    assert refused.value.where == str(path) and got in refused.value.got


def test_a_missing_file_is_refused_by_name(tmp_path):
    with pytest.raises(ConfigurationError) as refused:
        load_mapping(tmp_path / 'missing.yaml', 'a skin layout')
    assert refused.value.where == str(tmp_path / 'missing.yaml')


def nested(depth):
    """Return a few lines of YAML whose aliases expand to 9 ** depth values."""
    lines = ['a0: &a0 [x, x, x, x, x, x, x, x, x]']
    lines += [f'a{n}: &a{n} [{", ".join([f"*a{n - 1}"] * 9)}]' for n in range(1, depth)]
    return '\n'.join([*lines, f'rows: *a{depth - 1}'])


@pytest.mark.parametrize(('text', 'most'), [
    ('rows: 0x' + 'F' * 20_000, 100), ('rows: ' + ':'.join(['59'] * 4_000), 100), ('rows: ' + '9' * 5_000, 200),
    (nested(30), 100)], ids=['hexadecimal', 'sexagesimal', 'decimal', 'aliases'])
def test_an_endless_value_is_refused_in_a_short_sentence(text, most, tmp_path):
    """In an earlier version, reporting such a value either raised a ValueError or listed 9 ** 30 values."""
    with pytest.raises(ConfigurationError) as refused:
        load_mapping(written(tmp_path, text), 'a skin layout').read('rows', Whole(1, 1024))
    assert len(refused.value.got) < most


HEAD = 'rows: 4\ncols: 2\npitch: 0.003\nvalue: {unit: Pa, scale: 2.0, bits: 8}\ntpdos:\n'
ENTRY = '''- number: 3
  cob_id: $NODEID+0x180
  map: [[0x2000, 1, 8]]
  taxels: [[0, 0, 0]]
'''
LOOPS = '''  repeat:
  - {count: 4, number: 5, cob_id: 0x100, object: 1, step: [1, 0]}
  - {count: 2, number: 1, cob_id: 7, sub: 2, step: [0, 1]}
'''


def test_the_last_loop_runs_fastest(tmp_path):
    """The loops in the layout give the order in which the device sends its TPDOs.

    An assembler that expects another order would lose sweeps.
    """
    tpdos = load_layout(written(tmp_path, HEAD + ENTRY + LOOPS)).tpdos
    assert [(tpdo.number, tpdo.cob_id.base, tpdo.mapping[0].index, tpdo.mapping[0].subindex, *tpdo.taxels[0][:2])
            for tpdo in tpdos] == [(3, 0x180, 0x2000, 1, 0, 0), (4, 0x187, 0x2000, 3, 0, 1),
                                   (8, 0x280, 0x2001, 1, 1, 0), (9, 0x287, 0x2001, 3, 1, 1),
                                   (13, 0x380, 0x2002, 1, 2, 0), (14, 0x387, 0x2002, 3, 2, 1),
                                   (18, 0x480, 0x2003, 1, 3, 0), (19, 0x487, 0x2003, 3, 3, 1)]
    assert all(tpdo.cob_id.relative and tpdo.node == 0 for tpdo in tpdos)


def test_an_empty_list_of_loops_repeats_nothing(tmp_path):
    """In an earlier version, such a list raised a TypeError."""
    assert len(read_layout(written(tmp_path, HEAD + ENTRY + '  repeat: []\n')).tpdos) == 1


def test_one_loop_needs_no_list_and_may_run_backwards(tmp_path):
    text = HEAD + ENTRY.replace('[[0, 0, 0]]', '[[3, 1, 0]]') \
        + '  repeat: {count: 3, number: -1, cob_id: -0x10, sub: 1, step: [-1, 0]}\n'
    tpdos = load_layout(written(tmp_path, text.replace('0x180', '0x1A0'))).tpdos
    assert [(tpdo.number, tpdo.cob_id.base, tpdo.taxels[0].row) for tpdo in tpdos] == [(3, 0x1A0, 3), (2, 0x190, 2),
                                                                                      (1, 0x180, 1)]


@pytest.mark.parametrize(('loops', 'key'), [
    ('{count: 0}', 'tpdos[0].repeat.count'), ('{number: 1}', 'tpdos[0].repeat.count'), ('3', 'tpdos[0].repeat'),
    ('[3]', 'tpdos[0].repeat[0]'), ('[{count: 2, numbers: 1}]', 'tpdos[0].repeat[0].numbers'),
    ('{count: 2, step: [1]}', 'tpdos[0].repeat.step'), ('{count: 2, sub: 1.5}', 'tpdos[0].repeat.sub'),
    ('[{count: 500}, {count: 500}]', 'tpdos[0].repeat'),  # No node has this many TPDOs.
    ('{count: 512, number: 1}', 'tpdos[0].repeat'),  # The last TPDO would have the number 514.
    ('{count: 4, number: -1}', 'tpdos[0].repeat'), ('{count: 8, number: 1, cob_id: 0x100}', 'tpdos[0].repeat'),
    ('{count: 3, number: 1, object: 0x7FFF}', 'tpdos[0].repeat'),
    ('{count: 3, number: 1, sub: 127}', 'tpdos[0].repeat'), ('{count: 3, number: 1, sub: -1}', 'tpdos[0].repeat'),
    ('{count: 2, node: -1}', 'tpdos[0].repeat'),
    ('[{count: 1}, {count: 2, step: [0, down]}]', 'tpdos[0].repeat[1].step[1]')])
def test_a_wrong_repeat_is_refused_by_its_key_and_line(loops, key, tmp_path):
    path = written(tmp_path, HEAD + ENTRY + f'  repeat: {loops}\n')
    with pytest.raises(ConfigurationError) as caught:
        read_layout(path)
    assert caught.value.where == f'{path}, key "{key}"' and line_of(path, key) == 10


@pytest.mark.parametrize(('text', 'key', 'line'), [
    (LOOPS.replace('number: 5', 'number: 1'), 'tpdos[0] (TPDO 4).number', 6),
    (LOOPS.replace('cob_id: 7', 'cob_id: 0'), 'tpdos[0] (TPDO 4).cob_id', 7),
    (LOOPS.replace('count: 4', 'count: 5').replace('0x100', '8'), 'tpdos[0] (TPDO 23).taxels', 9),
    (LOOPS.replace('step: [0, 1]', 'step: [0, 0]'), 'tpdos[0] (TPDO 4).taxels', 9),
    (LOOPS.replace('cob_id: 7', 'cob_id: 7, node: 1'), 'tpdos[0] (node 1, TPDO 4).node', 6)])
def test_a_repetition_that_breaks_a_rule_is_named(text, key, line, tmp_path):
    """If the 23rd TPDO of a pad is wrong, the message names the 23rd TPDO."""
    path = written(tmp_path, HEAD + ENTRY + text)
    with pytest.raises(ConfigurationError) as caught:
        load_layout(path)
    assert caught.value.where == f'{path}, key "{key}"' and line_of(path, key) == line
