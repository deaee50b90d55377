"""The ROS 2 nodes of one bus, as data: launch file, `tactile bringup` and the demo start what is described here.

Imports neither rclpy nor a numerical library, so that a launch file can read it at once.
"""

from collections.abc import Mapping, Sequence
from enum import Enum
from typing import NamedTuple

ParameterValue = bool | int | float | str | list[str] | list[int] | list[float]
Parameters = Mapping[str, ParameterValue]


class Role(Enum):
    """What a node does; the value is the first word of its executable's name."""

    DRIVER = 'driver'
    PROCESSOR = 'processor'
    CLASSIFIER = 'classifier'
    GRASP = 'grasp'


NODE_NAMES = {Role.DRIVER: 'skin_driver', Role.PROCESSOR: 'processor', Role.CLASSIFIER: 'classifier',
              Role.GRASP: 'grasp'}
#: The topics that come frame by frame: name relative to the pad, message. `pose` comes too, from ClassifierNode.
PAD_TOPICS = {'taxels': 'TaxelArray', 'features': 'ContactFeatures', 'shape': 'ContactShape'}
GRASP_TOPIC = {'grasp': 'Grasp'}
PADS_OF_A_GRASP = 2


class NodeDescription(NamedTuple):
    """One node; ``parameters`` win over parameter files and defaults."""

    role: Role
    namespace: str
    parameters: Parameters

    @property
    def name(self) -> str:
        return NODE_NAMES[self.role]

    @property
    def executable(self) -> str:
        return f'{self.role.value}_node'


def bus_nodes(pads: Sequence[str], *, driver: Parameters, every: Parameters | None = None,
              namespace: str = '') -> tuple[NodeDescription, ...]:
    """Describe the nodes of one bus: a processor and a classifier for each pad, a grasp of two pads, the driver last.

    ``driver``: parameters of the driver; ``every``: of all nodes. Two pads are taken to face each other.

    >>> for node in bus_nodes(['left', 'right'], driver={'channel': 'can1'}, namespace='hand'):
    ...     print(node.executable, f'{node.namespace}/{node.name}')
    processor_node hand/left/processor
    classifier_node hand/left/classifier
    processor_node hand/right/processor
    classifier_node hand/right/classifier
    grasp_node hand/grasp
    driver_node hand/skin_driver
    """
    common = dict(every or {})
    of_pads = [NodeDescription(role, pad_namespace(namespace, pad), common)
               for pad in pads for role in (Role.PROCESSOR, Role.CLASSIFIER)]
    return (*of_pads, *_grasp(pads, common, namespace),
            NodeDescription(Role.DRIVER, namespace, {'pads': list(pads), **common, **driver}))


def frame_topics(pads: Sequence[str], namespace: str = '') -> dict[str, str]:
    """Return the full names of the topics that come frame by frame, with their messages' names.

    >>> frame_topics(['pad'])
    {'/pad/taxels': 'TaxelArray', '/pad/features': 'ContactFeatures', '/pad/shape': 'ContactShape'}
    """
    root = f'/{namespace.strip("/")}' if namespace.strip('/') else ''
    topics = {f'{root}/{pad}/{name}': message for pad in pads for name, message in PAD_TOPICS.items()}
    if len(pads) == PADS_OF_A_GRASP:
        topics |= {f'{root}/{name}': message for name, message in GRASP_TOPIC.items()}
    return topics


def pad_namespace(namespace: str, pad: str) -> str:
    return f'{namespace}/{pad}' if namespace else pad


def _grasp(pads: Sequence[str], common: Parameters, namespace: str) -> list[NodeDescription]:
    if len(pads) != PADS_OF_A_GRASP:
        return []
    return [NodeDescription(Role.GRASP, namespace, {'left_pad': pads[0], 'right_pad': pads[1], **common})]
