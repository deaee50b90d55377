"""Takes what names every node of a process out of its ROS arguments.

launch_ros passes a namespace, as that of PushRosNamespace, as the rule `-r __ns:=/robot` for the whole process. rcl
applies it to each node and replaces its namespace: of several nodes in one process, `left/processor` and
`right/processor` would both become `/robot/processor`.
"""

import logging
from collections.abc import Sequence
from typing import NamedTuple

logger = logging.getLogger(__name__)

REMAP = ('-r', '--remap')
NAMESPACE, NODE_NAME_RULES = '__ns', ('__node', '__name')


class GlobalNames(NamedTuple):
    """``namespace``: that of a global rule, '' without one; ``arguments``: all others, for `rclpy.init`."""

    namespace: str
    arguments: list[str]


def without_global_names(arguments: Sequence[str]) -> GlobalNames:
    """Split ``arguments``, those after `--ros-args`; the last namespace wins, a name for all nodes is not used.

    Rules of one node, as `skin_driver:__ns:=/robot`, stay.

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
            logger.warning('%s is not used: it would name all nodes of this process. A namespace can be given.', rule)
        else:
            rest += [word] if rule is None else [word, rule]
    return GlobalNames(namespace, rest)
