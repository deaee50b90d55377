"""Tests that every constant of our interfaces names one code and that `name_of` returns the name of a code."""

from contextlib import suppress
from importlib import import_module
from pathlib import Path

import pytest

from tactile_node.code_names import name_of

ROOT = Path(__file__).resolve().parents[1]
INTERFACES = sorted(f'{file.parent.name}/{file.stem}' for kind in ('msg', 'srv', 'action')
                    for file in (ROOT / kind).iterdir())


@pytest.mark.parametrize(('interface', 'field', 'code', 'name'), [
    ('msg/Grasp', 'contact', 4, 'TWO_SIDED'), ('msg/Grasp', 'side_states', 0, 'SIDE_NOT_KNOWN'),
    ('msg/ContactShape', 'unknown_reason', 0, 'REASON_NOT_KNOWN'), ('msg/ContactShape', 'shape', 8, 'OTHER'),
    ('msg/NodeStatus', 'nmt_state', 127, 'NMT_PRE_OPERATIONAL'), ('msg/NodeStatus', 'nmt_state', 3, '3'),
    ('action/WaitForGrasp', 'outcome', 2, 'TIMED_OUT'), ('srv/CheckGrasp', 'outcome', 2, 'NOT_HELD'),
    ('msg/ContactEvent', 'kind', 3, 'SLIDING'), ('msg/ContactMotion', 'observable', 4, 'ROTATION'),
    ('srv/CheckGrasp', 'refusal', 2, 'NOT_A_LIMIT')])
def test_a_code_has_the_name_of_its_field(interface, field, code, name):
    assert name_of(interface, field, code) == name


def test_a_field_without_codes_is_an_error():
    with pytest.raises(KeyError):
        name_of('msg/Grasp', 'cotnact', 4)


@pytest.mark.ros
@pytest.mark.parametrize('interface', INTERFACES)
def test_each_constant_that_ros_generates_names_one_code(interface):
    pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')
    folder, name = interface.split('/')
    kind = getattr(import_module(f'tactile_skin.{folder}'), name)
    parts = [kind] if interface.startswith('msg/') else [getattr(kind, part) for part in (
        'Request', 'Response', 'Goal', 'Result', 'Feedback') if hasattr(kind, part)]
    constants = [(name, getattr(part, name)) for part in parts for name in dir(type(part)) if name.isupper()
                 and name[0] != '_']
    named = []
    for part in parts:
        for field, kind in part.get_fields_and_field_types().items():
            if 'uint8' in kind:
                with suppress(KeyError):
                    named += [(name_of(part, field, code), code) for code in range(256)
                              if name_of(part, field, code) != str(code)]
    assert sorted(named) == sorted(constants)
