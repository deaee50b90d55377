"""All nodes of one bus in one process."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from rclpy.node import Node
from rclpy.parameter import Parameter

from tactile_node.frames.frame_source import FrameSource
from tactile_node.node_graph import NodeDescription, Role
from tactile_node.nodes.classifier_node import ClassifierNode
from tactile_node.nodes.driver_node import DriverNode
from tactile_node.nodes.grasp_node import GraspNode
from tactile_node.nodes.processor_node import ProcessorNode

CLASSES: dict[Role, Callable[..., Node]] = {Role.DRIVER: DriverNode, Role.PROCESSOR: ProcessorNode,
                                   Role.CLASSIFIER: ClassifierNode, Role.GRASP: GraspNode}


class System(NamedTuple):
    """The nodes of one bus."""

    nodes: tuple[Node, ...]

    @property
    def driver(self) -> DriverNode:
        return next(node for node in self.nodes if isinstance(node, DriverNode))

    @property
    def source(self) -> FrameSource:
        """The driver's bus or log. Raises RuntimeError while it is unconfigured."""
        if self.driver.source is None:
            raise RuntimeError('the driver is not configured')
        return self.driver.source

    @property
    def recognised(self) -> int:
        """Shapes published by all classifiers."""
        return sum(node.recognised for node in self.nodes if isinstance(node, ClassifierNode))

    def destroy(self) -> None:
        """Destroy all nodes, the driver, which feeds the others, first."""
        self.driver.destroy_node()
        for node in self.nodes:
            if node is not self.driver:
                node.destroy_node()


def make_system(descriptions: Sequence[NodeDescription]) -> System:
    """Make the described nodes. Raises ConfigurationError for a wrong parameter of processor, classifier or grasp."""
    return System(tuple(_made(description) for description in descriptions))


def _made(description: NodeDescription) -> Node:
    overrides = [Parameter(name, value=value) for name, value in description.parameters.items()]
    return CLASSES[description.role](namespace=description.namespace, parameter_overrides=overrides)
