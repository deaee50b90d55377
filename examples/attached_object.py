"""Attach the held object to the robot in MoveIt's planning scene, and detach it after it was put down.

    python examples/attached_object.py --ros-args -p link:=panda_hand -p touch_links:="[panda_leftfinger]"

The node publishes on the topic `attached_collision_object`, which the planning scene monitor of MoveIt reads
(docs/howto/moveit.md).
"""

import time
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from collision_object import NoObjectError, held_object
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from tactile_node.grasp.trust import Doubt, doubt
from tactile_node.ros.grasp_checks import check_grasp, check_grasp_sides
from tactile_skin.msg import Grasp, GraspSides

OBJECT = 'held'


class AttachedObject:
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
        self.is_attached: bool | None = None  # None: an earlier run of the node may have attached an object

    def forget(self) -> None:
        """Treat the planning scene as unknown, because MoveIt is not there."""
        self.is_attached = None

    def changed_by(self, grasp: Grasp, sides: GraspSides, silence: float) -> AttachedCollisionObject | None:
        """Return the change of the planning scene, or None. Only ``sides`` of the same stamp can attach an object.

        Parameters
        ----------
        grasp
            Latest grasp.
        sides
            Latest results of both pads.
        silence
            Time since the grasp arrived [s].
        """
        if check_grasp(grasp) is not None:
            return None
        found = doubt(grasp, silence)
        if self.is_attached is not False and found is Doubt.NO_CONTACT and grasp.fresh:
            return self._detached()
        if self.is_attached or found is not Doubt.NONE or check_grasp_sides(sides) is not None:
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
    """Publishes the changes of `AttachedObject` while MoveIt subscribes to them."""

    def __init__(self, steady: Callable[[], float] = time.monotonic, **options: Any):
        super().__init__('attached_object', **options)
        link = self.declare_parameter('link', 'panda_hand').value
        touch_links = self.declare_parameter('touch_links', ['panda_leftfinger', 'panda_rightfinger']).value
        self._held = AttachedObject(link, touch_links)
        self._grasp, self._sides = Grasp(), GraspSides()
        self._steady, self._arrival = steady, steady()
        self._publisher = self.create_publisher(AttachedCollisionObject, 'attached_collision_object', 10)
        self.create_subscription(Grasp, 'grasp', self._on_grasp, 1)
        self.create_subscription(GraspSides, 'grasp_sides', self._on_sides, 1)

    def _on_grasp(self, grasp: Grasp) -> None:
        self._grasp, self._arrival = grasp, self._steady()
        self._publish()

    def _on_sides(self, sides: GraspSides) -> None:
        self._sides = sides
        self._publish()

    def _publish(self) -> None:
        """Publish a change. The two messages of one grasp may arrive in any order, so each arrival is a chance."""
        if not self._publisher.get_subscription_count():  # MoveIt would not receive the change
            self._held.forget()
            return
        change = self._held.changed_by(self._grasp, self._sides, self._steady() - self._arrival)
        if change is not None:
            self._publisher.publish(change)


def main() -> None:
    rclpy.init()
    try:
        rclpy.spin(AttachedObjectNode())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
