"""Attach the held object to the robot in MoveIt's planning scene, and detach it after it was put down.

    python examples/attached_object.py --ros-args -p link:=panda_hand -p touch_links:="[panda_leftfinger]"

The node publishes on the topic `attached_collision_object`, which the planning scene monitor of MoveIt reads
(docs/howto/moveit.md).
"""

from collections.abc import Sequence
from typing import Any

import rclpy
from collision_object import NoObjectError, held_object
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject
from rclpy.node import Node

from tactile_node.grasp.trust import Doubt, doubt
from tactile_node.ros.grasp_checks import check_grasp, check_grasp_sides
from tactile_skin.msg import Grasp, GraspSides

OBJECT = 'held'


class HeldObject:
    """Decides from each grasp whether to attach or to detach the object.

    The object is attached when a grasp may be acted on and describes a complete object. The object is detached when
    both pads are known to be empty. A grasp that is old, unseen or one-sided changes nothing, because the object may
    still be in the gripper.

    Parameters
    ----------
    link
        Link of the robot to which the object is attached.
    touch_links
        Links that the object may touch without a collision.
    """

    def __init__(self, link: str, touch_links: Sequence[str]):
        self._link, self._touch_links = link, list(touch_links)
        self.is_attached = False

    def changed_by(self, grasp: Grasp, sides: GraspSides) -> AttachedCollisionObject | None:
        """Return the change of the planning scene, or None. Only ``sides`` of the same stamp can attach an object."""
        if check_grasp(grasp) is not None:
            return None
        found = doubt(grasp, silence=0.0)
        if self.is_attached:
            return self._detached() if found is Doubt.NO_CONTACT and grasp.fresh else None
        if found is not Doubt.NONE or check_grasp_sides(sides) is not None:
            return None
        try:
            held = held_object(grasp, sides, OBJECT)
        except NoObjectError:
            return None
        self.is_attached = True
        return AttachedCollisionObject(link_name=self._link, object=held, touch_links=self._touch_links)

    def _detached(self) -> AttachedCollisionObject:
        """Return the change that leaves the object in the world, at its last place in the gripper."""
        self.is_attached = False
        return AttachedCollisionObject(link_name=self._link,
                                       object=CollisionObject(id=OBJECT, operation=CollisionObject.REMOVE))


class AttachedObjectNode(Node):
    """Publishes the changes of `HeldObject`."""

    def __init__(self, **options: Any):
        super().__init__('attached_object', **options)
        link = self.declare_parameter('link', 'panda_hand').value
        touch_links = self.declare_parameter('touch_links', ['panda_leftfinger', 'panda_rightfinger']).value
        self._held = HeldObject(link, touch_links)
        self._grasp, self._sides = Grasp(), GraspSides()
        self._publisher = self.create_publisher(AttachedCollisionObject, 'attached_collision_object', 10)
        self.create_subscription(Grasp, 'grasp', self._on_grasp, 1)
        self.create_subscription(GraspSides, 'grasp_sides', self._on_sides, 1)

    def _on_grasp(self, grasp: Grasp) -> None:
        self._grasp = grasp
        self._publish()

    def _on_sides(self, sides: GraspSides) -> None:
        self._sides = sides
        self._publish()

    def _publish(self) -> None:
        """Publish a change. The two messages of one grasp may arrive in any order, so each arrival is a chance."""
        change = self._held.changed_by(self._grasp, self._sides)
        if change is not None:
            self._publisher.publish(change)


def main() -> None:
    rclpy.init()
    rclpy.spin(AttachedObjectNode())


if __name__ == '__main__':
    main()
