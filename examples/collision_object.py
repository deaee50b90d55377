"""A contact or a grasp as a MoveIt collision object, so that a motion planner keeps clear of what the gripper holds.

    collision_object(shape, 'held')          # with parameter solid_height: of the height that it gives
    collision_object(shape, 'held', 0.05)    # of this height [m]
    held_object(grasp, sides, 'held')        # of `grasp` and `grasp_sides`, as long as the contacts are apart: needs
                                             # the gripper's opening

The object is what the pad sees of it, in the pad's frame: the contact's outline, extended along the pad's normal.
What reaches beyond the contact is not seen; let MoveIt pad it. Nothing is made of what is not known: see Refusal.
"""

from enum import IntEnum
from math import isfinite

from geometry_msgs.msg import Point, Pose
from moveit_msgs.msg import CollisionObject
from shape_msgs.msg import Mesh, MeshTriangle, SolidPrimitive


class Refusal(IntEnum):
    """Why there is no collision object."""

    NOT_KNOWN = 0
    NO_SHAPE = 1        # none, unknown, or without a fit
    SIZE_IS_BOUND = 2   # it may reach beyond what is seen
    NO_HEIGHT = 3       # neither given nor in the message
    NOT_HELD = 4        # not fresh, not two-sided or not stable
    WIDTH_NOT_KNOWN = 5  # the gripper's opening is not known
    OTHER_SHAPES = 6    # the sides report different shapes: it is no prism
    HOLLOW = 7          # a ring or a frame: whether its inside is solid is not known
    OTHER_TIME = 8      # the sides are those of another grasp


class NoObjectError(ValueError):
    """A message from which no collision object can be made; ``refusal`` is the reason."""

    def __init__(self, refusal: Refusal):
        super().__init__(f'no collision object: {refusal.name.lower().replace("_", " ")}')
        self.refusal = refusal


def collision_object(shape, object_id: str, height: float | None = None) -> CollisionObject:
    """Return the object that touches a pad as ``shape`` (ContactShape), ``height`` [m] high; None: as in its solid.

    Its pose is that of the contact, on the skin. Raises NoObjectError.
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
    """Return what both pads hold, from the left pad to the right one; ``sides``: the GraspSides of ``grasp``.

    Raises NoObjectError.
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
    """Of the solid or the mesh in the message; NaN without one."""
    if len(shape.solid.dimensions):
        is_box = shape.solid.type == SolidPrimitive.BOX
        return shape.solid.dimensions[SolidPrimitive.BOX_Z if is_box else SolidPrimitive.CYLINDER_HEIGHT]
    return max((vertex.z for vertex in shape.mesh.vertices), default=float('nan'))


def _add_primitive(found: CollisionObject, kind: int, dimensions: tuple[float, ...]) -> None:
    """Primitives are about their middle: half the height above the skin."""
    height = dimensions[0] if kind == SolidPrimitive.CYLINDER else dimensions[2]
    found.primitives.append(SolidPrimitive(type=kind, dimensions=dimensions))
    found.primitive_poses.append(Pose(position=Point(z=height / 2)))


def _add_prism(found: CollisionObject, corners: list[tuple[float, float]], height: float) -> None:
    """A closed mesh; the triangles' corners run counter-clockwise seen from outside."""
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
    """A point of the pad in the frame of ``pose``, which is turned about z only."""
    z, w = pose.orientation.z, pose.orientation.w
    cos, sin = w * w - z * z, 2 * w * z
    x, y = point.x - pose.position.x, point.y - pose.position.y
    return cos * x + sin * y, cos * y - sin * x
