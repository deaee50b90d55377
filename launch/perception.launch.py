"""Starts what makes shapes and grasps of taxels: processor, classifier and grasp, on any host, without a bus.

bus.launch.py starts the driver, on the host with the CAN adapter (docs/launch.md, Two hosts).
"""

from functools import partial

from launch import LaunchDescription
from tactile_node.launching.processes import launch_description, start_side
from tactile_node.node_graph import Side


def generate_launch_description() -> LaunchDescription:
    return launch_description(Side.PERCEPTION, __file__, partial(start_side, Side.PERCEPTION))
