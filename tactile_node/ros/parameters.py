"""Declare, read and change the ROS 2 parameters that a node's table of settings defines."""

import math
from array import array
from collections.abc import Callable, Collection, Iterable
from dataclasses import fields, replace
from difflib import get_close_matches
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from tactile_node.errors import ConfigurationError
from tactile_node.parameter import Parameter, table
from tactile_node.ros.settings import NodeSettings

SIMILAR = 0.8  #: lowest similarity at which an unknown name counts as a misspelling of a known name

Settings = TypeVar('Settings', bound=NodeSettings)


def declare(node: Node, settings: type[NodeSettings], read_at_configure: Collection[str] = ()) -> None:
    """Declare the parameters of a node. Parameters that are not live become read-only.

    Parameters
    ----------
    node
        Node for which the parameters are declared.
    settings
        Settings class that defines the parameters.
    read_at_configure
        Names of the parameters that a lifecycle node reads when it is configured. These parameters are not read-only,
        because the node itself refuses changes while it is configured.
    """
    rows = table(settings)
    overrides = getattr(node, '_parameter_overrides', {})
    for row in rows:
        default = list(row.default) if isinstance(row.default, tuple) else row.default
        descriptor = _descriptor(row, row.name in read_at_configure)
        try:
            if row.name in overrides and overrides[row.name].value in (None, []):
                _declare_without_values(node, row, descriptor)
            else:
                node.declare_parameter(row.name, default, descriptor)
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            raise ConfigurationError(f'parameter {row.name!r}', expected=row.properties.description, got=str(error),
                                     remedy='Correct the value and its unit.') from None
    _warn_of_misspelt(node, [row.name for row in rows])


def _declare_without_values(node: Node, row: Parameter, descriptor: ParameterDescriptor) -> None:
    """Declare a parameter whose override is an empty list, because ROS cannot infer the type of an empty list.

    If the default consists of empty strings, an empty list selects the default. Otherwise, the value becomes an empty
    list.
    """
    if not isinstance(row.default, tuple):
        raise ConfigurationError(f'parameter {row.name!r}', expected=row.properties.description, got='an empty list',
                                 remedy='Set the parameter to one value.')
    default = list(row.default)
    node.declare_parameter(row.name, default, ignore_override=True)
    kind = RosParameter.Type.from_parameter_value(default)
    descriptor.type = kind.value
    if default[0] != '':
        node.set_parameters([RosParameter(row.name, kind, [])])
    node.set_descriptor(row.name, descriptor)  # the last step, because a read-only parameter cannot be set


def read(node: Node, settings: type[Settings]) -> Settings:
    """Return the current values of the parameters of ``settings``."""
    return settings(**{row.name: _immutable(node.get_parameter(row.name).value) for row in table(settings)})


def follow_changes(node: Node, settings: type[Settings], check: Callable[[Settings], None],
                   apply: Callable[[Settings], None]) -> None:
    """Check every change of the parameters, and apply the change only after all callbacks have accepted it.

    Parameters
    ----------
    check
        Function that raises ConfigurationError to refuse new values. The function must have no side effects.
    apply
        Function that applies the values of all parameters after any parameter was set. The function must not raise an
        exception.
    """
    def on_set(parameters: list[RosParameter]) -> SetParametersResult:
        try:
            check(changed(read(node, settings), parameters))
        except ConfigurationError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)
    node.add_on_set_parameters_callback(on_set)
    node.add_post_set_parameters_callback(lambda _: apply(read(node, settings)))


def changed(settings: Settings, parameters: Iterable[RosParameter]) -> Settings:
    """Return ``settings`` with new values. Other parameters, such as use_sim_time, are ignored."""
    names = {each.name for each in fields(settings)}
    return replace(settings, **{each.name: _immutable(each.value) for each in parameters if each.name in names})


def _immutable(value: Any) -> Any:
    """Return a parameter's value in an immutable form, because a frozen dataclass stores the value."""
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
    """Warn about unknown names that resemble a known name.

    ROS itself accepts any name, because one parameter file may serve several nodes.
    """
    for name in set(getattr(node, '_parameter_overrides', {})) - set(known):
        for similar in get_close_matches(name, known, 1, SIMILAR):
            node.get_logger().warning(f'parameter {name!r} is not known. Did you mean {similar!r}?')
