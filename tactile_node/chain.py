"""The chain thread of a process, which takes each CAN frame or message through all its processing stages.

All state of the stages belongs to this thread. Other threads, for example those that receive CAN frames or call
services, post calls to the chain. The chain runs the calls in order, each between two taxel frames.
"""

import heapq
import itertools
import threading
from collections.abc import Callable
from enum import IntEnum
from queue import SimpleQueue

from tactile_node.threads import ReportedThread, call_guarded

Call = tuple[Callable[..., object], tuple[object, ...]]

#: Largest difference between the acquisition times of pads that answer the same SYNC [s]. The driver reads the clocks
#: separately for each pad.
SAME_SYNC = 0.002


class Step(IntEnum):
    """Steps that the chain postpones, in the order in which they run for the taxels of one SYNC."""

    FIND = 0       #: find the contacts in a taxel frame
    RECOGNISE = 1  #: recognise the shape of a contact
    COMBINE = 2    #: publish a result that combines several pads
    SHOW = 3       #: publish what only viewers need


class Chain:
    """A thread that runs posted calls in order, and takes turns between them and postponed steps.

    In each turn, the chain runs the posted calls that are waiting, then every FIND, and then the RECOGNISE, COMBINE or
    SHOW with the oldest taxels. Calls that are posted in the meantime wait for the next turn. A slow machine therefore
    assembles every frame, and a flood of frames cannot stop the recognition.

    A call that raises an exception is logged with its traceback. The chain then continues with the next call.

    Parameters
    ----------
    name : str
        Name of the thread.

    Examples
    --------
    >>> chain, order = Chain(), []
    >>> def find():
    ...     chain.postpone(Step.RECOGNISE, 0.0, order.append, 'recognised')
    ...     order.append('found')
    >>> chain.start()
    >>> chain.post(lambda: chain.postpone(Step.FIND, 0.0, find))
    >>> chain.wait_until_idle(timeout=60.0)
    True
    >>> order
    ['found', 'recognised']
    >>> chain.stop(timeout=60.0)
    """

    def __init__(self, name: str = 'chain'):
        self._name = name
        self._calls: SimpleQueue[Call | None] = SimpleQueue()
        # heap of the order of the calls: every FIND first, then the oldest taxels, then the earlier step, then the call
        # that was postponed first; only the chain thread uses it. The taxels of a COMBINE or a SHOW count as newer by
        # SAME_SYNC.
        self._postponed: list[tuple[bool, float, Step, int, Call]] = []
        self._number = itertools.count()
        self._thread: threading.Thread | None = None

    @property
    def is_current(self) -> bool:
        """True if the caller runs on the chain thread."""
        return self._thread is threading.current_thread()

    def start(self) -> None:
        """Start the thread with an empty queue. If the previous thread is blocked in a call, it ends after the call."""
        self._calls = SimpleQueue()
        self._postponed = []
        self._thread = ReportedThread(self._run, self._name, self._calls)
        self._thread.start()

    def stop(self, timeout: float) -> None:
        """End the thread after all calls posted so far, and wait up to ``timeout`` [s] for it to end."""
        self._calls.put(None)
        if self._thread is not None and not self.is_current:
            self._thread.join(timeout)

    def post(self, call: Callable[..., object], *args: object) -> None:
        """Run a call after all calls posted so far. Any thread may post, and the method returns immediately.

        Parameters
        ----------
        call : callable
            Function to call.
        *args
            Its arguments.
        """
        self._calls.put((call, args))

    def postpone(self, step: Step, acquired: float, call: Callable[..., object], *args: object) -> None:
        """Run a call in a later step of this turn or of a later turn. Only the chain thread may postpone.

        The calls for the oldest taxels run first. The shapes of all pads for one SYNC therefore come before the COMBINE
        and the SHOW of these pads, which come before the shapes for the next SYNC.

        Parameters
        ----------
        step : Step
            Step to which the call belongs.
        acquired : float
            Time when the taxels were acquired [s].
        call : callable
            Function to call.
        *args
            Its arguments.
        """
        due = acquired + SAME_SYNC if step in (Step.COMBINE, Step.SHOW) else acquired
        heapq.heappush(self._postponed, (step is not Step.FIND, due, step, next(self._number), (call, args)))

    def wait_until_idle(self, timeout: float, *, with_postponed: bool = True) -> bool:
        """Wait until all calls posted so far, and everything that they postpone, have run.

        On the chain thread, or while the chain does not run, the method returns immediately.

        Parameters
        ----------
        timeout : float
            Longest wait [s].
        with_postponed : bool
            False to wait only for the posted calls and every FIND.

        Returns
        -------
        bool
            False if the time has passed before the chain was idle.
        """
        if self._thread is None or self.is_current or not self._thread.is_alive():
            return True
        is_idle = threading.Event()
        if with_postponed:
            self.post(self.postpone, Step.SHOW, float('inf'), is_idle.set)
        else:
            self.post(self.postpone, Step.FIND, float('inf'), is_idle.set)
        return is_idle.wait(timeout)

    def _run(self, calls: 'SimpleQueue[Call | None]') -> None:
        while calls is self._calls:
            # If nothing is postponed, block until the next call. Otherwise take only the calls that are waiting now.
            for _ in range(calls.qsize() if self._postponed else max(calls.qsize(), 1)):
                posted = calls.get()
                if posted is None or calls is not self._calls:
                    return
                call, args = posted
                call_guarded(call, *args)
            is_find = True
            while self._postponed and is_find:
                _, _, step, _, (call, args) = heapq.heappop(self._postponed)
                call_guarded(call, *args)
                is_find = step is Step.FIND
