"""YAML files that cannot be used end in an error that names the file."""

import pytest

from tactile_node.errors import ConfigurationError
from tactile_node.yaml_section import load_mapping


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
