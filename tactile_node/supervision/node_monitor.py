"""Judges one pad's node by what is heard of it. Times are of the monotonic clock [s]."""

from enum import Enum
from typing import NamedTuple

from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.cia301.nmt import NmtState, state_name
from tactile_node.frames.health import NodeHealth
from tactile_node.frames.losses import PadStatistics
from tactile_node.skin.pads import CanopenNode
from tactile_node.supervision.outage import Backoff, OutageClock
from tactile_node.threads.reminder import Reminder

GRACE = 0.3  # s a node has for obeying and for saying so: three heartbeats


class Ailment(Enum):
    """What can be wrong with a node; the order is that of the judgement."""

    BOOTED = 'it has started anew (power cycle or reset) and is not configured yet'
    UNCONFIGURED = 'it is not configured since the bus was opened'
    SILENT = 'it sends neither heartbeat nor taxels'
    NO_HEARTBEAT = 'it sends taxels but no heartbeat'
    NOT_OPERATIONAL = 'it is not OPERATIONAL'
    NO_SYNC = 'it waits for SYNC, which no other device sends'
    NO_TAXELS = 'it is OPERATIONAL but sends no taxels of use'


class Trouble(NamedTuple):
    ailment: Ailment
    sentence: str

    @property
    def is_outage(self) -> bool:
        """False while taxels come all the same."""
        return self.ailment is not Ailment.NO_HEARTBEAT

    @property
    def needs_configuration(self) -> bool:
        return self.ailment not in (Ailment.NOT_OPERATIONAL, Ailment.NO_SYNC)


class NodeMonitor:
    """One node of a pad: judged, its attempts and outages kept. Fed and asked by one thread."""

    def __init__(self, node: CanopenNode, monitor: BusMonitor, heartbeat_timeout: float, data_timeout: float):
        self.node, self._monitor, self._beats = node, monitor, monitor.heartbeats
        self._heartbeat_timeout, self._data_timeout = heartbeat_timeout, data_timeout
        self.outage, self.backoff, self.reminder = OutageClock(), Backoff(), Reminder()
        self._emergency_reminder, self.mending = Reminder(), Reminder()
        self.trouble: Trouble | None = None
        self.distrusted, self._told = 0, 0
        self._configured_boots: int | None = None
        self._since = self._commanded = self._sync_at = 0.0
        self.data_at = 0.0  #: when taxels last came
        self._used = self._used_then = self._syncs = 0
        self._last_ailment: Ailment | None = None

    def set_timeouts(self, heartbeat: float, data: float) -> None:
        """How long it may be silent [s]."""
        self._heartbeat_timeout, self._data_timeout = heartbeat, data

    @property
    def who(self) -> str:
        return f'Node {self.node.node_id} (pad {self.node.pad!r})'

    @property
    def boots(self) -> int:
        return self._beats.boots(self.node.node_id)

    @property
    def is_trusted(self) -> bool:
        """Its TPDOs mean what the layout says: it has not started anew since it was configured."""
        return self._configured_boots == self.boots

    def expect(self, now: float) -> None:
        """The bus was opened: from now on the node is to be heard, and has to be configured."""
        self._since, self._configured_boots = now, None
        self.backoff.reset()

    def configured(self, boots: int) -> None:
        """It was configured after ``boots`` boot-ups."""
        self._configured_boots = boots

    def commanded(self, now: float, pad: PadStatistics) -> None:
        """It was told to start, or the taxels are to come from now on for another reason."""
        self._commanded = self.data_at = self._sync_at = now
        self._used_then = pad.used_by_node[self.node.position]

    def judge(self, now: float, is_active: bool, pad: PadStatistics, syncs: int) -> Trouble | None:
        """What is wrong with the node now, by its heartbeat, its TPDOs used and the SYNCs so far."""
        if (used := pad.used_by_node[self.node.position]) != self._used:
            self._used, self.data_at = used, now
        if syncs != self._syncs:
            self._syncs, self._sync_at = syncs, now
        ailment = self._ailment(now, is_active)
        if ailment not in (None, self._last_ailment):
            self._last_ailment = ailment
            self.backoff.reset()
        self.trouble = None if ailment is None else Trouble(ailment, self._sentence(ailment, now))
        return self.trouble

    def recovered(self) -> None:
        """All is well again: the next trouble is a new one."""
        self._last_ailment = None
        self.backoff.reset()
        self.reminder.reset()

    def has_taxels_again(self, pad: PadStatistics) -> bool:
        """Taxels were given as valid since the last command."""
        return pad.used_by_node[self.node.position] > self._used_then

    def new_emergency(self, now: float) -> str:
        """The last EMCY as a sentence when there is one to tell, '' otherwise."""
        log = self._monitor.emergencies[self.node.node_id]
        if log.count == self._told or not self._emergency_reminder.is_due('EMCY', now):
            return ''
        self._told = log.count
        return f'{self.who} sends {log.last}; {log.count} EMCY in all.'

    def health(self, now: float) -> NodeHealth:
        node_id = self.node.node_id
        state, heard = self._beats.state(node_id), self._beats.heard(node_id)
        log = self._monitor.emergencies[node_id]
        return NodeHealth(node_id, state_name(state),
                          state == NmtState.OPERATIONAL and not self._is_silent(now),
                          None if heard is None else now - heard, self._telling(),
                          self.boots, log.count, log.last, self.outage.outages(now), self.distrusted)

    def _is_silent(self, now: float) -> bool:
        return now - max(self._beats.heard(self.node.node_id) or 0.0, self._since) > self._heartbeat_timeout

    def _ailment(self, now: float, is_active: bool) -> Ailment | None:
        is_silent = self._is_silent(now)
        if not self.is_trusted and is_silent:
            return Ailment.SILENT
        if not self.is_trusted:
            return Ailment.BOOTED if self._configured_boots is not None else Ailment.UNCONFIGURED
        has_data = is_active and now - self.data_at <= self._data_timeout
        if is_silent:
            return Ailment.NO_HEARTBEAT if has_data else Ailment.SILENT
        if not is_active or now - self._commanded < GRACE:
            return None
        if self._beats.state(self.node.node_id) != NmtState.OPERATIONAL:
            return Ailment.NOT_OPERATIONAL
        if has_data:
            return None
        waits = self.node.layout.needs_sync and now - self._sync_at > self._data_timeout
        return Ailment.NO_SYNC if waits else Ailment.NO_TAXELS

    def _telling(self) -> str:
        if self.trouble is not None:
            return self.trouble.sentence
        return f'{self.who}: waiting for its taxels; {self.outage.reason}.' if self.outage.is_running else ''

    def _sentence(self, ailment: Ailment, now: float) -> str:
        heard = self._beats.heard(self.node.node_id)
        state = state_name(self._beats.state(self.node.node_id))
        last = 'never heard' if heard is None else f'last heard {now - heard:.1f} s ago: {state}'
        return f'{self.who}: {ailment.value} ({last}).'
