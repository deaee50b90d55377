"""What the driver publishes about itself: /diagnostics and `~/status`."""

import threading
import time
from collections.abc import Callable, Hashable, Mapping
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSProfile

from tactile_node.assembly.fault_text import failure_of
from tactile_node.assembly.frame_source import BusStatistics, FrameSource
from tactile_node.assembly.health import BusHealth
from tactile_node.bus.message_pace import ChangePace
from tactile_node.conditioning.conditioned_pad import PadCondition
from tactile_node.errors import TactileError
from tactile_node.nodes.node_health import start_health_timer
from tactile_node.ros.diagnostics import EVALUATED_PERIOD, BusDiagnostics, Finding, diagnostic_array, unconfigured
from tactile_node.ros.qos import STATUS_QOS
from tactile_node.ros.status_message import PrimaryState, status_message
from tactile_skin.msg import SkinStatus

STATE_LOOK_PERIOD = 0.05  # s between two looks at the state: a change is published within it


class DriverState(NamedTuple):
    """``source`` None: the driver is unconfigured, because of ``error`` where there is one."""

    lifecycle: PrimaryState
    source: FrameSource | None = None
    error: TactileError | None = None
    conditions: Mapping[str, PadCondition] = {}


class StatePublisher:
    """Publishes both messages of one state, with one stamp: on a change, see ChangePace, and once a second.

    It lasts as long as the node. The stamp is of the node's clock: with use_sim_time and before the first /clock it
    is 0, and the messages continue all the same.
    """

    def __init__(self, node: Node, look: Callable[[], DriverState]):
        self._node = node
        self._look = look
        self._turn = threading.Lock()  # transitions may be on another thread than the executor
        self._pace = ChangePace()
        self._name = node.get_fully_qualified_name()
        self._findings = BusDiagnostics(self._name, '')
        self._diagnostics = node.create_publisher(DiagnosticArray, '/diagnostics', QoSProfile(depth=10))
        self._status = node.create_publisher(SkinStatus, '~/status', STATUS_QOS)
        start_health_timer(node, self.update, STATE_LOOK_PERIOD)

    def begin(self, hardware_id: str, frame_period: float) -> None:
        """Count from zero again, for a newly configured source that gives a frame each ``frame_period`` [s]."""
        with self._turn:
            self._findings = BusDiagnostics(self._name, hardware_id, max(EVALUATED_PERIOD, 2.5 * frame_period))

    def update(self, *, is_last: bool = False) -> None:
        """Publish the state if that is due; ``is_last``: in any case, since no more will follow."""
        with self._turn:
            state = self._look()
            counts, health = _observed(state)
            if state.source is None:
                findings = unconfigured(health)
            else:
                findings = self._findings.evaluate(counts, health, state.conditions)
            key, now = _key(state, health, findings), time.monotonic()
            if is_last:
                self._pace.note(key, now)
            elif not self._pace.is_due(key, now):
                return
            self._publish(state, counts, health, findings)

    def _publish(self, state: DriverState, counts: BusStatistics, health: BusHealth,
                 findings: tuple[Finding, ...]) -> None:
        if state.source is None:
            message = diagnostic_array(self._name, findings[0], health)
        else:
            message = self._findings.message_of(findings, counts, health, state.conditions)
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._diagnostics.publish(message)
        self._status.publish(status_message(message, counts, health, state.conditions, state.lifecycle))


def _observed(state: DriverState) -> tuple[BusStatistics, BusHealth]:
    if state.source is not None:
        return state.source.statistics(), state.source.health()
    failure = None if state.error is None else failure_of(state.error)
    return BusStatistics({}, {}), BusHealth(failure, is_active=False)


def _key(state: DriverState, health: BusHealth, findings: tuple[Finding, ...]) -> Hashable:
    """Levels, codes and the lifecycle: what a change of is published at once."""
    nodes = tuple((name, node.node_id, node.fault, node.state, node.is_operational)
                  for name, of_pad in health.nodes.items() for node in of_pad)
    pads = tuple((name, condition.zero, condition.is_frozen, condition.faults.kinds.tobytes(),
                  condition.other_publishers)
                 for name, condition in state.conditions.items())
    return (state.lifecycle, health.fault, health.is_active, health.is_error_passive, nodes, pads,
            tuple(finding.level for finding in findings))
