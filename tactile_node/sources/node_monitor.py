"""Detect the faults of one CANopen node from its messages. Times are from the monotonic clock [s]."""

from collections.abc import Sequence
from typing import NamedTuple

from tactile_node.assembly.frame_source import PadStatistics
from tactile_node.assembly.health import Failure, NodeFault, NodeHealth
from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.bus.message_pace import Reminder
from tactile_node.cia301.emergency import DeviceErrors
from tactile_node.cia301.objects import NmtState
from tactile_node.skin.layout import DomainLayout, TpdoLayout
from tactile_node.skin.pads import CanopenNode
from tactile_node.sources.node_traffic import BusSeen, NodeTraffic
from tactile_node.sources.outage import Attempts, OutageClock
from tactile_node.taxel_frame import TaxelFrame

OVERLOAD_PATIENCE = 10  #: factor by which the allowed silence grows while this process is overloaded


class Setup(NamedTuple):
    """Counts of events that change a node's configuration. Equal counts mean an unchanged configuration."""

    boots: int           #: number of boot-up messages
    foreign_writes: int  #: number of writes by another master


class NodeMonitor:
    """Monitors one node of a pad: its current fault, its outages and the recovery attempts.

    Only one thread at a time may use the monitor, but any thread may call ``health``.

    Parameters
    ----------
    node
        Node to monitor.
    monitor
        Monitor that counts all messages received on the bus.
    heartbeat_timeout
        Maximum time without a heartbeat [s].
    data_timeout
        Maximum time without taxels [s].
    """

    def __init__(self, node: CanopenNode, monitor: BusMonitor, heartbeat_timeout: float, data_timeout: float):
        self.node = node
        self._heartbeat_time: float | None = None  # heartbeat time of the device [s], or None if unknown
        self._heartbeat_writes = 0  # number of writes to the heartbeat time by other masters before the configuration
        self._monitor = monitor
        self._heard = monitor.heartbeats.of(node.node_id)
        self.set_timeouts(heartbeat_timeout, data_timeout)
        self.outage: OutageClock[Failure | NodeFault] = OutageClock()
        self.attempts = Attempts()
        self.fault_reminder = Reminder()
        self.retry_reminder = Reminder()
        self._emergency_reminder = Reminder()
        self.fault = NodeFault.NOT_KNOWN
        #: number of taxel frames emitted without the node's values, because its TPDOs may not have matched the layout
        self.distrusted = 0
        self._emergencies_reported = 0
        self._configured: Setup | None = None
        self.trusted_from = 0.0  #: time before which the node's TPDOs may not match the layout
        self._since = 0.0  # time when the bus was opened, or when this process resumed after a stall
        self._excuses = 0  # number of stalls since the last message of the node
        self._commanded = 0.0  # time of the last command
        self._sync_at = 0.0
        self.data_at = 0.0  #: time when the last taxels were received
        self._used = 0  # number of used TPDOs at the last detection
        self._used_then = 0  # number of used TPDOs at the last command
        self._syncs = 0
        self._is_overloaded = False
        self.traffic = NodeTraffic(node, self._heard)
        #: errors that the node reported when it did not become OPERATIONAL
        self.device_errors: DeviceErrors | None = None
        self.refuses_while_it_sends = False  #: True if the node refuses to be configured while it sends TPDOs

    def set_timeouts(self, heartbeat: float, data: float) -> None:
        """Set the maximum times without a heartbeat and without data [s]."""
        self._heartbeat_timeout = heartbeat
        event = self.node.layout.event_driven
        self._data_timeout = data if event is None else max(data, 5 * event.longest_pause)

    @property
    def boots(self) -> int:
        return self._heard.boots

    @property
    def setup(self) -> Setup:
        """Counts so far of events that change the configuration of the node."""
        return Setup(self.boots, self._monitor.foreign_writes[self.node.node_id])

    @property
    def is_trusted(self) -> bool:
        """True if the TPDOs match the layout, because the node has not restarted or been changed since its setup."""
        return self._configured == self.setup

    def untrusted(self, frame: TaxelFrame, acquired: float) -> Sequence[TpdoLayout | DomainLayout]:
        """Return the node's TPDOs (or its DOMAIN) whose values in ``frame`` may not match the layout."""
        carriers, ages = self.node.layout.carriers, frame.tpdo_ages
        if not self.is_trusted or self.traffic.are_two:
            return carriers
        if ages is None:
            return () if acquired >= self.trusted_from else carriers
        return [carrier for carrier in carriers
                if carrier.taxels and acquired - ages.of(*carrier.taxels[0][:2]) < self.trusted_from]

    def expect(self, now: float) -> None:
        """Record that the bus was opened. From now on, the node must be configured and is expected to send."""
        self._since = now
        self._configured = None
        self.traffic.restart(now)
        self.attempts.reset()

    def configured(self, setup: Setup, now: float, heartbeat_time: float | None) -> None:
        """Record that the node was configured.

        Parameters
        ----------
        setup
            Event counts when the configuration began.
        now
            Time at which the configuration was complete [s].
        heartbeat_time
            Heartbeat time of the device [s], or None if unknown.
        """
        if not self.is_trusted:
            self.trusted_from = now
        self._configured = setup
        self._heartbeat_time = heartbeat_time
        self._heartbeat_writes = self._monitor.heartbeat_writes[self.node.node_id]
        self.refuses_while_it_sends = False

    def distrust(self) -> None:
        """Ignore data from the node until it has been configured, because its TPDOs may not match the layout."""
        self._configured = None

    def commanded(self, now: float, pad: PadStatistics) -> None:
        """Record that taxels are expected from now on, because the node was started or for another reason."""
        self._commanded = now
        self.data_at = now
        self._sync_at = now
        self.traffic.tpdos.expect(now)
        self._used_then = pad.used_by_node[self.node.position]

    def detect(self, now: float, is_active: bool, pad: PadStatistics, bus: BusSeen) -> NodeFault:
        """Detect the current fault of the node from its heartbeats, its TPDOs and the SYNCs so far."""
        self._is_overloaded = bus.is_overloaded
        self._excuse_silence(bus.ran_again)
        used = pad.used_by_node[self.node.position]
        if used != self._used:
            self._used = used
            self.data_at = now
        if bus.syncs != self._syncs:
            self._syncs = bus.syncs
            self._sync_at = now
        were_two = self.traffic.are_two
        is_known = self._heartbeat_writes == self._monitor.heartbeat_writes[self.node.node_id] and (
            self.is_trusted or were_two)  # a restarted device may have another heartbeat time
        self.traffic.look(now, is_active, pad, bus, self._heartbeat_time if is_known else None, self._data_timeout)
        if were_two and not self.traffic.are_two:
            self._configured = None  # it is unknown which of the two devices was configured
        self.fault = self._detected(now, is_active)
        if self.fault.is_fault:
            self.attempts.fault_is(self.fault)
        return self.fault

    def recovered(self, now: float) -> None:
        """Record that the node has no fault."""
        if self.attempts.has_ended(now):
            self.device_errors = None
            self.fault_reminder.reset()

    def has_taxels_again(self, pad: PadStatistics) -> bool:
        """Return True if valid taxels were received since the last command."""
        return pad.used_by_node[self.node.position] > self._used_then

    def is_emergency_due(self, now: float) -> bool:
        """Return True if an EMCY must be reported now, and record the report. The interval between reports grows."""
        count = self._monitor.emergencies[self.node.node_id].count
        if count == self._emergencies_reported or not self._emergency_reminder.is_due('EMCY', now):
            return False
        self._emergencies_reported = count
        return True

    def health(self, now: float) -> NodeHealth:
        node_id = self.node.node_id
        state, heard = self._heard.state, self._heard.heard
        emergencies = self._monitor.emergencies[node_id]
        fault, outages = self.fault, self.outage.outages(now)
        if not fault.is_fault and outages.current is not None:
            fault = NodeFault.AWAITING_TAXELS
        return NodeHealth(
            node_id=node_id, state=state,
            is_operational=state == NmtState.OPERATIONAL and not self._is_silent(now),
            heartbeat_age=None if heard is None else now - heard, fault=fault, boots=self.boots,
            emergencies=emergencies.count, last_emergency=emergencies.last, outages=outages,
            distrusted=self.distrusted, active_emergency=emergencies.active,
            missing_tpdos=self.traffic.missing, surplus_tpdos=self.traffic.surplus, tpdo_order=self.traffic.order,
            device_errors=self.device_errors)

    def _excuse_silence(self, ran_again: float) -> None:
        """Ignore silence from before this process resumed, unless there have been many stalls without a message."""
        if ran_again > self._since:
            was_heard = (self._heard.heard or 0.0) > self._since
            self._excuses = 0 if was_heard else self._excuses + 1
            if self._excuses < OVERLOAD_PATIENCE:
                self._since = ran_again

    def _is_silent(self, now: float) -> bool:
        """Return True if the node has been silent for longer than both the timeout and three heartbeat periods."""
        own = self._heartbeat_time or max(self._heard.intervals or (0.0,))
        allowed = max(self._heartbeat_timeout, 3 * own) * (OVERLOAD_PATIENCE if self._is_overloaded else 1)
        return now - max(self._heard.heard or 0.0, self._since) > allowed

    def _detected(self, now: float, is_active: bool) -> NodeFault:
        is_silent = self._is_silent(now)
        if self.traffic.are_two:
            return NodeFault.TWO_SENDERS
        if not self.is_trusted and is_silent:
            return NodeFault.SILENT
        if not self.is_trusted:
            if self._configured is None:
                return NodeFault.UNCONFIGURED
            return NodeFault.RECONFIGURED if self._configured.boots == self.boots else NodeFault.BOOTED
        has_data = is_active and (now - self.data_at <= self._data_timeout or self._is_overloaded)
        # the heartbeat and the data may have stopped together, so the data must be newer than half the timeout
        if is_silent:
            has_still = now - self.data_at <= self._data_timeout / 2 or self._is_overloaded
            return NodeFault.NO_HEARTBEAT if is_active and has_still else NodeFault.SILENT
        # A node has three heartbeat times, but at least 0.3 s, to execute a command and report its new state.
        if not is_active or now - self._commanded < max(0.3, 3 * (self._heartbeat_time or 0.0)):
            return NodeFault.NONE
        if self._heard.state != NmtState.OPERATIONAL:
            return NodeFault.NOT_OPERATIONAL
        if has_data:
            return NodeFault.TPDO_MISSING if self.traffic.missing else NodeFault.NONE
        is_sync_missing = self.node.layout.needs_sync and now - self._sync_at > self._data_timeout
        return NodeFault.NO_SYNC if is_sync_missing else NodeFault.NO_TAXELS
