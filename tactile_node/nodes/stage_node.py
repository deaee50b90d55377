"""The base class of the nodes on the chain."""

from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from tactile_node.nodes.stage import STOP_TIMEOUT, StageInput, StageOutput, Stages
from tactile_node.nodes.ticker import Ticker


class StageNode(Node):
    """A node on the chain, which ends its inputs, its outputs and its own chain when it is destroyed.

    Parameters
    ----------
    name : str
        Name of the node.
    stages : Stages or None
        Stages of this process, or None if the node runs alone in its process.
    **options
        Keyword arguments for rclpy's ``Node``.
    """

    # These attributes have values before rclpy's constructor, because Kilted calls destroy_node even after a failed
    # constructor.
    _ends: tuple[StageInput | StageOutput, ...] = ()  # inputs and outputs of the stage
    _own: Stages | None = None  # set if the node runs alone in its process
    _tickers: tuple[Ticker, ...] = ()

    def __init__(self, name: str, stages: Stages | None, **options: Any):
        super().__init__(name, **options)
        self._stages = stages or Stages()
        self._own = self._stages if stages is None else None

    def tick(self, period: float, call: Callable[[], None]) -> None:
        """Call a function every ``period`` [s] until the node is destroyed; see `Ticker`."""
        self._tickers += Ticker(self, period, call),

    def end_stage(self) -> None:
        """End all tickers, inputs and outputs, so that no other thread uses the node any more."""
        for ticker in self._tickers:
            ticker.stop()
        for end in self._ends:
            end.end()
        if self._own is not None:
            self._own.chain.stop(STOP_TIMEOUT)
        self._tickers, self._ends, self._own = (), (), None

    def destroy_node(self) -> None:
        """End the stage, and destroy the node."""
        self.end_stage()
        super().destroy_node()
