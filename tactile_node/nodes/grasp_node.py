"""The shapes under two opposing pads -> one grasp, on a topic."""

import sys
from functools import partial

from rclpy.node import Node

from tactile_node.grasp.gripper import Gripper, PadPose
from tactile_node.grasp.tracker import SIDES, GraspSettings, GraspTracker
from tactile_node.node_graph import NODE_NAMES, Role
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.nodes.node_health import MessageHealth
from tactile_node.nodes.run import run_node
from tactile_node.ros.grasp_messages import grasp_message, side_result
from tactile_node.ros.message_checks import check_contact_shape
from tactile_node.ros.parameters import declare, read
from tactile_node.ros.settings import GraspNodeSettings
from tactile_skin.msg import ContactShape, Grasp


class GraspNode(Node):
    """Publishes `grasp` for every usable `<pad>/shape` of its two pads.

    Raises ConfigurationError for a wrong parameter.
    """

    def __init__(self, **options):
        super().__init__(NODE_NAMES[Role.GRASP], **options)
        declare(self, GraspNodeSettings)
        self._settings = settings = read(self, GraspNodeSettings)
        gripper = Gripper(PadPose(settings.left_xyz, settings.left_rpy),
                          PadPose(settings.right_xyz, settings.right_rpy))
        self._tracker = GraspTracker(GraspSettings(gripper, settings.centre_tolerance, settings.min_hold,
                                                   settings.max_skew))
        self._latest = {side: ContactShape() for side in SIDES}
        self._publisher = self.create_publisher(Grasp, 'grasp', settings.qos)
        MessageHealth(self, [
            GuardedSubscription(self, ContactShape, f'{pad}/shape', partial(self._on_shape, side), settings.qos,
                                check=check_contact_shape)
            for side, pad in zip(SIDES, (settings.left_pad, settings.right_pad))])

    def _on_shape(self, side: str, message: ContactShape) -> None:
        state = self._tracker.update(side, side_result(message), self._settings.gap)
        self._latest[side] = message
        sides = [self._latest[side] for side in SIDES]
        self._publisher.publish(grasp_message(state, sides, self._settings.gap, self._settings.frame_id))


def main() -> int:
    return run_node(GraspNode)


if __name__ == '__main__':
    sys.exit(main())
