"""Remove the names that apply to all nodes of a process from its ROS arguments.

launch_ros passes a namespace, such as that of PushRosNamespace, as the rule `-r __ns:=/robot` for the whole process.
rcl applies the rule to each node and replaces the node's namespace. If a process has several nodes, `left/processor`
and `right/processor` would both become `/robot/processor`.
"""

import logging
from collections.abc import Sequence
from typing import NamedTuple

logger = logging.getLogger(__name__)

REMAP = ('-r', '--remap')
NAMESPACE = '__ns'
NODE_NAME_RULES = ('__node', '__name')


class GlobalNames(NamedTuple):
    """ROS arguments without global names."""

    namespace: str  #: namespace from a global rule; '' if there is none
    arguments: list[str]  #: all other arguments, for `rclpy.init`


def without_global_names(arguments: Sequence[str]) -> GlobalNames:
    """Separate a global namespace from the other ROS arguments.

    If there are several namespaces, the last one is used. A name for all nodes is ignored with a warning. Rules for a
    single node, such as `skin_driver:__ns:=/robot`, are kept.

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
            logger.warning('%s is ignored: it would name all nodes of this process. A namespace is allowed.', rule)
        else:
            rest += [word] if rule is None else [word, rule]
    return GlobalNames(namespace, rest)
