"""Observe one CANopen node through its messages. Times are from the monotonic clock [s]."""

from math import nan

from tactile_node.assembly.facts import NodeFacts, PadFacts
from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.bus.device_setup import DeviceAsSet
from tactile_node.cia301.emergency import DeviceErrors
from tactile_node.cia301.objects import NmtState
from tactile_node.skin.pads import CanopenNode
from tactile_node.sources.bus_watch import BusCounts
from tactile_node.sources.node_state import NodeSeen, NodeState
from tactile_node.sources.node_trust import NodeTrust, Setup
from tactile_node.sources.sender_watch import SenderWatch

OVERLOAD_PATIENCE = 10  #: factor by which the allowed silence grows while this process is overloaded


class NodeMonitor:
    """Observes one node of a pad: its configuration, heartbeats, TPDOs and errors.

    The monitor decides nothing; `step` decides on the result of `look`. Only the supervisor's thread may use the
    monitor, but any thread may call ``facts``, and the chain calls ``trust.only_trusted``.

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
        self._monitor = monitor
        self._heard = monitor.heartbeats.of(node.node_id)
        self.set_timeouts(heartbeat_timeout, data_timeout)
        self.senders = SenderWatch(node, self._heard)
        self.trust = NodeTrust(node, monitor, self.senders)
        self._as_set = DeviceAsSet()
        self._heartbeat_writes = 0  # number of writes to the heartbeat time by other masters before the configuration
        #: errors that the node reported when it did not become OPERATIONAL
        self.device_errors: DeviceErrors | None = None
        self.refuses_check = False  #: True if the node refuses to be configured while it sends TPDOs
        self._since = 0.0  # time when the bus was opened, or when this process resumed after a stall
        self._excuses = 0  # number of stalls since the last message of the node
        self.is_overloaded = False  #: True if this process was too slow at the last look
        self._commanded = 0.0  # time of the last command
        self._data_at = 0.0  # time when the last taxels were received
        self._used = 0  # number of used TPDOs at the last look
        self._used_then = 0  # number of used TPDOs at the last command
        self._sync_at = 0.0
        self._syncs = 0

    def set_timeouts(self, heartbeat: float, data: float) -> None:
        """Set the maximum times without a heartbeat and without data [s]."""
        self._heartbeat_timeout = heartbeat
        event = self.node.layout.event_driven
        self._data_timeout = data if event is None else max(data, 5 * event.longest_pause)

    @property
    def boots(self) -> int:
        return self._heard.boots

    def expect(self, now: float) -> None:
        """Record that the bus was opened. From now on, the node must be configured and is expected to send."""
        self._since = now
        self.trust.end()
        self.senders.restart(now)

    def configured(self, setup: Setup, now: float, as_set: DeviceAsSet) -> None:
        """Record that the node was configured.

        Parameters
        ----------
        setup
            Event counts when the configuration began.
        now
            Time at which the configuration was complete [s].
        as_set
            Settings of the device after the configuration.
        """
        self.trust.begin(setup, now)
        self._as_set = as_set
        self._heartbeat_writes = self._monitor.heartbeat_writes[self.node.node_id]
        self.refuses_check = False

    def commanded(self, now: float, pad: PadFacts) -> None:
        """Record that taxels are expected from now on, because the node was started or for another reason."""
        self._commanded = now
        self._data_at = now
        self._sync_at = now
        self.senders.expect_tpdos(now)
        self._used_then = pad.used_by_node[self.node.position]

    def look(self, now: float, is_active: bool, pad: PadFacts, bus: BusCounts) -> NodeSeen:
        """Return the observations of the node.

        Parameters
        ----------
        now
            Time up to which all messages have been received [s].
        is_active
            True if the node should be OPERATIONAL.
        pad
            Counts of the pad.
        bus
            Counts of the bus.
        """
        self.is_overloaded = bus.is_overloaded
        self._excuse_silence(bus.ran_again)
        used = pad.used_by_node[self.node.position]
        if used != self._used:
            self._used = used
            self._data_at = now
        if bus.syncs != self._syncs:
            self._syncs = bus.syncs
            self._sync_at = now
        self._look_at_senders(now, is_active, pad, bus)
        silence = now - self._data_at
        return NodeSeen(
            is_active=is_active, setup_fault=self.trust.fault, are_two=self.senders.are_two,
            is_silent=self._is_silent(now), is_operational=self._heard.state == NmtState.OPERATIONAL,
            # a node may take three heartbeat times, but at least 0.3 s, to execute a command and report its new state
            is_executing=now - self._commanded < max(0.3, 3 * (self._as_set.heartbeat_time or 0.0)),
            has_data=silence <= self._data_timeout or self.is_overloaded,
            has_new_data=silence <= self._data_timeout / 2 or self.is_overloaded,
            misses_tpdos=bool(self.senders.missing),
            misses_sync=self.node.layout.needs_sync and now - self._sync_at > self._data_timeout,
            has_taxels_again=used > self._used_then, data_at=self._data_at, refuses_check=self.refuses_check)

    def facts(self, now: float, state: NodeState) -> NodeFacts:
        """Return the observations of the node, together with the fault and the outages in ``state``."""
        heard, emergencies = self._heard.heard, self._monitor.emergencies[self.node.node_id]
        outages = state.outages.until(now)
        return NodeFacts(
            pad=self.node.pad, node_id=self.node.node_id, state=self._heard.state,
            operational=self._heard.state == NmtState.OPERATIONAL and not self._is_silent(now),
            heartbeat_age=nan if heard is None else now - heard, fault=state.fault, boots=self.boots,
            emcy_count=emergencies.count, emcy_last=emergencies.last, emcy_active=emergencies.active,
            outages=outages.count, outage_seconds=outages.seconds, outage_last_reason=outages.cause,
            outage_present_reason=outages.current, frames_distrusted=self.trust.frames_distrusted,
            missing_tpdos=self.senders.missing, surplus_tpdos=self.senders.surplus, tpdo_order=self.senders.order,
            device_errors=self.device_errors, serial_number=self._as_set.serial_number)

    def _look_at_senders(self, now: float, is_active: bool, pad: PadFacts, bus: BusCounts) -> None:
        were_two = self.senders.are_two
        is_known = self._heartbeat_writes == self._monitor.heartbeat_writes[self.node.node_id] and (
            self.trust.is_trusted or were_two)  # a restarted device may have another heartbeat time
        heartbeat_time = self._as_set.heartbeat_time if is_known else None
        self.senders.look(now, is_active, pad, bus, heartbeat_time, self._data_timeout)
        if were_two and not self.senders.are_two:
            self.trust.end()  # it is unknown which of the two devices was configured

    def _excuse_silence(self, ran_again: float) -> None:
        """Ignore silence from before this process resumed, unless there have been many stalls without a message."""
        if ran_again > self._since:
            was_heard = (self._heard.heard or 0.0) > self._since
            self._excuses = 0 if was_heard else self._excuses + 1
            if self._excuses < OVERLOAD_PATIENCE:
                self._since = ran_again

    def _is_silent(self, now: float) -> bool:
        """Return True if the node has been silent for longer than both the timeout and three heartbeat periods."""
        own = self._as_set.heartbeat_time or max(self._heard.intervals or (0.0,))
        allowed = max(self._heartbeat_timeout, 3 * own) * (OVERLOAD_PATIENCE if self.is_overloaded else 1)
        return now - max(self._heard.heard or 0.0, self._since) > allowed
