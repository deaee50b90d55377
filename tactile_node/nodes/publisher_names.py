"""Who publishes a topic."""

from rclpy.node import Node


def publisher_names(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that ``node`` sees publish ``topic``, a name for each publisher, sorted."""
    found = node.get_publishers_info_by_topic(topic)
    return sorted(f'{info.node_namespace.rstrip("/")}/{info.node_name}' for info in found)
