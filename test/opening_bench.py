"""A node that reads the opening of its gripper from messages, in virtual time."""

from math import isnan

import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros_bench import TIMEOUT, TimedBench

from tactile_node.nodes.opening_source import make_opening_source
from tactile_node.ros.parameters import declare, read
from tactile_node.ros.settings import GraspNodeSettings

#: Period of the messages [s].
PERIOD = 0.01


class OpeningBench(TimedBench):
    """A node with a source of the opening, and a node that publishes the messages that the source reads.

    Parameters
    ----------
    topics : sequence
        Type, topic and QoS of each of the messages, in the order of the source's subscriptions.
    closing : array_like
        Closing direction of the gripper. Shape (3,).
    """

    def __init__(self, stack, topics, closing=(0.0, 0.0, 1.0)):
        super().__init__(stack, PERIOD)
        self._closing = np.array(closing)
        self.publishing = self.add('publishing')
        self._publishers = [self.publishing.create_publisher(kind, topic, qos) for kind, topic, qos in topics]

    def make(self, **parameters):
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        self.node = self.add(self.time.of(Node)('grasp', parameter_overrides=overrides))
        declare(self.node, GraspNodeSettings)
        self.source = make_opening_source(self.node, read(self.node, GraspNodeSettings), self._closing, self.steady)
        self.until_joined(lambda: not hasattr(self.source, 'subscriptions')
                          or all(each.get_subscription_count() for each in self._publishers))
        return self

    def current(self):
        return self.source.current()

    @property
    def counts(self):
        return self.source.subscriptions[0].counts

    def publish(self, message, number=0):
        """Publish a message on a topic, and return the opening after the node has received the message."""
        subscription = self.source.subscriptions[number]
        received = subscription.counts.received
        self._publishers[number].publish(message)
        self.settle()
        assert subscription.counts.received == received + 1
        return self.current()

    def until_known(self, send):
        """Call ``send`` once per PERIOD until it returns a known opening, and return the opening.

        The opening is known once the node has found the smallest transport delay.
        """
        end = self.steady() + TIMEOUT
        while isnan((opening := send()).gap):
            assert self.steady() < end, 'not known'
            self.step()
        return opening
