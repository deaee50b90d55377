"""Starts what must run on the host with the CAN adapter: the driver, with its conditioning of the taxels.

perception.launch.py starts the other nodes, on this host or on another (docs/launch.md, Two hosts).
"""

from functools import partial

from launch import LaunchDescription
from tactile_node.launching.processes import launch_description, start_side
from tactile_node.node_graph import Side


def generate_launch_description() -> LaunchDescription:
    return launch_description(Side.BUS, __file__, partial(start_side, Side.BUS))
