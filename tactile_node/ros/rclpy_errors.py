"""Turns what rclpy raises for a wrong name, parameter or parameter file into errors of this package."""

from collections.abc import Iterator
from contextlib import contextmanager

from rclpy.exceptions import (
    InvalidNamespaceException,
    InvalidNodeNameException,
    InvalidTopicNameException,
)
from rclpy.impl.implementation_singleton import rclpy_implementation

from tactile_node.errors import ConfigurationError

NAMES = (InvalidNamespaceException, InvalidNodeNameException, InvalidTopicNameException)


@contextmanager
def translate_rclpy_errors() -> Iterator[None]:
    """Raise ConfigurationError for what rclpy raises inside the block."""
    try:
        yield
    except NAMES as error:
        raise ConfigurationError('namespace or pad name', expected='letters, digits and underscores',
                                 got=' '.join(str(error).split()), remedy='Rename it.') from None
    except rclpy_implementation.RCLError as error:
        if 'params file' not in str(error):
            raise
        raise ConfigurationError('parameter file', expected='a ROS 2 parameter file (YAML)',
                                 got=str(error).split(', at /')[0], remedy='Check path and indentation.') from None
