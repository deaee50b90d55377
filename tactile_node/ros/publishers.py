"""Find the publishers of a topic in the ROS graph."""

from typing import Any

from rclpy.node import Node


def publisher_names(node: Node, topic: str) -> list[str]:
    """Return the sorted full names of the nodes that ``node`` sees publishing ``topic``, one entry per publisher."""
    return sorted(map(_full_name, node.get_publishers_info_by_topic(topic)))


def publishers_of_other_type(node: Node, topic: str) -> tuple[str, ...]:
    """Return the full names of the nodes that publish ``topic`` with a different version of the message type.

    The middleware matches a publisher and a subscription only by the name of the message type. If the fields differ,
    the subscriber decodes wrong values. The function therefore compares the hashes of the type descriptions (REP 2011).

    Parameters
    ----------
    node : Node
        Node that subscribes to the topic.
    topic : str
        Full name of the topic.

    Returns
    -------
    tuple of str
        Sorted full names. Publishers whose type hash is not known are omitted.
    """
    own = [info.topic_type_hash for info in node.get_subscriptions_info_by_topic(topic)
           if _full_name(info) == node.get_fully_qualified_name()]
    return tuple(sorted({_full_name(info) for info in node.get_publishers_info_by_topic(topic)
                         if own and _is_known(info) and info.topic_type_hash != own[0]}))


# The type of `info` is rclpy's TopicEndpointInfo, which Lyrical keeps in a different module than Jazzy and Kilted.
def _full_name(info: Any) -> str:
    return f'{info.node_namespace.rstrip("/")}/{info.node_name}'


def _is_known(info: Any) -> bool:
    """Return True if the publisher sends the hash of its message type, which older ROS 2 releases do not."""
    return any(info.topic_type_hash.value)
