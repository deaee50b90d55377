"""Detects the fault of one CANopen node by what is received of it. Times are of the monotonic clock [s]."""

from collections.abc import Sequence
from typing import NamedTuple

from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.cia301.nmt import NmtState
from tactile_node.frames.health import Failure, NodeFault, NodeHealth
from tactile_node.frames.losses import PadStatistics
from tactile_node.frames.taxel_frame import TaxelFrame
from tactile_node.skin.layout import DomainLayout, TpdoLayout
from tactile_node.skin.pads import CanopenNode
from tactile_node.supervision.outage import Backoff, OutageClock
from tactile_node.threads.reminder import Reminder

PAUSES = 5  # of a node without SYNC: so many sweeps or event timers without a TPDO are a fault
GRACE = 0.3  # s a node has to obey a command and to report it: three heartbeats


class Setup(NamedTuple):
    """Counts of what changes a node's configuration: while they stay, so does what was written."""

    boots: int           #: boot-up messages
    foreign_writes: int  #: of another master


class NodeMonitor:
    """One node of a pad: its fault now, its outages and the attempts to end them. Used by one thread at a time.

    ``health`` may be called from any thread.
    """

    def __init__(self, node: CanopenNode, monitor: BusMonitor, heartbeat_timeout: float, data_timeout: float,
                 grace: float = GRACE):
        self._grace = grace
        self.node = node
        self._monitor = monitor
        self._heartbeats = monitor.heartbeats
        self.set_timeouts(heartbeat_timeout, data_timeout)
        self.outage: OutageClock[Failure | NodeFault] = OutageClock()
        self.backoff = Backoff()
        self.fault_reminder = Reminder()
        self.retry_reminder = Reminder()
        self._emergency_reminder = Reminder()
        self.fault = NodeFault.NOT_KNOWN
        self.distrusted = 0  #: taxel frames given without values, because the node was not configured
        self._emergencies_reported = 0
        self._configured: Setup | None = None
        self.trusted_from = 0.0  #: what it sent before may mean something else
        self._since = 0.0  # when the bus was opened
        self._commanded = 0.0
        self._sync_at = 0.0
        self.data_at = 0.0  #: when the last taxels were received
        self._used = 0  # TPDOs, by the last detection
        self._used_then = 0  # TPDOs, by the last command
        self._syncs = 0
        self._last_fault = NodeFault.NONE

    def set_timeouts(self, heartbeat: float, data: float) -> None:
        """How long it may be silent [s]."""
        self._heartbeat_timeout = heartbeat
        event = self.node.layout.event_driven
        self._data_timeout = data if event is None else max(data, PAUSES * event.longest_pause)

    @property
    def boots(self) -> int:
        return self._heartbeats.boots(self.node.node_id)

    @property
    def setup(self) -> Setup:
        """What has changed its configuration so far."""
        return Setup(self.boots, self._monitor.foreign_writes[self.node.node_id])

    @property
    def is_trusted(self) -> bool:
        """Its TPDOs mean what the layout says: since it was configured it has not started again, nor been changed."""
        return self._configured == self.setup

    def untrusted(self, frame: TaxelFrame, acquired: float) -> Sequence[TpdoLayout | DomainLayout]:
        """Its TPDOs, or DOMAIN, whose values in ``frame``, acquired then, may mean something else."""
        carriers, ages = self.node.layout.carriers, frame.tpdo_ages
        if ages is None or not self.is_trusted:
            return () if self.is_trusted and acquired >= self.trusted_from else carriers
        return [carrier for carrier in carriers
                if carrier.taxels and acquired - ages.of(*carrier.taxels[0][:2]) < self.trusted_from]

    def expect(self, now: float) -> None:
        """The bus was opened: from now on the node should send, and has to be configured."""
        self._since = now
        self._configured = None
        self.backoff.reset()

    def configured(self, setup: Setup, now: float) -> None:
        """It was configured, from the state ``setup`` on, and that is done ``now``."""
        if not self.is_trusted:
            self.trusted_from = now
        self._configured = setup

    def commanded(self, now: float, pad: PadStatistics) -> None:
        """It was started, or its taxels are expected from now on for another reason."""
        self._commanded = now
        self.data_at = now
        self._sync_at = now
        self._used_then = pad.used_by_node[self.node.position]

    def detect(self, now: float, is_active: bool, pad: PadStatistics, syncs: int) -> NodeFault:
        """The node's fault now, by its heartbeat, its TPDOs used and the SYNCs so far."""
        used = pad.used_by_node[self.node.position]
        if used != self._used:
            self._used = used
            self.data_at = now
        if syncs != self._syncs:
            self._syncs = syncs
            self._sync_at = now
        self.fault = self._detected(now, is_active)
        if self.fault.is_fault and self.fault is not self._last_fault:
            self._last_fault = self.fault
            self.backoff.reset()
        return self.fault

    def recovered(self) -> None:
        """The node works: the next fault is a new one."""
        self._last_fault = NodeFault.NONE
        self.backoff.reset()
        self.fault_reminder.reset()

    def has_taxels_again(self, pad: PadStatistics) -> bool:
        """Taxels were given as valid since the last command."""
        return pad.used_by_node[self.node.position] > self._used_then

    def is_emergency_due(self, now: float) -> bool:
        """Whether an EMCY is to be reported now, and note that it is: they are reported ever more rarely."""
        count = self._monitor.emergencies[self.node.node_id].count
        if count == self._emergencies_reported or not self._emergency_reminder.is_due('EMCY', now):
            return False
        self._emergencies_reported = count
        return True

    def health(self, now: float) -> NodeHealth:
        node_id = self.node.node_id
        state, heard = self._heartbeats.state(node_id), self._heartbeats.heard(node_id)
        emergencies = self._monitor.emergencies[node_id]
        fault, outages = self.fault, self.outage.outages(now)
        if not fault.is_fault and outages.current is not None:
            fault = NodeFault.AWAITING_TAXELS
        return NodeHealth(
            node_id=node_id, state=state,
            is_operational=state == NmtState.OPERATIONAL and not self._is_silent(now),
            heartbeat_age=None if heard is None else now - heard, fault=fault, boots=self.boots,
            emergencies=emergencies.count, last_emergency=emergencies.last, outages=outages,
            distrusted=self.distrusted)

    def _is_silent(self, now: float) -> bool:
        return now - max(self._heartbeats.heard(self.node.node_id) or 0.0, self._since) > self._heartbeat_timeout

    def _detected(self, now: float, is_active: bool) -> NodeFault:
        is_silent = self._is_silent(now)
        if not self.is_trusted and is_silent:
            return NodeFault.SILENT
        if not self.is_trusted:
            if self._configured is None:
                return NodeFault.UNCONFIGURED
            return NodeFault.RECONFIGURED if self._configured.boots == self.boots else NodeFault.BOOTED
        has_data = is_active and now - self.data_at <= self._data_timeout
        if is_silent:
            return NodeFault.NO_HEARTBEAT if has_data else NodeFault.SILENT
        if not is_active or now - self._commanded < self._grace:
            return NodeFault.NONE
        if self._heartbeats.state(self.node.node_id) != NmtState.OPERATIONAL:
            return NodeFault.NOT_OPERATIONAL
        if has_data:
            return NodeFault.NONE
        is_sync_missing = self.node.layout.needs_sync and now - self._sync_at > self._data_timeout
        return NodeFault.NO_SYNC if is_sync_missing else NodeFault.NO_TAXELS
