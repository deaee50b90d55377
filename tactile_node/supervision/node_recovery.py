"""Configures the nodes of a bus, tells what is wrong with them, and configures and starts those again that need it."""

import logging
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from tactile_node.bus.skin_bus import SkinBus
from tactile_node.errors import BusError, DeviceAbsentError, DeviceError
from tactile_node.frames.losses import BusStatistics, PadStatistics
from tactile_node.supervision.node_monitor import Ailment, NodeMonitor, Trouble

logger = logging.getLogger(__name__)

Result = TypeVar('Result')

FIRST_TRIES = 3  # configurations of a device that boots again meanwhile
REMEDY = ' It is configured and started again.'
REMEDIES = {Ailment.SILENT: ' It is configured and started as soon as it answers.',
            Ailment.NO_SYNC: ' Start that device, or set produce_sync.'}
NO_PATIENCE = 0.3  # s, one SDO request: a device that does not answer now is asked again later


class NodeRecovery:
    """Looks after ``nodes`` of ``bus``; called by one thread at a time. Without ``mends`` all is only judged and told.

    Nodes are configured at once: an SDO dialogue mostly waits for its device, and one that is gone must not hold up
    the others.
    """

    def __init__(self, bus: SkinBus, nodes: Sequence[NodeMonitor], mends: bool):
        self._bus, self._nodes, self._mends = bus, nodes, mends

    def configure(self, patience: float) -> None:
        """Configure all, each found within ``patience`` [s]. Raises DeviceError, BusError.

        Of several that do not answer some may be left for later, unless nothing is mended.
        """
        found = _at_once(self._nodes, lambda node: self._absence(node, patience))
        absent = [error for error in found if error is not None]
        if absent and (not self._mends or len(absent) == len(self._nodes)):
            raise absent[0]
        for error in absent:
            logger.error('%s The others go on without it; it joins when it comes.', error)

    def attend(self, is_active: bool, statistics: BusStatistics, syncs: int) -> None:
        """Judge all by what came up to now, tell, and mend what is due; ``syncs``: SYNCs so far."""
        due = [node for node in self._nodes
               if self._is_to_be_mended(node, is_active, statistics.pads[node.node.pad], syncs)]
        _at_once(due, lambda node: self._mend(node, node.trouble, is_active))

    def _absence(self, node: NodeMonitor, patience: float) -> DeviceAbsentError | None:
        """Configure it; the error when it does not answer. Any other is raised."""
        try:
            self._configure(node, patience, FIRST_TRIES)
        except DeviceAbsentError as error:
            return error
        return None

    def _is_to_be_mended(self, node: NodeMonitor, is_active: bool, pad: PadStatistics, syncs: int) -> bool:
        now = time.monotonic()
        if sentence := node.new_emergency(now):
            logger.error('%s', sentence)
        trouble = node.judge(now, is_active, pad, syncs)
        if trouble is None:
            self._end_outage(node, is_active, pad, now)
            return False
        if trouble.is_outage and is_active:
            node.outage.begin(node.data_at, trouble.ailment.value)
        if node.reminder.is_due(trouble.ailment.value, now):
            logger.error('%s%s', trouble.sentence, REMEDIES.get(trouble.ailment, REMEDY) if self._mends else '')
        return self._mends and trouble.ailment is not Ailment.NO_SYNC and node.backoff.is_due(now)

    def _end_outage(self, node: NodeMonitor, is_active: bool, pad: PadStatistics, now: float) -> None:
        if node.outage.is_running:
            if is_active and not node.has_taxels_again(pad):
                return
            cause, again = node.outage.cause, 'gives taxels' if is_active else 'is ready'
            logger.info('%s %s again after %.2f s; the outage: %s.', node.who, again, node.outage.end(now), cause)
        node.recovered()

    def _mend(self, node: NodeMonitor, trouble: Trouble, is_active: bool) -> None:
        try:
            if trouble.needs_configuration:
                self._configure(node, NO_PATIENCE, pause=trouble.is_outage)
            if is_active:
                self._bus.start_node(node.node, trouble.is_outage)
                node.commanded(time.monotonic(), self._bus.statistics().pads[node.node.pad])
        except (DeviceError, BusError) as error:
            sentence = f'Waiting for node {node.node.node_id}: {error}'
            if trouble.ailment is not Ailment.SILENT and node.mending.is_due(sentence, time.monotonic()):
                logger.error('%s', sentence)
        node.backoff.attempted(time.monotonic())

    def _configure(self, node: NodeMonitor, patience: float, tries: int = 1, pause: bool = True) -> None:
        """Configure a node; when it boots meanwhile, once more, as long as there are tries."""
        for _ in range(tries):
            boots = node.boots
            self._bus.configure_node(node.node, patience, pause)
            node.configured(boots)
            if node.is_trusted:
                return


def _at_once(nodes: Sequence[NodeMonitor], act: Callable[[NodeMonitor], Result]) -> list[Result]:
    """What ``act`` returns of each node, in their order; the first error is raised when all are done."""
    if len(nodes) < 2:
        return [act(node) for node in nodes]
    with ThreadPoolExecutor(len(nodes), 'configure') as pool:
        return list(pool.map(act, nodes))
