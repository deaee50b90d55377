"""The base class of the nodes on the chain."""

from collections.abc import Callable, Sequence
from typing import Any

from rclpy.node import Node

from tactile_node.node_graph import NODE_NAMES, Role
from tactile_node.nodes.node_health import MessageHealth
from tactile_node.nodes.stage import STOP_TIMEOUT, StageInput, StageOutput, Stages
from tactile_node.nodes.ticker import Ticker
from tactile_node.ros.settings import ReceiverSettings


class StageNode(Node):
    """A node on the chain, which ends its inputs, its outputs and its own chain when it is destroyed.

    Parameters
    ----------
    role : Role
        Task of the node, which determines its name.
    stages : Stages or None
        Stages of this process, or None if the node runs alone in its process.
    **options
        Keyword arguments for rclpy's ``Node``.
    """

    # These attributes have values before rclpy's constructor, because Kilted calls destroy_node even after a failed
    # constructor.
    _ends: tuple[Ticker | StageInput | StageOutput, ...] = ()  # parts of the stage, in the order in which they end
    _own: Stages | None = None  # set if the node runs alone in its process

    def __init__(self, role: Role, stages: Stages | None, **options: Any):
        super().__init__(NODE_NAMES[role], **options)
        self._stages = stages or Stages()
        self._own = self._stages if stages is None else None

    def begin_stage(self, settings: ReceiverSettings, inputs: Sequence[StageInput], *outputs: StageOutput) -> None:
        """Publish the health of the inputs, and end inputs and outputs with the node."""
        self._ends = *inputs, *outputs
        MessageHealth(self, inputs, settings)

    def tick(self, period: float, call: Callable[[], None]) -> None:
        """Call a function every ``period`` [s] until the node is destroyed; see `Ticker`."""
        self._ends = Ticker(self, period, call), *self._ends

    def end_stage(self) -> None:
        """End all tickers, inputs and outputs, so that no other thread uses the node any more."""
        for part in self._ends:
            part.end()
        if self._own is not None:
            self._own.chain.stop(STOP_TIMEOUT)
        self._ends, self._own = (), None

    def destroy_node(self) -> None:
        """End the stage, and destroy the node."""
        self.end_stage()
        super().destroy_node()
