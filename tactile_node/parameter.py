"""Declare the fields of a settings class as parameters, with their default, range and meaning."""

import math
from dataclasses import field, fields
from typing import NamedTuple, TypeVar

Value = bool | int | float | str | tuple[str, ...] | tuple[int, ...] | tuple[float, ...]
Default = TypeVar('Default', bound=Value)
METADATA = 'parameter'  #: key under which the metadata of a field stores the properties


class Properties(NamedTuple):
    """Properties of a parameter besides its name and default. ``low`` and ``high`` limit a numerical value."""

    description: str
    low: float = -math.inf
    high: float = math.inf
    live: bool = False  #: True if a change takes effect immediately, False if the parameter is read-only


class Parameter(NamedTuple):
    """One row in the parameter table of a node."""

    name: str
    default: object
    properties: Properties


def parameter(default: Default, description: str, low: float = -math.inf, high: float = math.inf, *,
              live: bool = False) -> Default:
    """Return a dataclass field that defines a ROS parameter."""
    return field(default=default, metadata={METADATA: Properties(description, low, high, live)})


def table(settings: type) -> tuple[Parameter, ...]:
    """Return the parameter table of a node, with one row for each field of its settings."""
    return tuple(Parameter(each.name, each.default, each.metadata[METADATA]) for each in fields(settings))
