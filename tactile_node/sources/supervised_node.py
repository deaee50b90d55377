"""Supervise one CANopen node: observe the node, log its faults, and carry out the actions that recover the node."""

import logging
import time

from tactile_node.assembly.facts import NodeFacts, PadFacts
from tactile_node.assembly.fault_text import node_label, reaction_text
from tactile_node.assembly.health import Failure, NodeFault
from tactile_node.bus.log_throttle import LogThrottle
from tactile_node.bus.skin_bus import SkinBus
from tactile_node.errors import (
    BusError,
    DeviceAbsentError,
    DeviceError,
    InterruptedSetupError,
    TwoDevicesError,
    UnverifiedDeviceError,
)
from tactile_node.sources.bus_watch import BusCounts
from tactile_node.sources.node_monitor import NodeMonitor
from tactile_node.sources.node_state import RECOVERY, Action, NodeEvent, NodeSeen, NodeState, step

logger = logging.getLogger(__name__)

SETUP_TRIES = 3  #: number of tries at the start, because a device may restart during its configuration
ANSWER_TIME = 0.3  #: time allowed for the first answer of a device during a recovery [s]


class SupervisedNode:
    """One node with its observations (`NodeMonitor`) and its state (`NodeState`).

    Only one thread at a time may use a node, but any thread may call ``facts``.

    Parameters
    ----------
    bus
        Bus of the node.
    monitor
        Monitor of the node.
    recover
        True to recover the node from faults, False to only log its faults.
    """

    def __init__(self, bus: SkinBus, monitor: NodeMonitor, recover: bool):
        self.monitor = monitor
        self.pad = monitor.node.pad
        self.node_id = monitor.node.node_id
        self._bus = bus
        self._recover = recover
        self._state = NodeState()
        self._actions: tuple[Action, ...] = ()  # actions that are due since the last event
        self._emergencies_reported = 0
        self._emergency_throttle = LogThrottle()
        self._fault_throttle = LogThrottle()
        self._retry_throttle = LogThrottle()

    def facts(self, now: float) -> NodeFacts:
        return self.monitor.facts(now, self._state)

    def handle(self, event: NodeSeen | Failure | NodeEvent, now: float) -> None:
        """Update the state and the actions that are due. ``event`` occurred at ``now`` [s]."""
        self._state, self._actions = step(self._state, event, now)

    def configure(self, timeout: float) -> DeviceAbsentError | None:
        """Configure the node at the start. Return the error if the node does not answer.

        Parameters
        ----------
        timeout
            Time allowed for the first answer of the node [s].

        Raises
        ------
        DeviceError
            Raised if the node refuses the configuration.
        BusError
            Raised if the bus fails.
        """
        try:
            for _ in range(SETUP_TRIES):
                self._configure(timeout)
                if self.monitor.trust.is_trusted:
                    break
        except DeviceAbsentError as error:
            return error
        return None

    def look(self, now: float, is_active: bool, pad: PadFacts, bus: BusCounts) -> bool:
        """Observe the node, log its faults and the ends of its outages, and return True if a recovery is due.

        The arguments are those of `NodeMonitor.look`.
        """
        self._log_emergency(now)
        before = self._state
        self.handle(self.monitor.look(now, is_active, pad, bus), now)
        state = self._state
        if before.outages.current is not None and state.outages.current is None:
            logger.info('%s %s again after %.2f s. Cause of the outage: %s.',
                        node_label(self.pad, self.node_id), 'gives taxels' if is_active else 'is ready',
                        state.outages.seconds - before.outages.seconds, state.outages.cause)
        if state.retried is NodeFault.NONE:
            self.monitor.device_errors = None
            self._fault_throttle.reset()
        if state.fault in RECOVERY and self._fault_throttle.is_due(state.fault.name, now):
            reaction = f' {reaction_text(state.fault)}' if self._recover else ''
            logger.error('%s%s', self.facts(now).fault_text, reaction, extra={'fact': state.fault})
        return self._recover and bool(self._actions)

    def recover(self) -> None:
        """Carry out the actions that are due. If one action fails, log the reason and leave out the other actions."""
        is_sending = Action.CHECK in self._actions
        try:
            for action in self._actions:
                self._carry_out(action, is_sending)
        except InterruptedSetupError:
            pass
        except TwoDevicesError as error:
            self.monitor.senders.see_two(time.monotonic())
            if self._retry_throttle.is_due(type(error).__name__, time.monotonic()):
                logger.error('%s', error, extra={'fact': error})
        except (DeviceError, BusError) as error:
            if isinstance(error, UnverifiedDeviceError):
                self.monitor.trust.end()
            self.monitor.refuses_check = isinstance(error, DeviceError) and is_sending
            is_news = self._state.fault is not NodeFault.SILENT
            if is_news and self._retry_throttle.is_due(str(error), time.monotonic()):
                logger.error('Waiting for node %d: %s', self.node_id, self._explained(error), extra={'fact': error})
        self.handle(NodeEvent.ATTEMPTED, time.monotonic())

    def _explained(self, error: DeviceError | BusError) -> DeviceError | BusError:
        """Return ``error``, without advice about the wiring if this process may have been too slow for an answer."""
        if not (isinstance(error, DeviceAbsentError) and self.monitor.is_overloaded):
            return error
        return DeviceAbsentError(error.where, expected=error.expected,
                                 got=f'{error.got} while this process is overloaded',
                                 remedy='Reduce the load of this machine first: the answer may have arrived too late.')

    def _carry_out(self, action: Action, is_sending: bool) -> None:
        match action:
            case Action.CONFIGURE:
                self._configure(ANSWER_TIME)
            case Action.CHECK:
                self._configure(ANSWER_TIME, pause=False)
            case Action.START:
                self._bus.start_node(self.monitor.node, was_silent=not is_sending)
                self.monitor.commanded(time.monotonic(), self._bus.facts().pad(self.pad))
            case Action.READ_ERRORS:
                self._read_errors()

    def _configure(self, timeout: float, pause: bool = True) -> None:
        setup = self.monitor.trust.setup
        as_set = self._bus.configure_node(self.monitor.node, timeout, pause)
        self.monitor.configured(setup, time.monotonic(), as_set)

    def _read_errors(self) -> None:
        before, errors = self.monitor.device_errors, self._bus.devices.read_errors(self.monitor.node)
        self.monitor.device_errors = errors
        if errors != before:
            logger.error('%s', self.facts(time.monotonic()).fault_text, extra={'fact': errors})

    def _log_emergency(self, now: float) -> None:
        facts = self.facts(now)
        if facts.emcy_count != self._emergencies_reported and self._emergency_throttle.is_due('EMCY', now):
            self._emergencies_reported = facts.emcy_count
            logger.error('%s', facts.emcy_text, extra={'fact': facts.emcy_last})
