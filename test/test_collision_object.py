"""Tests for the MoveIt example, which turns a contact into a collision object.

The example refuses a contact whose size or grasp is unknown.
"""

from math import cos, nan, pi, sin

import numpy as np
import pytest
from geometry_msgs.msg import Point32, Polygon
from shape_msgs.msg import SolidPrimitive

from tactile_skin.msg import ContactShape, Grasp, GraspSides

pytestmark = pytest.mark.ros

ANGLE, X, Y = 0.3, 0.010, 0.012


@pytest.fixture(scope='module')
def example(collision_object_message):
    import collision_object
    return collision_object


def shape(kind=ContactShape.RECTANGLE, dimensions=(0.012, 0.006), corners=(), **fields):
    """Return a shape at (X, Y), rotated by ANGLE.

    ``corners`` are the corners of the outline in the frame of the shape [m].
    """
    found = ContactShape(shape=kind, fit_valid=True, dimensions=dimensions, **fields)
    found.header.frame_id = 'left_pad'
    found.pose.pose.position.x, found.pose.pose.position.y = X, Y
    found.pose.pose.orientation.z, found.pose.pose.orientation.w = sin(ANGLE / 2), cos(ANGLE / 2)
    cosine, sine = cos(ANGLE), sin(ANGLE)
    found.outline = Polygon(points=[Point32(x=X + cosine * x - sine * y, y=Y + sine * x + cosine * y)
                                    for x, y in corners])
    return found


def grasp(**fields):
    return Grasp(**{'contact': Grasp.TWO_SIDED, 'fresh': True, 'stable': True,
                    'same_shape': True, 'width': 0.04, **fields})


def sides():
    return GraspSides(sides=[shape(), shape()])


def test_a_rectangle_is_a_box_that_stands_on_the_pad(example, collision_object_message):
    found = example.collision_object(shape(), 'held', 0.04)
    box, = found.primitives
    place, = found.primitive_poses
    assert (found.id, found.header.frame_id, found.operation) == ('held', 'left_pad', collision_object_message.ADD)
    assert box.type == SolidPrimitive.BOX and list(box.dimensions) == [0.012, 0.006, 0.04]
    assert (found.pose.position.x, found.pose.position.y, found.pose.position.z) == (X, Y, 0)
    assert (place.position.x, place.position.y, place.position.z, place.orientation.w) == (0, 0, 0.02, 1)


def test_a_square_has_one_side_and_a_circle_is_a_cylinder(example):
    box, = example.collision_object(shape(ContactShape.SQUARE, (0.01,)), 'held', 0.04).primitives
    cylinder, = example.collision_object(shape(ContactShape.CIRCLE, (0.005,)), 'held', 0.04).primitives
    assert list(box.dimensions) == [0.01, 0.01, 0.04]
    assert cylinder.type == SolidPrimitive.CYLINDER and list(cylinder.dimensions) == [0.04, 0.005]  # Height and radius.


def test_a_triangle_is_a_closed_mesh_about_its_pose(example):
    corners = ((0.0, 0.0), (0.02, 0.0), (0.0, 0.01))
    found = example.collision_object(shape(ContactShape.RIGHT_TRIANGLE, (0.02, 0.01), corners), 'held', 0.03)
    mesh, = found.meshes
    points = np.array([(v.x, v.y, v.z) for v in mesh.vertices])
    assert points[:3, :2] == pytest.approx(np.array(corners), abs=1e-6) and set(points[:, 2]) == {0, 0.03}
    faces = points[[list(each.vertex_indices) for each in mesh.triangles]]
    # By the divergence theorem, the outward-facing triangles enclose half of 20 mm x 10 mm x 30 mm.
    assert np.einsum('ij,ij', faces[:, 0], np.cross(faces[:, 1], faces[:, 2])) / 6 == pytest.approx(3e-6, rel=1e-3)
    edges = [tuple(each[[i, (i + 1) % 3]]) for each in (np.array(t.vertex_indices) for t in mesh.triangles)
             for i in range(3)]
    assert sorted(edges) == sorted((b, a) for a, b in edges)  # Each edge also occurs in the opposite direction.


def test_the_height_is_that_of_the_solid_in_the_message(example):
    solid = SolidPrimitive(type=SolidPrimitive.CYLINDER, dimensions=(0.07, 0.005))
    cylinder, = example.collision_object(shape(ContactShape.CIRCLE, (0.005,), solid=solid), 'held').primitives
    assert cylinder.dimensions[0] == 0.07


def test_a_held_object_is_as_long_as_the_distance_of_the_contacts(example):
    box, = example.held_object(grasp(), sides(), 'held').primitives
    assert box.dimensions[2] == 0.04


@pytest.mark.parametrize(('changes', 'height', 'refusal'), [
    ({'kind': ContactShape.UNKNOWN}, 0.04, 'NO_SHAPE'), ({'kind': ContactShape.NOT_KNOWN}, 0.04, 'NO_SHAPE'),
    ({'kind': ContactShape.NONE}, 0.04, 'NO_SHAPE'), ({'size_is_bound': True}, 0.04, 'SIZE_IS_BOUND'),
    ({'hollow': True}, 0.04, 'HOLLOW'),
    ({}, None, 'NO_HEIGHT'), ({}, nan, 'NO_HEIGHT'), ({}, 0.0, 'NO_HEIGHT'),
    ({'kind': ContactShape.RIGHT_TRIANGLE}, 0.04, 'NO_SHAPE')])
def test_a_contact_whose_shape_or_size_is_not_known_is_refused(example, changes, height, refusal):
    with pytest.raises(example.NoObjectError) as error:
        example.collision_object(shape(**changes), 'held', height)
    assert error.value.refusal is example.Refusal[refusal]


def test_a_default_message_is_refused(example):
    for make in (lambda: example.collision_object(ContactShape(), 'x', pi),
                 lambda: example.held_object(Grasp(), GraspSides(), 'x')):
        with pytest.raises(example.NoObjectError):
            make()


@pytest.mark.parametrize(('changes', 'refusal'), [
    ({'fresh': False}, 'NOT_HELD'), ({'stable': False}, 'NOT_HELD'), ({'contact': Grasp.UNSEEN}, 'NOT_HELD'),
    ({'line_is_bound': True}, 'SIZE_IS_BOUND'), ({'same_shape': False}, 'OTHER_SHAPES'),
    ({'width': nan}, 'WIDTH_NOT_KNOWN')])
def test_a_grasp_that_is_not_held_or_not_known_is_refused(example, changes, refusal):
    with pytest.raises(example.NoObjectError) as error:
        example.held_object(grasp(**changes), sides(), 'held')
    assert error.value.refusal is example.Refusal[refusal]


def test_the_sides_of_another_grasp_are_refused(example):
    later = sides()
    later.header.stamp.sec = 1
    with pytest.raises(example.NoObjectError) as error:
        example.held_object(grasp(), later, 'held')
    assert error.value.refusal is example.Refusal.OTHER_TIME
