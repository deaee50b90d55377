"""Tests that every constant of our interfaces names one code, that the code is ours, and that `name_of` returns it."""

from contextlib import suppress
from importlib import import_module
from pathlib import Path

import pytest

from tactile_node.assembly.facts import LossReason
from tactile_node.assembly.health import BusFault, NodeFault, Overload, SyncFault
from tactile_node.code_names import name_of
from tactile_node.conditioning.tared_pad import ZeroState
from tactile_node.conditioning.taxel_faults import TaxelFault
from tactile_node.errors import RequirementRefusal, TareRefusal
from tactile_node.grasp.opening import GapSource
from tactile_node.grasp.requirement import Missing
from tactile_node.grasp.tracker import GraspContact, SideState
from tactile_node.gripper.rules.closing import Outcome
from tactile_node.gripper.rules.put_down import PutDownOutcome, Sign
from tactile_node.pose.events import EventKind, Moving, Observable, SeenBy
from tactile_node.shape.recognition import UnknownReason
from tactile_node.taxel_frame import SkinSide, TaxelStatus

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


#: Field of each interface with codes, the prefix of its constants, and our enumeration of the codes.
CODES = [
    ('msg/ContactEvent', 'kind', '', EventKind), ('msg/ContactEvent', 'seen_by', '', SeenBy),
    ('msg/ContactMotion', 'moving', '', Moving), ('msg/ContactMotion', 'observable', '', Observable),
    ('msg/ContactShape', 'unknown_reason', '', UnknownReason), ('msg/FaultyTaxel', 'code', '', TaxelFault),
    ('msg/Grasp', 'contact', '', GraspContact), ('msg/Grasp', 'gap_source', 'GAP_', GapSource),
    ('msg/Grasp', 'side_states', 'SIDE_', SideState), ('msg/GripperOutcome', 'outcome', '', Outcome),
    ('msg/NodeStatus', 'fault', 'FAULT_', NodeFault), ('msg/PadStatus', 'loss_codes', 'LOSS_', LossReason),
    ('msg/PadStatus', 'zero_state', 'ZERO_', ZeroState), ('msg/RequirementState', 'missing', '', Missing),
    ('msg/SkinStatus', 'fault', 'FAULT_', BusFault), ('msg/SkinStatus', 'overload', 'OVERLOAD_', Overload),
    ('msg/SkinStatus', 'sync_fault', 'SYNC_FAULT_', SyncFault), ('msg/TaxelArray', 'finger_ends', '', SkinSide),
    ('msg/TaxelArray', 'status', '', TaxelStatus), ('srv/CheckGrasp', 'refusal', '', RequirementRefusal),
    ('srv/Tare', 'refusal', 'REFUSAL_', TareRefusal), ('action/PutDown', 'outcome', '', PutDownOutcome),
    ('action/PutDown', 'signs', '', Sign)]
#: Names of the code 0 that differ from our enumeration, or that it lacks.
ZEROS = {SeenBy: 'SEEN_BY_NOT_KNOWN', Moving: 'NOT_KNOWN', Observable: 'NOTHING', UnknownReason: 'REASON_NOT_KNOWN',
         TaxelFault: 'NOT_KNOWN', RequirementRefusal: 'REFUSAL_NOT_KNOWN', Sign: 'NO_SIGN'}


@pytest.mark.parametrize(('interface', 'field', 'prefix', 'codes'), CODES)
def test_a_field_has_a_constant_of_each_of_our_codes_and_no_other(interface, field, prefix, codes):
    expected = {each.value: f'{prefix}{each.name}' for each in codes}
    if codes in ZEROS:
        expected[0] = ZEROS[codes]
    assert [name_of(interface, field, code) for code in range(256)] == [
        expected.get(code, str(code)) for code in range(256)]


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
