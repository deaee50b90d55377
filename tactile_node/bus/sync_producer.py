"""Send SYNC. While a node may be behind, skip SYNCs, so that a free bus proves that no node is behind."""

import logging
from collections.abc import Callable
from math import ceil, inf
from queue import Empty, SimpleQueue

from tactile_node.assembly.free_bus import FREE_TIME
from tactile_node.assembly.health import BusFault
from tactile_node.assembly.router import Router
from tactile_node.assembly.sync_assembler import MOST_LATE
from tactile_node.bus.bus_network import BusNetwork, OnFailure
from tactile_node.bus.can_queue import CanQueue
from tactile_node.bus.pacer import Pacer
from tactile_node.errors import BusError

logger = logging.getLogger(__name__)

PAUSE_SPACING = 4  #: Number of SYNCs sent between two pauses.


class SyncPause:
    """Decides which SYNCs to skip while a node may be behind.

    Parameters
    ----------
    period : float
        Time between two SYNCs [s].

    Attributes
    ----------
    count : int
        Number of SYNCs skipped.

    Examples
    --------
    >>> pause = SyncPause(period=0.02)
    >>> [pause.is_due(doubt) for doubt in (False, True, True, True, True, False, False, True)]
    [False, True, True, True, False, False, False, False]
    """

    def __init__(self, period: float):
        # A pause lasts two periods for the waiting sweeps, plus the free time. The driver's measurement of the free
        # time may be up to 2 ms too short.
        self._length = 2 + ceil((FREE_TIME + 2e-3) / period)
        self.count = 0
        self.restart()

    def restart(self) -> None:
        """Forget the last pause, because SYNC was switched off."""
        self._since = PAUSE_SPACING  # SYNCs sent since the last pause
        self._left = 0  # SYNCs still to skip

    def is_due(self, is_in_doubt: bool) -> bool:
        """Return True if the SYNC that is now due must be skipped.

        Parameters
        ----------
        is_in_doubt : bool
            True while the driver does not know which SYNC a node is answering.
        """
        if not is_in_doubt:
            self._left = 0
        elif not self._left and self._since >= PAUSE_SPACING:
            self._left = self._length
            self._since = 0
        if self._left:
            self._left -= 1
            self.count += 1
            return True
        self._since += 1
        return False


class SyncProducer(Pacer):
    """Thread that sends SYNC once per period, and begins each period on the chain.

    Parameters
    ----------
    period : float
        Time between two SYNCs [s].
    can_id : int
        COB-ID of SYNC.
    network : callable
        Function that returns the open bus. The function raises BusError if the bus is not open.
    queue : CanQueue
        Queue of the bus, with the chain and the clock that stamps SYNC.
    router : Router
        Router that the chain feeds.
    on_failure : callable
        Function that is called with a `BusFault` and the exception if a SYNC cannot be sent, or if an exception ends
        the thread.

    Attributes
    ----------
    sent : int
        Number of SYNCs since construction, including those that could not be sent.
    pause : SyncPause
        Rule that skips SYNCs.
    """

    def __init__(self, period: float, can_id: int, network: Callable[[], BusNetwork], queue: CanQueue, router: Router,
                 on_failure: OnFailure):
        super().__init__(period, self.send, 'sync', lambda error: on_failure(BusFault.INTERNAL_ERROR, error))
        self._can_id = can_id
        self._network = network
        self._queue = queue
        self._router = router
        self._on_failure = on_failure
        self._jumps_reported = 0
        self.sent = 0
        self.pause = SyncPause(period)

    def send(self) -> None:
        """Send a SYNC, unless it must be skipped so that the bus becomes free (`SyncPause`).

        The SYNC is posted to the chain before it is sent on the bus, so no TPDO can overtake it. The chain
        receives the start and the end of the write, because the SYNC was on the bus at some time in between.
        """
        if self.pause.is_due(self._router.is_in_doubt):
            return
        clock, chain = self._queue.clock, self._queue.chain
        written: SimpleQueue[float] = SimpleQueue()

        def announce() -> float:
            stamp = clock.now()
            chain.post(self._begin_period, stamp, written)
            return stamp - clock.ahead
        try:
            network = self._network()
            self.sent += 1
            network.send_message(self._can_id, b'', announce=announce)
        except BusError as error:
            self._on_failure(BusFault.SENDING_FAILED, error)
        finally:
            written.put(clock.now())
        if clock.jumps != self._jumps_reported:
            self._report_jump()

    def _begin_period(self, stamp: float, written: SimpleQueue[float]) -> None:
        """Begin a period, on the chain thread.

        The thread first waits until the SYNC has been written, because answers must not be used before the delay of the
        SYNC is known. The answers to a SYNC that takes longer than MOST_LATE are not used, so the thread waits no
        longer.
        """
        try:
            late = written.get(timeout=MOST_LATE) - stamp
        except Empty:
            late = inf
        self._router.sync(stamp, late)

    def _report_jump(self) -> None:
        clock = self._queue.clock
        self._jumps_reported = clock.jumps
        if clock.ahead:
            logger.error('The wall clock was set. Stamps never go back, so they continue %.3f s ahead of the wall '
                         'clock. To use the new time, deactivate and activate the driver.', clock.ahead)
        else:
            logger.error('The wall clock was set, and the stamps follow it.')
