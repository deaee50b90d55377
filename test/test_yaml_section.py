"""YAML files that cannot be used end in an error that names the file."""

import pytest

from tactile_node.errors import ConfigurationError
from tactile_node.yaml_section import MOST_BYTES, load_mapping


@pytest.mark.parametrize('text, got', [
    ('a: 2026-99-99', 'ValueError'), ('- a list', 'list'), ('a: 1\na: 2', 'twice'), ('a: [', 'line')])
def test_a_file_that_is_no_mapping_is_refused_by_name(text, got, tmp_path):
    path = tmp_path / 'skin.yaml'
    path.write_text(text, encoding='utf-8')
    with pytest.raises(ConfigurationError) as refused:
        load_mapping(path, 'a skin layout')
    assert refused.value.where == str(path) and got in refused.value.got


def test_a_missing_file_is_refused_by_name(tmp_path):
    with pytest.raises(ConfigurationError) as refused:
        load_mapping(tmp_path / 'missing.yaml', 'a skin layout')
    assert refused.value.where == str(tmp_path / 'missing.yaml')


def test_a_value_that_is_no_list_is_refused_by_key(tmp_path):
    path = tmp_path / 'skin.yaml'
    path.write_text('nodes: 3', encoding='utf-8')
    with pytest.raises(ConfigurationError) as refused:
        load_mapping(path, 'a skin layout').sequence('nodes')
    assert 'nodes' in refused.value.where and refused.value.expected == 'a list'


def nested(depth):
    """A few lines whose aliases stand for 9 ** depth values."""
    lines = ['a0: &a0 [x, x, x, x, x, x, x, x, x]']
    lines += [f'a{n}: &a{n} [{", ".join([f"*a{n - 1}"] * 9)}]' for n in range(1, depth)]
    return '\n'.join([*lines, f'rows: *a{depth - 1}'])


@pytest.mark.parametrize('value', ['0x' + 'F' * 20_000, ':'.join(['59'] * 4_000), '9' * 5_000],
                         ids=['hexadecimal', 'sexagesimal', 'decimal'])
def test_a_number_without_end_is_refused(value, tmp_path):
    """Its text in the error ended in a ValueError."""
    path = tmp_path / 'skin.yaml'
    path.write_text(f'rows: {value}', encoding='utf-8')
    with pytest.raises(ConfigurationError):
        load_mapping(path, 'a skin layout').integer('rows', 1, 1024)


def test_aliases_that_stand_for_more_than_fits_into_memory_are_refused_in_a_short_sentence(tmp_path):
    """9 ** 30 values were written into the error."""
    path = tmp_path / 'skin.yaml'
    path.write_text(nested(30), encoding='utf-8')
    with pytest.raises(ConfigurationError) as refused:
        load_mapping(path, 'a skin layout').integer('rows', 1, 1024)
    assert len(refused.value.got) < 100


def test_a_file_of_a_size_that_no_skin_needs_is_refused_unread(tmp_path):
    path = tmp_path / 'skin.yaml'
    path.write_text('rows: [' + '1, ' * MOST_BYTES + '1]', encoding='utf-8')
    with pytest.raises(ConfigurationError) as refused:
        load_mapping(path, 'a skin layout')
    assert refused.value.got == 'a larger file'
