"""Configure the nodes of a bus and log their faults. After a fault, reconfigure and restart the node."""

import logging
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from tactile_node.assembly.fault_text import emergency_text, failure_text, node_label, node_text, reaction_text
from tactile_node.assembly.frame_source import BusStatistics, PadStatistics
from tactile_node.assembly.health import NodeFault
from tactile_node.bus.skin_bus import SkinBus
from tactile_node.errors import (
    BusError,
    DeviceAbsentError,
    DeviceError,
    InterruptedSetupError,
    TwoDevicesError,
    UnverifiedDeviceError,
)
from tactile_node.sources.node_monitor import NodeMonitor
from tactile_node.sources.node_traffic import BusCounts

logger = logging.getLogger(__name__)

Result = TypeVar('Result')

NOT_TO_BE_CONFIGURED = (NodeFault.NOT_OPERATIONAL, NodeFault.NO_SYNC)  #: faults that do not require a new configuration
WAITED_FOR = (NodeFault.NO_SYNC, NodeFault.TWO_SENDERS)  #: faults that no request to the node can clear


class NodeRecovery:
    """Configures and recovers the nodes of a bus. Only one thread at a time may use this class.

    Nodes are configured in parallel. An SDO transfer spends most of its time waiting for the device, and an absent
    device must not delay other devices.

    Parameters
    ----------
    bus
        Bus of the nodes.
    monitors
        Monitors of the nodes.
    is_enabled
        True to recover from faults, False to only log faults.
    """

    def __init__(self, bus: SkinBus, monitors: Sequence[NodeMonitor], is_enabled: bool):
        self._bus = bus
        self._monitors = monitors
        self._is_enabled = is_enabled

    def configure(self, timeout: float) -> None:
        """Configure all nodes.

        If recovery is enabled and at least one node answers, `attend` will configure the absent nodes later.

        Parameters
        ----------
        timeout
            Time allowed for each node to answer [s].

        Raises
        ------
        DeviceError
            Raised if a node is absent or refuses the configuration.
        BusError
            Raised if the bus fails.
        """
        found = _at_once(self._monitors, lambda monitor: self._absence(monitor, timeout))
        absent = [error for error in found if error is not None]
        if absent and (not self._is_enabled or len(absent) == len(self._monitors)):
            raise absent[0]
        for error in absent:
            logger.error('%s The other nodes continue. This node joins when it answers.', error, extra={'fact': error})

    def attend(self, now: float, is_active: bool, statistics: BusStatistics, bus: BusCounts) -> bool:
        """Detect and log the faults of the nodes, and recover from them.

        Parameters
        ----------
        now
            Time up to which all messages have been received [s].
        is_active
            True if the nodes should be OPERATIONAL.
        statistics
            Counts of the pads.
        bus
            Counts of the bus.

        Returns
        -------
        bool
            True if a recovery was attempted.
        """
        due = [monitor for monitor in self._monitors
               if self._is_recovery_due(monitor, now, is_active, statistics.pads[monitor.node.pad], bus)]
        _at_once(due, lambda monitor: self._recover(monitor, is_active))
        return bool(due)

    def _absence(self, monitor: NodeMonitor, timeout: float) -> DeviceAbsentError | None:
        """Configure a node. Return the error if the node does not answer, and raise all other errors."""
        try:
            self._configure(monitor, timeout, 3)  # 3 tries, because a device may restart during configuration
        except DeviceAbsentError as error:
            return error
        return None

    def _is_recovery_due(self, monitor: NodeMonitor, now: float, is_active: bool, pad: PadStatistics,
                         bus: BusCounts) -> bool:
        if monitor.is_emergency_due(now):
            health = monitor.health(now)
            logger.error('%s', emergency_text(monitor.node.pad, health), extra={'fact': health.last_emergency})
        fault = monitor.detect(now, is_active, pad, bus)
        if not fault.is_fault:
            self._end_outage(monitor, is_active, pad, now)
            return False
        if _stops_taxels(fault) and is_active:
            monitor.outage.begin(monitor.data_at, fault)
        if monitor.fault_reminder.is_due(fault.name, now):
            reaction = f' {reaction_text(fault)}' if self._is_enabled else ''
            logger.error('%s%s', node_text(monitor.node.pad, monitor.health(now)), reaction, extra={'fact': fault})
        return self._is_enabled and fault not in WAITED_FOR and monitor.attempts.is_due(now)

    def _end_outage(self, monitor: NodeMonitor, is_active: bool, pad: PadStatistics, now: float) -> None:
        if monitor.outage.is_running:
            if is_active and not monitor.has_taxels_again(pad):
                return
            lasted = monitor.outage.end(now)
            logger.info('%s %s again after %.2f s. Cause of the outage: %s.',
                        node_label(monitor.node.pad, monitor.node.node_id),
                        'gives taxels' if is_active else 'is ready', lasted, failure_text(monitor.outage.cause))
        monitor.recovered(now)

    def _recover(self, monitor: NodeMonitor, is_active: bool) -> None:
        fault = monitor.fault
        pause = _stops_taxels(fault) or monitor.refuses_while_it_sends
        try:
            if fault not in NOT_TO_BE_CONFIGURED:
                self._configure(monitor, 0.3, pause=pause)
            if is_active and (pause or fault is not NodeFault.TPDO_MISSING):
                self._bus.start_node(monitor.node, was_silent=pause)
                monitor.commanded(time.monotonic(), self._bus.statistics().pads[monitor.node.pad])
            if fault is NodeFault.NOT_OPERATIONAL and monitor.attempts.count:
                self._ask_for_errors(monitor)
        except InterruptedSetupError:
            pass
        except TwoDevicesError as error:
            monitor.traffic.see_two(time.monotonic())
            if monitor.retry_reminder.is_due(type(error).__name__, time.monotonic()):
                logger.error('%s', error, extra={'fact': error})
        except (DeviceError, BusError) as error:
            if isinstance(error, UnverifiedDeviceError):
                monitor.distrust()
            monitor.refuses_while_it_sends = isinstance(error, DeviceError) and not pause
            if fault is not NodeFault.SILENT and monitor.retry_reminder.is_due(str(error), time.monotonic()):
                logger.error('Waiting for node %d: %s', monitor.node.node_id, error, extra={'fact': error})
        monitor.attempts.made(time.monotonic())

    def _ask_for_errors(self, monitor: NodeMonitor) -> None:
        """Read and log the errors of a node that does not become OPERATIONAL. Raises BusError."""
        before, monitor.device_errors = monitor.device_errors, self._bus.devices.read_errors(monitor.node)
        if monitor.device_errors != before:
            logger.error('%s', node_text(monitor.node.pad, monitor.health(time.monotonic())),
                         extra={'fact': monitor.device_errors})

    def _configure(self, monitor: NodeMonitor, timeout: float, tries: int = 1, pause: bool = True) -> None:
        """Configure a node. If the node restarts in the meantime, try again, up to ``tries`` times in total."""
        for _ in range(tries):
            setup = monitor.setup
            heartbeat_time = self._bus.configure_node(monitor.node, timeout, pause)
            monitor.configured(setup, time.monotonic(), heartbeat_time)
            if monitor.is_trusted:
                return


def _stops_taxels(fault: NodeFault) -> bool:
    return fault not in (NodeFault.NO_HEARTBEAT, NodeFault.TPDO_MISSING)


def _at_once(monitors: Sequence[NodeMonitor], act: Callable[[NodeMonitor], Result]) -> list[Result]:
    """Call ``act`` for all monitors in parallel. Return the results in order, or raise the first error at the end."""
    if len(monitors) < 2:
        return [act(monitor) for monitor in monitors]
    with ThreadPoolExecutor(len(monitors), 'configure') as pool:
        return list(pool.map(act, monitors))
