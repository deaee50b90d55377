"""Describe the ROS 2 nodes of one bus as data.

The launch file, `tactile bringup` and the demo start the nodes from this description.

The module imports neither rclpy nor a numerical library, so that a launch file can import it quickly.
"""

import re
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import NamedTuple

from tactile_node.errors import ConfigurationError

ParameterValue = bool | int | float | str | list[str] | list[int] | list[float]
Parameters = Mapping[str, ParameterValue]


class Role(Enum):
    """Task of a node. The value is the first word of the executable's name."""

    DRIVER = 'driver'
    PROCESSOR = 'processor'
    CLASSIFIER = 'classifier'
    GRASP = 'grasp'


class Side(Enum):
    """Side of the system on which a node runs, if the nodes are split between two hosts or processes."""

    BUS = 'bus'                #: the driver, on the host with the CAN adapter
    PERCEPTION = 'perception'  #: the other nodes, on any host, because they need neither the bus nor the layout


NODE_NAMES = {Role.DRIVER: 'skin_driver', Role.PROCESSOR: 'processor', Role.CLASSIFIER: 'classifier',
              Role.GRASP: 'grasp'}
PADS_OF_A_GRASP = 2
ROS_NAME = re.compile('(/?[A-Za-z_][A-Za-z0-9_]*)(/[A-Za-z_][A-Za-z0-9_]*)*')


class NodeDescription(NamedTuple):
    """One node. The ``parameters`` of a node take precedence over parameter files and defaults."""

    role: Role
    pad: str            #: name of the pad; '' for a node of the whole bus
    bus_namespace: str  #: namespace of the bus; '' for the root
    parameters: Parameters

    @property
    def name(self) -> str:
        return NODE_NAMES[self.role]

    @property
    def namespace(self) -> str:
        return '/'.join(part for part in (self.bus_namespace, self.pad) if part)

    @property
    def label(self) -> str:
        """Name of the node relative to the namespace of its bus."""
        return f'{self.pad}/{self.name}' if self.pad else self.name


def bus_nodes(pads: Sequence[str], *, driver: Parameters, every: Parameters | None = None,
              classifier: Parameters | None = None, grasp: Parameters | None = None,
              namespace: str = '') -> tuple[NodeDescription, ...]:
    """Return the nodes of one bus.

    The nodes are a processor and a classifier for each pad, a grasp node if there are two pads, and the driver last.
    The grasp node assumes that the two pads face each other.

    Parameters
    ----------
    pads : sequence of str
        Names of the pads.
    driver, classifier, grasp : mapping
        Parameters of the driver, the classifiers and the grasp node.
    every : mapping or None
        Parameters of all nodes.
    namespace : str
        Namespace of the bus.

    Raises
    ------
    ConfigurationError
        Raised if two pads have the same name, or if a name cannot be used.

    Examples
    --------
    >>> for node in bus_nodes(['left', 'right'], driver={'channel': 'can1'}, namespace='hand'):
    ...     print(node.label.ljust(16), f'{node.namespace}/{node.name}')
    left/processor   hand/left/processor
    left/classifier  hand/left/classifier
    right/processor  hand/right/processor
    right/classifier hand/right/classifier
    grasp            hand/grasp
    skin_driver      hand/skin_driver
    """
    _check_names(pads, namespace)
    common = dict(every or {})
    of_pad: dict[Role, Parameters] = {Role.PROCESSOR: common, Role.CLASSIFIER: {**common, **(classifier or {})}}
    nodes = [NodeDescription(role, pad, namespace, parameters) for pad in pads for role, parameters in of_pad.items()]
    if len(pads) == PADS_OF_A_GRASP:
        sides: Parameters = {'left_pad': pads[0], 'right_pad': pads[1]}
        nodes.append(NodeDescription(Role.GRASP, '', namespace, {**sides, **common, **(grasp or {})}))
    return (*nodes, NodeDescription(Role.DRIVER, '', namespace, {'pads': list(pads), **common, **driver}))


def roles_of(side: Side) -> tuple[Role, ...]:
    """Return the roles of the nodes that run on ``side``.

    >>> [role.value for role in roles_of(Side.PERCEPTION)]
    ['processor', 'classifier', 'grasp']
    """
    return tuple(role for role in Role if (role is Role.DRIVER) is (side is Side.BUS))


def _check_names(pads: Sequence[str], namespace: str) -> None:
    if not pads:
        raise ConfigurationError('pads', expected='a name for each pad', got='none', remedy='Name a pad.')
    for what, name in (('namespace', namespace), *(('pads', pad) for pad in pads)):
        if name and not ROS_NAME.fullmatch(name):  # rclpy would reject the name only after an unrelated warning
            raise ConfigurationError(what, expected='letters, digits and underscores, not a digit first, joined by /',
                                     got=repr(name),
                                     remedy='Rename it.' + ' Commas separate several pads.' * (what == 'pads'))
    if len(set(pads)) != len(pads):
        raise ConfigurationError('pads', expected='a different name for each', got=', '.join(pads),
                                 remedy='Give every pad a different name.')
