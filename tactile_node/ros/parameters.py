"""ROS 2 parameters from the fields of a frozen dataclass: declared, read and changed in one way for every node."""

import math
from array import array
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from typing import Any, NamedTuple, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.qos import QoSProfile

from tactile_node.errors import ConfigurationError
from tactile_node.ros.qos import frames_qos

SIMILAR = 0.8  # ratio of two names from which on one is taken for the other, misspelt
METADATA = 'parameter'  # key of a field's metadata

Value = bool | int | float | str | tuple[str, ...] | tuple[int, ...] | tuple[float, ...]
Default = TypeVar('Default', bound=Value)


class Properties(NamedTuple):
    """What a parameter has beside name and default; ``low`` and ``high`` bound a number."""

    description: str
    low: float = -math.inf
    high: float = math.inf
    live: bool = False  #: a change takes effect at once; otherwise the parameter is read-only


class Parameter(NamedTuple):
    """One row of a node's table of parameters."""

    name: str
    default: object
    properties: Properties


def parameter(default: Default, description: str, low: float = -math.inf, high: float = math.inf, *,
              live: bool = False) -> Default:
    """Return a dataclass field that is a ROS parameter."""
    return field(default=default, metadata={METADATA: Properties(description, low, high, live)})


@dataclass(frozen=True)
class NodeSettings:
    """The parameters that every node has: how the topics that come frame by frame are queued."""

    queue_depth: int = parameter(10, 'number of messages a publisher or subscription keeps; the oldest is discarded '
                                 'first', 1, 100_000)
    lossless: bool = parameter(False, 'for replays: publishers keep 5000 messages, also for late subscribers')

    @property
    def qos(self) -> QoSProfile:
        return frames_qos(self.queue_depth, self.lossless)


@dataclass(frozen=True)
class ReceiverSettings(NodeSettings):
    """Those of a node that receives messages of the chain."""

    best_effort: bool = parameter(False, 'true: what is lost on the way to this node is not sent again but counted as '
                                  'skipped, so that what follows need not wait for it; for a link that loses packets')
    max_clock_offset: float = parameter(0.05, 'how far stamps may be ahead of the clock of this host, or behind it '
                                        '(0.5 s at least, for the way takes time), before the diagnostics warn of it '
                                        '(tf lookups at them would fail here) [s]; ages need no common clock', 0, 1e9)

    @property
    def input_qos(self) -> QoSProfile:
        """Of the subscriptions; a lossless replay loses nothing, whatever ``best_effort`` says."""
        return frames_qos(self.queue_depth, self.lossless, self.best_effort)


Settings = TypeVar('Settings', bound=NodeSettings)


def table(settings: type[NodeSettings]) -> tuple[Parameter, ...]:
    """Return the parameters of a node, a row for each field of its settings."""
    return tuple(Parameter(each.name, each.default, each.metadata[METADATA]) for each in fields(settings))


def declare(node: Node, settings: type[NodeSettings], read_at_configure: Collection[str] = ()) -> None:
    """Declare the parameters of ``settings`` on ``node``; what is not live is read-only once declared.

    Those that a lifecycle node reads at configure are not: the node itself refuses a change while it is configured.
    """
    rows = table(settings)
    for row in rows:
        default = list(row.default) if isinstance(row.default, tuple) else row.default
        try:
            node.declare_parameter(row.name, default, _descriptor(row, row.name in read_at_configure))
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            raise ConfigurationError(f'parameter {row.name!r}', expected=row.properties.description, got=str(error),
                                     remedy='Correct the value, and its unit.') from None
    _warn_of_misspelt(node, [row.name for row in rows])


def read(node: Node, settings: type[Settings]) -> Settings:
    """Return the present values of the parameters of ``settings``."""
    return settings(**{row.name: _immutable(node.get_parameter(row.name).value) for row in table(settings)})


def changed(settings: Settings, parameters: Iterable[RosParameter]) -> Settings:
    """Return ``settings`` with the new values of ``parameters``; those of others, as use_sim_time, are left out."""
    names = {each.name for each in fields(settings)}
    return replace(settings, **{each.name: _immutable(each.value) for each in parameters if each.name in names})


def _immutable(value: Any) -> Any:
    """A parameter's value, which rclpy does not type, as a frozen dataclass holds it."""
    return tuple(value) if isinstance(value, (list, array)) else value


def _descriptor(row: Parameter, read_at_configure: bool) -> ParameterDescriptor:
    description, low, high, live = row.properties
    descriptor = ParameterDescriptor(name=row.name, description=description,
                                     read_only=not (live or read_at_configure))
    if read_at_configure:
        descriptor.additional_constraints = 'read at configure: can be set while the node is unconfigured'
    if not math.isfinite(high):
        return descriptor
    if isinstance(row.default, float):
        descriptor.floating_point_range = [FloatingPointRange(from_value=float(low), to_value=float(high))]
    else:
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=1)]
    return descriptor


def _warn_of_misspelt(node: Node, known: list[str]) -> None:
    """ROS accepts any name in a parameter file, since one file may serve several nodes."""
    for name in set(getattr(node, '_parameter_overrides', {})) - set(known):
        for similar in get_close_matches(name, known, 1, SIMILAR):
            node.get_logger().warning(f'parameter {name!r} is not known: is {similar!r} meant?')
