"""Interface of a data source for the views, and a store that keeps only the newest state of each pad."""

import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tactile_node.assembly.facts import BusFacts
from tactile_node.assembly.fault_text import failure_of
from tactile_node.viewing.states import GraspFacts, PadState

if TYPE_CHECKING:
    from tactile_node.viewing.recording_source import RecordingSource

FORCE_HISTORY = 20.0  #: length of the force history [s]
MOST_FORCE_POINTS = 600  #: maximum number of points in the force history of a pad


class ViewState(NamedTuple):
    """All data that a page shows at one moment."""

    version: int                     #: version number that increases with every change
    pads: Mapping[str, PadState | None]  #: state by pad name, None before the pad's first frame
    bus: BusFacts | None = None      #: facts about the bus, or a SkinStatus message, which has the same names
    bus_acquired: float = 0.0        #: time of the bus facts, by time.monotonic [s]
    grasp: GraspFacts | None = None  #: latest grasp, or None if none was received
    problem: str = ''                #: reason why the source delivers no data, or '' while it works


class Store:
    """Keeps the newest state of each pad, and its force over the last FORCE_HISTORY seconds."""

    def __init__(self, pads: Sequence[str]):
        self._changed = threading.Condition()
        self._shown = ViewState(0, dict.fromkeys(pads))
        self._forces: dict[str, deque[tuple[float, float]]] = {pad: deque(maxlen=MOST_FORCE_POINTS) for pad in pads}
        self._is_closed = False

    @property
    def pads(self) -> tuple[str, ...]:
        return tuple(self._forces)

    def put(self, state: PadState) -> None:
        """Replace the stored state of the pad. If the stamp goes backwards or jumps, the force history restarts."""
        with self._changed:
            forces = self._forces[state.pad]
            if forces and not 0 <= state.stamp - forces[-1][0] < FORCE_HISTORY:
                forces.clear()
            forces.append((state.stamp, float('nan') if state.contact is None else state.contact.force))
            self._change(pads={**self._shown.pads, state.pad: state})

    def put_bus(self, facts: BusFacts | None, age: float = 0.0) -> None:
        """Replace the facts about the bus, which are ``age`` [s] old."""
        self._change(bus=facts, bus_acquired=time.monotonic() - age)

    def put_grasp(self, grasp: GraspFacts | None) -> None:
        """Replace the grasp, with None if a recording has no grasp at this time."""
        self._change(grasp=grasp)

    def put_problem(self, problem: str) -> None:
        self._change(problem=problem)

    def put_error(self, error: Exception) -> None:
        """Store ``error``, which stopped the source, as the problem to show."""
        self.put_problem(str(failure_of(error)))

    def forget(self, pad: str) -> None:
        """Forget the state of ``pad``, as if no frame had been received."""
        with self._changed:
            if self._shown.pads[pad] is not None:
                self._forces[pad].clear()
                self._change(pads={**self._shown.pads, pad: None})

    def clear(self) -> None:
        """Forget all data, so that they are not shown as current after the source has been stopped."""
        with self._changed:
            for forces in self._forces.values():
                forces.clear()
            self._change(pads=dict.fromkeys(self.pads), bus=None, grasp=None, problem='')

    def close(self) -> None:
        """Wake all waiting threads, and make later calls to `wait` return immediately."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()

    def shown(self) -> ViewState:
        return self._shown

    def wait(self, version: int, timeout: float) -> None:
        """Wait up to ``timeout`` [s] for a version newer than ``version``."""
        with self._changed:
            self._changed.wait_for(lambda: self._shown.version > version or self._is_closed, timeout)

    def forces(self, pad: str) -> np.ndarray:
        """Return the stamps [s] and forces [N] of the last FORCE_HISTORY seconds, shape (2, n)."""
        with self._changed:
            points = np.array(self._forces[pad], float).reshape(-1, 2)
        return points[points[:, 0] > points[-1:, 0].sum() - FORCE_HISTORY].T

    def _change(self, **fields: Any) -> None:
        with self._changed:
            self._shown = self._shown._replace(**fields | {'version': self._shown.version + 1})
            self._changed.notify_all()


class ViewSource:
    """A data source for the views, which fills ``store`` only between `start` and `stop`."""

    title: str
    store: Store
    player: 'RecordingSource | None' = None  #: player of a recording, or None for live data

    def check(self) -> None:
        """Raise TactileError if the source cannot be used. `check` is called once, before the first `start`."""

    def start(self) -> None:
        """Start filling the store, because a viewer has connected. Later failures are stored as the problem to show."""
        raise NotImplementedError

    def stop(self) -> None:
        """Stop all computation, because no viewer is connected."""
        raise NotImplementedError

    def close(self) -> None:
        """Release all resources. `close` may be called in any state."""
        self.stop()

    def age(self, state: PadState) -> float:
        """Return the age of ``state`` [s], relative to the playback position in a recording."""
        return time.monotonic() - state.acquired
