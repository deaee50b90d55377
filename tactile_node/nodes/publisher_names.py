"""Who publishes a topic, and in which version of its message."""

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo


def publisher_names(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that ``node`` sees publish ``topic``, a name for each publisher, sorted."""
    return sorted(map(_full_name, node.get_publishers_info_by_topic(topic)))


def publishers_of_other_type(node: Node, topic: str) -> tuple[str, ...]:
    """Return the full names of those whose message of ``topic`` has other fields than the one that ``node`` reads.

    The middleware joins publisher and subscription by the name of the type alone, and values are then read from the
    wrong places. What differs is the hash of the type's description (REP 2011). Empty also where it is not known.
    """
    own = [info.topic_type_hash for info in node.get_subscriptions_info_by_topic(topic)
           if _full_name(info) == node.get_fully_qualified_name()]
    return tuple(sorted({_full_name(info) for info in node.get_publishers_info_by_topic(topic)
                         if own and _is_known(info) and info.topic_type_hash != own[0]}))


def _full_name(info: TopicEndpointInfo) -> str:
    return f'{info.node_namespace.rstrip("/")}/{info.node_name}'


def _is_known(info: TopicEndpointInfo) -> bool:
    """A publisher of an older ROS 2 sends none."""
    return any(info.topic_type_hash.value)
