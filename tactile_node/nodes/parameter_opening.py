"""The opening of the gripper from a live parameter."""

import math
import time
from collections.abc import Sequence

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from tactile_node.grasp.opening import GapSource, LatestGap, Opening


class ParameterOpening:
    """The live parameter ``gap``, which holds until it is set again; below 0: not known."""

    def __init__(self, node: Node):
        self._latest = LatestGap(GapSource.PARAMETER)
        self._on_parameters([node.get_parameter('gap')])
        node.add_post_set_parameters_callback(self._on_parameters)

    def current(self, now: float) -> Opening:
        return self._latest.current(now)

    def _on_parameters(self, parameters: Sequence[Parameter]) -> None:
        for each in parameters:
            if each.name == 'gap':
                self._latest.set(each.value if each.value >= 0 else math.nan, time.monotonic())


def refuse_a_gap_that_nothing_reads(node: Node, source: str) -> None:
    """Refuse a change of ``gap`` at run time that the ``source`` of the opening would ignore."""
    def check(parameters: Sequence[Parameter]) -> SetParametersResult:
        is_set = any(each.name == 'gap' and each.value >= 0 for each in parameters)
        refused = is_set and source != 'parameter'
        return SetParametersResult(successful=not refused,
                                   reason=f'the opening comes from gap_source {source}' if refused else '')
    node.add_on_set_parameters_callback(check)
