"""The MoveIt example: the held object is attached and detached, and its files agree with each other."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from test_collision_object import shape

from tactile_node.grasp.gripper import Gripper, PadPose
from tactile_skin.msg import Grasp, GraspSides

pytestmark = pytest.mark.ros

FOLDER = Path(__file__).resolve().parents[1] / 'examples/moveit'


def parameters(node):
    return yaml.safe_load((FOLDER / 'panda.yaml').read_text(encoding='utf-8'))[f'/**/{node}']['ros__parameters']


@pytest.fixture
def held(collision_object_message, monkeypatch):
    """The example's decisions about messages that have passed their checks."""
    import attached_object
    monkeypatch.setattr(attached_object, 'check_grasp', lambda message: None)
    monkeypatch.setattr(attached_object, 'check_grasp_sides', lambda message: None)
    return attached_object.AttachedObject('panda_hand', ['panda_leftfinger'])


def grasp(contact=Grasp.TWO_SIDED, **fields):
    return Grasp(**{'contact': contact, 'fresh': True, 'stable': True, 'same_shape': True, 'width': 0.04,
                 'centre': [0.01, 0.01], 'offset': 0.0, **fields})


def sides():
    return GraspSides(sides=[shape(), shape()])


def test_a_grasp_that_is_held_is_attached_once(held):
    change = held.changed_by(grasp(), sides(), 0.0)
    assert (change.link_name, list(change.touch_links)) == ('panda_hand', ['panda_leftfinger'])
    assert (change.object.operation, change.object.header.frame_id) == (change.object.ADD, 'left_pad')
    assert list(change.object.primitives[0].dimensions) == [0.012, 0.006, 0.04]
    assert held.changed_by(grasp(), sides(), 0.0) is None


def test_a_doubtful_grasp_is_not_attached(held):
    """test_collision_object.py tests which grasps are doubtful."""
    assert held.changed_by(grasp(stable=False), sides(), 0.0) is None and not held.is_attached


@pytest.mark.parametrize('fields', [{'contact': Grasp.UNSEEN}, {'contact': Grasp.ONE_SIDED}, {'stable': False},
                                    {'contact': Grasp.NO_CONTACT, 'fresh': False}])
def test_a_doubtful_grasp_does_not_detach(held, fields):
    held.changed_by(grasp(), sides(), 0.0)
    assert held.changed_by(grasp(**fields), sides(), 0.0) is None and held.is_attached


def test_an_empty_gripper_detaches_once_and_can_attach_again(held):
    held.changed_by(grasp(), sides(), 0.0)
    change = held.changed_by(grasp(Grasp.NO_CONTACT), sides(), 0.0)
    assert (change.link_name, change.object.id, change.object.operation) == ('panda_hand', 'held', change.object.REMOVE)
    assert held.changed_by(grasp(Grasp.NO_CONTACT), sides(), 0.0) is None
    assert held.changed_by(grasp(), sides(), 0.0).object.id == 'held'


def test_an_old_grasp_neither_attaches_nor_detaches(held):
    assert held.changed_by(grasp(), sides(), 0.2) is None
    held.changed_by(grasp(), sides(), 0.0)
    assert held.changed_by(grasp(Grasp.NO_CONTACT), sides(), 0.2) is None and held.is_attached


def test_after_a_restart_an_object_of_the_earlier_run_is_detached(held):
    change = held.changed_by(grasp(Grasp.NO_CONTACT), sides(), 0.0)
    assert (change.object.id, change.object.operation) == ('held', change.object.REMOVE)


def test_the_object_is_attached_again_after_moveit_was_gone(held):
    held.changed_by(grasp(), sides(), 0.0)
    held.forget()
    change = held.changed_by(grasp(), sides(), 0.0)
    assert change.object.operation == change.object.ADD


def test_an_invalid_message_changes_nothing(collision_object_message):
    import attached_object
    assert attached_object.AttachedObject('panda_hand', []).changed_by(Grasp(), GraspSides(), 0.0) is None


def test_the_pads_of_the_panda_face_each_other_where_its_fingers_are():
    given = parameters('grasp')
    left, right = (PadPose(tuple(given[f'{side}_xyz']), tuple(given[f'{side}_rpy'])) for side in ('left', 'right'))
    Gripper(left, right)
    middle = 0.015, 0.015  # middle of a pad with 16 taxels at 2 mm
    for pad, way in ((left, 1), (right, -1)):
        assert pad.place(middle, 0.04) == pytest.approx([0.0, way * 0.02, 0.103], abs=1e-6)
        assert pad.rotation @ np.array((0, 0, 1)) == pytest.approx([0, -way, 0], abs=1e-6)


def test_the_controller_of_moveit_is_touch_gripper():
    """MoveIt sends goals to <controller>/<action_ns>, which is the default name of our action."""
    found = yaml.safe_load((FOLDER / 'controllers.yaml').read_text(encoding='utf-8'))
    controllers = found['moveit_simple_controller_manager']
    gripper, = (each for each in controllers['controller_names'] if controllers[each]['type'] == 'GripperCommand')
    assert f'{gripper}/{controllers[gripper]["action_ns"]}' == 'touch_gripper/gripper_cmd'
    assert parameters('touch_gripper')['action_type'] == controllers[gripper]['type']
    assert controllers[gripper]['joints'] == parameters('grasp')['gap_joints']
    # With allow_failure, MoveIt reports a goal that pressed only one pad as a success.
    assert not controllers[gripper].get('allow_failure', False)


def test_the_named_state_open_of_the_panda_opens_the_gripper_at_once():
    """In panda.srdf, the state `open` moves each finger by 0.035 m. MoveIt plans to within 0.1 mm of a named state."""
    given = parameters('touch_gripper')
    assert given['gap_scale'] * (0.035 - 1e-4) >= given['widest']
