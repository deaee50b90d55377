"""The newest state of each pad: what is not looked at in time is replaced, never queued."""

import threading
import time
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tactile_node.view.states import BusFacts, PadState

HISTORY = 20.0  #: of the force [s]
MOST_POINTS = 600  #: of the force of a pad


class Shown(NamedTuple):
    """All that a page needs, at one moment."""

    version: int                     #: grows with every change
    pads: dict[str, PadState | None]  #: None: nothing has come from it
    bus: BusFacts | None
    bus_acquired: float              #: when these facts were true, by the steady clock [s]
    problem: str                     #: why the source gives nothing, '' while it does


class Store:
    """Keeps the newest state of each of ``pads``, and the force over the last HISTORY seconds."""

    def __init__(self, pads: Sequence[str]):
        self._changed = threading.Condition()
        self._version = 0
        self._pads: dict[str, PadState | None] = dict.fromkeys(pads)
        self._forces: dict[str, deque[tuple[float, float]]] = {pad: deque(maxlen=MOST_POINTS) for pad in pads}
        self._bus: BusFacts | None = None
        self._bus_acquired = 0.0
        self._problem = ''
        self._is_closed = False

    @property
    def pads(self) -> tuple[str, ...]:
        return tuple(self._pads)

    def put(self, state: PadState) -> None:
        """Replace the state of its pad; one that is older than that begins the force's history again."""
        with self._changed:
            self._pads[state.pad] = state
            forces = self._forces[state.pad]
            if forces and not 0 <= state.stamp - forces[-1][0] < HISTORY:
                forces.clear()
            forces.append((state.stamp, float('nan') if state.contact is None else state.contact.force))
            self._notify()

    def put_bus(self, facts: BusFacts | None, age: float = 0.0) -> None:
        """``age``: of the facts now [s]."""
        with self._changed:
            self._bus, self._bus_acquired = facts, time.monotonic() - age
            self._notify()

    def put_problem(self, problem: str) -> None:
        with self._changed:
            self._problem = problem
            self._notify()

    def forget(self, pad: str) -> None:
        """Nothing is known of a pad, as before its first frame."""
        with self._changed:
            if self._pads[pad] is not None:
                self._pads[pad] = None
                self._forces[pad].clear()
                self._notify()

    def clear(self) -> None:
        """Forget all: what was seen before a source was stopped is not shown as if it were there."""
        with self._changed:
            self._pads = dict.fromkeys(self._pads)
            for forces in self._forces.values():
                forces.clear()
            self._bus, self._problem = None, ''
            self._notify()

    def close(self) -> None:
        """Let no one wait any longer."""
        with self._changed:
            self._is_closed = True
            self._notify()

    def shown(self) -> Shown:
        with self._changed:
            return Shown(self._version, dict(self._pads), self._bus, self._bus_acquired, self._problem)

    def wait(self, version: int, timeout: float) -> None:
        """Return when there is something newer than ``version``, or after ``timeout`` [s]."""
        with self._changed:
            self._changed.wait_for(lambda: self._version > version or self._is_closed, timeout)

    def forces(self, pad: str) -> np.ndarray:
        """Return stamps [s] and forces [N] of the last HISTORY seconds, shape (2, n)."""
        with self._changed:
            points = np.array(self._forces[pad], float).reshape(-1, 2)
        return points[points[:, 0] > points[-1:, 0].sum() - HISTORY].T

    def _notify(self) -> None:
        self._version += 1
        self._changed.notify_all()
