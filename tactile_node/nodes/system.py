"""The nodes of one bus that run in the same process."""

from collections.abc import Sequence
from threading import Event
from typing import TYPE_CHECKING, Any

from rclpy.node import Node
from rclpy.parameter import Parameter

from tactile_node.node_graph import NodeDescription, Role
from tactile_node.nodes.stage import STOP_TIMEOUT, Stages
from tactile_node.sources.frame_source import FrameSource

if TYPE_CHECKING:
    from tactile_node.nodes.classifier_node import ClassifierNode
    from tactile_node.nodes.driver_node import DriverNode


class System:
    """Nodes of one process, which pass their results to each other by direct calls on one chain thread.

    Parameters
    ----------
    descriptions : sequence of NodeDescription
        Nodes to create.

    Raises
    ------
    ConfigurationError
        Raised if a parameter of a processor, a classifier or a grasp node is invalid.
    """

    def __init__(self, descriptions: Sequence[NodeDescription]):
        self._driver: DriverNode | None = None
        self._stages = Stages()
        self._classifiers: list[ClassifierNode] = []
        self.nodes = tuple(self._make(each.role, _options(each)) for each in descriptions)

    @property
    def driver(self) -> 'DriverNode':
        """The driver node. Raises RuntimeError if the driver runs in another process."""
        if self._driver is None:
            raise RuntimeError('the driver runs in another process')
        return self._driver

    @property
    def source(self) -> FrameSource:
        """The bus or the log that the driver reads. Raises RuntimeError while the driver is unconfigured."""
        if self.driver.source is None:
            raise RuntimeError('the driver is not configured')
        return self.driver.source

    @property
    def recognised(self) -> int:
        """Number of shapes that all classifiers together have published."""
        return sum(node.recognised for node in self._classifiers)

    def autostart(self, stop_requested: Event) -> None:
        """Start the driver if it runs in this process; see `DriverNode.autostart`."""
        if self._driver is not None:
            self._driver.autostart(stop_requested)

    def destroy(self) -> None:
        """Destroy all nodes. The driver is destroyed first, because it sends data to the other nodes."""
        if self._driver is not None:
            self._driver.destroy_node()
        for node in self.nodes:
            if node is not self._driver:
                node.destroy_node()
        self._stages.chain.stop(STOP_TIMEOUT)

    def _make(self, role: Role, options: dict[str, Any]) -> Node:
        """Create a node, and import its module only now, so that a process loads only the modules of its own nodes."""
        if role is Role.DRIVER:
            from tactile_node.nodes.driver_node import DriverNode
            self._driver = DriverNode(self._stages, **options)
            return self._driver
        if role is Role.CLASSIFIER:
            from tactile_node.nodes.classifier_node import ClassifierNode
            self._classifiers.append(ClassifierNode(self._stages, **options))
            return self._classifiers[-1]
        if role is Role.PROCESSOR:
            from tactile_node.nodes.processor_node import ProcessorNode
            return ProcessorNode(self._stages, **options)
        from tactile_node.nodes.grasp_node import GraspNode
        return GraspNode(self._stages, **options)


def _options(description: NodeDescription) -> dict[str, Any]:
    return {'namespace': description.namespace,
            'parameter_overrides': [Parameter(name, value=value) for name, value in description.parameters.items()]}
