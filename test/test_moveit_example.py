"""The MoveIt example: the held object is attached and detached, and its files agree with each other."""

from math import nan
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
    return attached_object.HeldObject('panda_hand', ['panda_leftfinger'])


def grasp(contact=Grasp.TWO_SIDED, **fields):
    return Grasp(**{'contact': contact, 'fresh': True, 'stable': True, 'same_shape': True, 'width': 0.04,
                 'centre': [0.01, 0.01], 'offset': 0.0, **fields})


def sides():
    return GraspSides(sides=[shape(), shape()])


def test_a_grasp_that_is_held_is_attached_once(held):
    change = held.changed_by(grasp(), sides())
    assert (change.link_name, list(change.touch_links)) == ('panda_hand', ['panda_leftfinger'])
    assert (change.object.operation, change.object.header.frame_id) == (change.object.ADD, 'left_pad')
    assert list(change.object.primitives[0].dimensions) == [0.012, 0.006, 0.04]
    assert held.changed_by(grasp(), sides()) is None


@pytest.mark.parametrize('fields', [{'stable': False}, {'fresh': False}, {'width': nan}, {'contact': Grasp.ONE_SIDED},
                                    {'contact': Grasp.UNSEEN}, {'same_shape': False}])
def test_a_doubtful_grasp_is_not_attached(held, fields):
    assert held.changed_by(grasp(**fields), sides()) is None


@pytest.mark.parametrize('fields', [{'contact': Grasp.UNSEEN}, {'contact': Grasp.ONE_SIDED}, {'stable': False},
                                    {'contact': Grasp.NO_CONTACT, 'fresh': False}])
def test_a_doubtful_grasp_does_not_detach(held, fields):
    held.changed_by(grasp(), sides())
    assert held.changed_by(grasp(**fields), sides()) is None and held.is_attached


def test_sides_of_another_grasp_do_not_attach(held):
    later = sides()
    later.header.stamp.sec = 1
    assert held.changed_by(grasp(), later) is None and not held.is_attached


def test_an_empty_gripper_detaches_once_and_can_attach_again(held):
    held.changed_by(grasp(), sides())
    change = held.changed_by(grasp(Grasp.NO_CONTACT), sides())
    assert (change.link_name, change.object.id, change.object.operation) == ('panda_hand', 'held', change.object.REMOVE)
    assert held.changed_by(grasp(Grasp.NO_CONTACT), sides()) is None
    assert held.changed_by(grasp(), sides()).object.id == 'held'


def test_an_invalid_message_changes_nothing(collision_object_message):
    import attached_object
    assert attached_object.HeldObject('panda_hand', []).changed_by(Grasp(), GraspSides()) is None


def test_the_pads_of_the_panda_face_each_other_where_its_fingers_are():
    given = parameters('grasp')
    left, right = (PadPose(tuple(given[f'{side}_xyz']), tuple(given[f'{side}_rpy'])) for side in ('left', 'right'))
    Gripper(left, right)
    middle = 0.015, 0.015  # of a pad with 16 taxels at 2 mm
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
