"""What any source of a view offers, and the newest state of each pad: what is not looked at in time is replaced."""

import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tactile_node.assembly.fault_text import failure_of, failure_text
from tactile_node.viewing.states import BusFacts, GraspFacts, PadState

if TYPE_CHECKING:
    from tactile_node.viewing.bus_source import RecordingSource

FORCE_HISTORY = 20.0  #: of the force [s]
MOST_FORCE_POINTS = 600  #: of the force of a pad


class Shown(NamedTuple):
    """All that a page needs, at one moment."""

    version: int                     #: grows with every change
    pads: Mapping[str, PadState | None]  #: None: nothing has come from it
    bus: BusFacts | None = None
    bus_acquired: float = 0.0        #: when these facts were true, by the steady clock [s]
    grasp: GraspFacts | None = None  #: None: none has come
    problem: str = ''                #: why the source gives nothing, '' while it does


class Store:
    """Keeps the newest state of each of ``pads``, and the force over the last FORCE_HISTORY seconds."""

    def __init__(self, pads: Sequence[str]):
        self._changed = threading.Condition()
        self._shown = Shown(0, dict.fromkeys(pads))
        self._forces: dict[str, deque[tuple[float, float]]] = {pad: deque(maxlen=MOST_FORCE_POINTS) for pad in pads}
        self._is_closed = False

    @property
    def pads(self) -> tuple[str, ...]:
        return tuple(self._forces)

    def put(self, state: PadState) -> None:
        """Replace the state of its pad; one that is older than that begins the force's history again."""
        with self._changed:
            forces = self._forces[state.pad]
            if forces and not 0 <= state.stamp - forces[-1][0] < FORCE_HISTORY:
                forces.clear()
            forces.append((state.stamp, float('nan') if state.contact is None else state.contact.force))
            self._change(pads={**self._shown.pads, state.pad: state})

    def put_bus(self, facts: BusFacts | None, age: float = 0.0) -> None:
        """``age``: of the facts now [s]."""
        self._change(bus=facts, bus_acquired=time.monotonic() - age)

    def put_grasp(self, grasp: GraspFacts) -> None:
        self._change(grasp=grasp)

    def put_problem(self, problem: str) -> None:
        self._change(problem=problem)

    def put_error(self, error: Exception) -> None:
        """Show ``error``, which has ended the source, as its problem."""
        self.put_problem(failure_text(failure_of(error)))

    def forget(self, pad: str) -> None:
        """Nothing is known of a pad, as before its first frame."""
        with self._changed:
            if self._shown.pads[pad] is not None:
                self._forces[pad].clear()
                self._change(pads={**self._shown.pads, pad: None})

    def clear(self) -> None:
        """Forget all: what was seen before a source was stopped is not shown as if it were there."""
        with self._changed:
            for forces in self._forces.values():
                forces.clear()
            self._change(pads=dict.fromkeys(self.pads), bus=None, grasp=None, problem='')

    def close(self) -> None:
        """Let no one wait any longer."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()

    def shown(self) -> Shown:
        return self._shown

    def wait(self, version: int, timeout: float) -> None:
        """Return when there is something newer than ``version``, or after ``timeout`` [s]."""
        with self._changed:
            self._changed.wait_for(lambda: self._shown.version > version or self._is_closed, timeout)

    def forces(self, pad: str) -> np.ndarray:
        """Return stamps [s] and forces [N] of the last FORCE_HISTORY seconds, shape (2, n)."""
        with self._changed:
            points = np.array(self._forces[pad], float).reshape(-1, 2)
        return points[points[:, 0] > points[-1:, 0].sum() - FORCE_HISTORY].T

    def _change(self, **fields: Any) -> None:
        with self._changed:
            self._shown = self._shown._replace(**fields | {'version': self._shown.version + 1})
            self._changed.notify_all()


class ViewSource:
    """Puts what it sees into ``store``, only between `start` and `stop`."""

    title: str
    store: Store
    player: 'RecordingSource | None' = None  #: None: what is shown is live

    def check(self) -> None:
        """Raise TactileError where it cannot be used; called once, before the first start."""

    def start(self) -> None:
        """Begin: somebody looks, `check` has passed. What fails now is shown as the store's problem."""
        raise NotImplementedError

    def stop(self) -> None:
        """Compute nothing: no one looks."""
        raise NotImplementedError

    def close(self) -> None:
        """Release everything; allowed in any state."""
        self.stop()

    def age(self, state: PadState) -> float:
        """Return the time since ``state`` was acquired [s]; in a recording, until the position that is shown."""
        return time.monotonic() - state.acquired
