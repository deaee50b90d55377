"""Remove the names that apply to all nodes of a process from its ROS arguments.

A namespace from launch, for example from PushRosNamespace, reaches the process as the remapping rule `-r __ns:=/robot`.
The ROS client library applies this rule to each node and replaces the node's own namespace. In a process with several
nodes, `left/processor` and `right/processor` would both become `/robot/processor`.
"""

import logging
from collections.abc import Sequence
from typing import NamedTuple

logger = logging.getLogger(__name__)

REMAP = ('-r', '--remap')
NAMESPACE = '__ns'
NODE_NAME_RULES = ('__node', '__name')


class GlobalNames(NamedTuple):
    """ROS arguments without the global names."""

    namespace: str  #: namespace from a global rule, or '' if there is no such rule
    arguments: list[str]  #: all other arguments, for `rclpy.init`


def without_global_names(arguments: Sequence[str]) -> GlobalNames:
    """Separate a global namespace from the other ROS arguments.

    If the arguments contain several namespaces, the last one is used. A rule that gives all nodes the same name is
    ignored with a warning. Rules for a single node, such as `skin_driver:__ns:=/robot`, are kept.

    Parameters
    ----------
    arguments
        Arguments after `--ros-args`.

    Examples
    --------
    >>> without_global_names(['-r', '__ns:=/robot', '-r', 'grasp:=held', '-p', 'use_sim_time:=true'])
    GlobalNames(namespace='/robot', arguments=['-r', 'grasp:=held', '-p', 'use_sim_time:=true'])
    """
    namespace, rest = '', []
    words = iter(arguments)
    for word in words:
        rule = next(words, None) if word in REMAP else None
        left, _, right = (rule or '').partition(':=')
        if left == NAMESPACE:
            namespace = right
        elif left in NODE_NAME_RULES:
            logger.warning('%s is ignored, because it would give all nodes of this process one name. '
                           'A namespace is allowed.', rule)
        else:
            rest += [word] if rule is None else [word, rule]
    return GlobalNames(namespace, rest)
