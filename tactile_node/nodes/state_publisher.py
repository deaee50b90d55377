"""Publish the state of the skin driver on /diagnostics and `~/status`."""

import threading
import time
from collections.abc import Callable, Hashable, Mapping
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSProfile

from tactile_node.assembly.facts import BusFacts
from tactile_node.bus.change_pace import ChangePace
from tactile_node.conditioning.conditioned_pad import PadCondition
from tactile_node.nodes.ticker import Ticker
from tactile_node.ros.diagnostics import EVALUATED_PERIOD, BusDiagnostics, Finding
from tactile_node.ros.qos import STATUS_QOS
from tactile_node.ros.status_message import PrimaryState, status_message
from tactile_skin.msg import SkinStatus

STATE_LOOK_PERIOD = 0.05  #: Time between two checks of the state [s], within which a change is published.


class DriverState(NamedTuple):
    """State of the skin driver."""

    lifecycle: PrimaryState
    facts: BusFacts  #: facts about the bus or log; they name no pad while the driver is unconfigured
    conditions: Mapping[str, PadCondition] = {}  #: state of the conditioning by name of the pad


class StatePublisher:
    """Publishes the state on both topics with the same stamp, once a second and at each change (see `ChangePace`).

    The stamp comes from the node's clock. With use_sim_time, the stamp is 0
    until the first message on /clock, but the state is still published.

    Parameters
    ----------
    node : Node
        Node that publishes.
    look : callable
        Function that returns the current state.
    """

    def __init__(self, node: Node, look: Callable[[], DriverState]):
        self._node = node
        self._look = look
        self._turn = threading.Lock()  # transitions and the ticker run on different threads
        self._pace = ChangePace()
        self._name = node.get_fully_qualified_name()
        self._findings = BusDiagnostics(self._name, '')
        self._diagnostics = node.create_publisher(DiagnosticArray, '/diagnostics', QoSProfile(depth=10))
        self._status = node.create_publisher(SkinStatus, '~/status', STATUS_QOS)
        self._ticker = Ticker(node, STATE_LOOK_PERIOD, self.update)

    def end(self) -> None:
        """Publish the last state, and stop publishing. A node whose context is shut down cannot publish any more."""
        self._ticker.end()
        if self._node.context.ok():
            self.update(is_last=True)

    def begin(self, hardware_id: str, frame_period: float) -> None:
        """Restart all counts from zero for a newly configured source.

        Parameters
        ----------
        hardware_id : str
            Identifier of the bus on /diagnostics.
        frame_period : float
            Time between two taxel frames [s].
        """
        with self._turn:
            self._findings = BusDiagnostics(self._name, hardware_id, max(EVALUATED_PERIOD, 2.5 * frame_period))

    def update(self, *, is_last: bool = False) -> None:
        """Publish the state if it is due. Always publish the last state (``is_last``)."""
        with self._turn:
            state = self._look()
            findings = self._findings.evaluate(state.facts, state.conditions)
            key, now = _key(state, findings), time.monotonic()
            if is_last:
                self._pace.note(key, now)
            elif not self._pace.is_due(key, now):
                return
            self._publish(state, findings)

    def _publish(self, state: DriverState, findings: tuple[Finding, ...]) -> None:
        diagnostics = self._findings.message_of(findings, state.facts, state.conditions)
        status = status_message(findings, state.facts, state.conditions, state.lifecycle)
        diagnostics.header.stamp = status.header.stamp = self._node.get_clock().now().to_msg()
        self._diagnostics.publish(diagnostics)
        self._status.publish(status)


def _key(state: DriverState, findings: tuple[Finding, ...]) -> Hashable:
    """Return the fields whose changes are published immediately: levels, codes and the lifecycle state."""
    facts = state.facts
    nodes = tuple((node.pad, node.node_id, node.fault, node.state, node.operational)
                  for pad in facts.pads for node in pad.nodes)
    pads = tuple((name, condition.zero, condition.is_frozen, condition.faults.kinds.tobytes(),
                  condition.other_publishers)
                 for name, condition in state.conditions.items())
    return (state.lifecycle, facts.fault, facts.active, facts.error_passive, nodes, pads,
            tuple(finding.level for finding in findings))
