"""The message of /tf. Its package, tf2_msgs, is part of every ROS installation and missing on PyPI: it is optional."""

from tactile_node.errors import ConfigurationError


def tf_message_type(where: str) -> type:
    """Return the message of /tf, which ``where`` needs. Raises ConfigurationError where tf2_msgs is not installed."""
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError as error:
        raise ConfigurationError(
            where, expected='the ROS package tf2_msgs', got=f'{error}',
            remedy='Install ros-jazzy-tf2-msgs, or leave it out.') from None
    return TFMessage
