"""All nodes of one bus in one process."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from rclpy.node import Node
from rclpy.parameter import Parameter

from tactile_node.nodes.classifier_node import ClassifierNode
from tactile_node.nodes.driver_node import DriverNode
from tactile_node.nodes.grasp_node import GraspNode
from tactile_node.nodes.processor_node import ProcessorNode


class System(NamedTuple):
    """The nodes of one bus: a driver, a processor and a classifier for each pad, and a grasp of two pads."""

    driver: DriverNode
    processors: tuple[ProcessorNode, ...]
    classifiers: tuple[ClassifierNode, ...]
    grasp: GraspNode | None  #: where there are two pads

    @property
    def nodes(self) -> tuple[Node, ...]:
        """All of them, the driver, which feeds the others, first."""
        grasp = (self.grasp,) if self.grasp else ()
        return (self.driver, *self.processors, *self.classifiers, *grasp)

    def destroy(self) -> None:
        for node in self.nodes:
            node.destroy_node()


def make_system(pads: Sequence[str], driver: Mapping[str, Any], namespace: str = '',
                chain: Mapping[str, Any] | None = None) -> System:
    """Make the nodes; ``driver`` and ``chain`` are parameters that win over files and defaults.

    Raises ConfigurationError for a wrong parameter of processor or classifier.
    """
    options = {'parameter_overrides': _overrides(chain or {})}
    processors = tuple(ProcessorNode(namespace=f'{namespace}/{pad}', **options) for pad in pads)
    classifiers = tuple(ClassifierNode(namespace=f'{namespace}/{pad}', **options) for pad in pads)
    overrides = _overrides({'pads': list(pads), **driver})
    return System(DriverNode(namespace=namespace, parameter_overrides=overrides), processors, classifiers,
                  _grasp(pads, namespace, chain or {}))


def _grasp(pads: Sequence[str], namespace: str, chain: Mapping[str, Any]) -> GraspNode | None:
    if len(pads) != 2:
        return None
    return GraspNode(namespace=namespace,
                     parameter_overrides=_overrides({'left_pad': pads[0], 'right_pad': pads[1], **chain}))


def _overrides(values: Mapping[str, Any]) -> list[Parameter]:
    return [Parameter(name, value=value) for name, value in values.items()]
