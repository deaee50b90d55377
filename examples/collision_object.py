"""Make a MoveIt collision object from a contact or a grasp, so that a motion planner allows for the held object.

    collision_object(shape, 'held')          # height from the message, which needs the parameter solid_height
    collision_object(shape, 'held', 0.05)    # given height [m]
    held_object(grasp, sides, 'held')        # from `grasp` and `grasp_sides`, with the distance of the contacts as
                                             # height; needs the opening of the gripper

The collision object covers only the visible part of the held object: the outline of the contact, extended along the
pad's normal. Let MoveIt add padding for any parts beyond the contact. If a required value is unknown, the functions
make no collision object and raise NoObjectError (see Refusal).
"""

from enum import IntEnum
from math import isfinite

from geometry_msgs.msg import Point, Pose
from moveit_msgs.msg import CollisionObject
from shape_msgs.msg import Mesh, MeshTriangle, SolidPrimitive


class Refusal(IntEnum):
    """Reasons why no collision object was made."""

    NOT_KNOWN = 0
    NO_SHAPE = 1        # the shape is none or unknown, or has no fit
    SIZE_IS_BOUND = 2   # the object may extend beyond the visible part
    NO_HEIGHT = 3       # the height is neither given nor in the message
    NOT_HELD = 4        # the grasp is not fresh, not two-sided or not stable
    WIDTH_NOT_KNOWN = 5  # the opening of the gripper is unknown
    OTHER_SHAPES = 6    # the sides report different shapes, so that the object is not a prism
    HOLLOW = 7          # the contact is a ring or a frame, whose inside may be hollow or solid
    OTHER_TIME = 8      # the message with the sides belongs to another grasp


class NoObjectError(ValueError):
    """Raised if a message does not yield a collision object. ``refusal`` is the reason."""

    def __init__(self, refusal: Refusal):
        super().__init__(f'no collision object: {refusal.name.lower().replace("_", " ")}')
        self.refusal = refusal


def collision_object(shape, object_id: str, height: float | None = None) -> CollisionObject:
    """Return a collision object for the object that touches a pad, with the pose of the contact on the skin.

    Parameters
    ----------
    shape
        ContactShape message.
    object_id
        Id of the collision object. height Height of the object [m], or None to use the height of the solid in the
        message.

    Raises
    ------
    NoObjectError
        Raised if the message does not describe a complete object.
    """
    codes = type(shape)
    if not shape.fit_valid or shape.shape in (codes.NOT_KNOWN, codes.NONE, codes.UNKNOWN):
        raise NoObjectError(Refusal.NO_SHAPE)
    if shape.size_is_bound:
        raise NoObjectError(Refusal.SIZE_IS_BOUND)
    if shape.hollow:
        raise NoObjectError(Refusal.HOLLOW)
    height = _height_of(shape) if height is None else height
    if not (isfinite(height) and height > 0):
        raise NoObjectError(Refusal.NO_HEIGHT)
    found = CollisionObject(header=shape.header, id=object_id, operation=CollisionObject.ADD, pose=shape.pose.pose)
    sizes = shape.dimensions
    if shape.shape == codes.CIRCLE:
        _add_primitive(found, SolidPrimitive.CYLINDER, (height, sizes[0]))
    elif shape.shape in (codes.SQUARE, codes.RECTANGLE):
        _add_primitive(found, SolidPrimitive.BOX, (sizes[0], sizes[-1], height))
    else:
        _add_prism(found, [_in_frame(shape.pose.pose, point) for point in shape.outline.points], height)
    return found


def held_object(grasp, sides, object_id: str) -> CollisionObject:
    """Return a collision object for the object between both pads, extended from the left pad to the right pad.

    Parameters
    ----------
    grasp
        Grasp message.
    sides
        GraspSides message of this grasp.
    object_id
        Id of the collision object.

    Raises
    ------
    NoObjectError
        Raised if the messages do not describe a complete object.
    """
    if sides.header.stamp != grasp.header.stamp:
        raise NoObjectError(Refusal.OTHER_TIME)
    if not (grasp.fresh and grasp.contact == type(grasp).TWO_SIDED and grasp.stable):
        raise NoObjectError(Refusal.NOT_HELD)
    if grasp.line_is_bound:
        raise NoObjectError(Refusal.SIZE_IS_BOUND)
    if not grasp.same_shape:
        raise NoObjectError(Refusal.OTHER_SHAPES)
    if not isfinite(grasp.width):
        raise NoObjectError(Refusal.WIDTH_NOT_KNOWN)
    return collision_object(sides.sides[0], object_id, grasp.width)


def _height_of(shape) -> float:
    """Return the height of the solid or of the mesh in the message, or NaN if the message has neither."""
    if len(shape.solid.dimensions):
        is_box = shape.solid.type == SolidPrimitive.BOX
        return shape.solid.dimensions[SolidPrimitive.BOX_Z if is_box else SolidPrimitive.CYLINDER_HEIGHT]
    return max((vertex.z for vertex in shape.mesh.vertices), default=float('nan'))


def _add_primitive(found: CollisionObject, kind: int, dimensions: tuple[float, ...]) -> None:
    """Add a primitive. The origin of a primitive is its centre, half the height above the skin."""
    height = dimensions[0] if kind == SolidPrimitive.CYLINDER else dimensions[2]
    found.primitives.append(SolidPrimitive(type=kind, dimensions=dimensions))
    found.primitive_poses.append(Pose(position=Point(z=height / 2)))


def _add_prism(found: CollisionObject, corners: list[tuple[float, float]], height: float) -> None:
    """Add a prism as a closed mesh. The corners of each triangle run counter-clockwise as seen from outside."""
    n = len(corners)
    if n < 3:
        raise NoObjectError(Refusal.NO_SHAPE)
    triangles = [(0, i + 1, i) for i in range(1, n - 1)] + [(n, n + i, n + i + 1) for i in range(1, n - 1)]
    for i in range(n):
        j = (i + 1) % n
        triangles += [(i, j, j + n), (i, j + n, i + n)]
    found.meshes.append(Mesh(vertices=[Point(x=x, y=y, z=z) for z in (0.0, height) for x, y in corners],
                             triangles=[MeshTriangle(vertex_indices=each) for each in triangles]))
    found.mesh_poses.append(Pose())


def _in_frame(pose: Pose, point) -> tuple[float, float]:
    """Convert a point on the pad to the frame of ``pose``, which is rotated only about z."""
    z, w = pose.orientation.z, pose.orientation.w
    cos, sin = w * w - z * z, 2 * w * z
    x, y = point.x - pose.position.x, point.y - pose.position.y
    return cos * x + sin * y, cos * y - sin * x
