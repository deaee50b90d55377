"""A recording with a position that a person moves: CAN log or bag of our topics."""

import math
import threading
import time
from collections.abc import Callable
from typing import Protocol

from tactile_node.errors import TactileError
from tactile_node.library.contacts import Recogniser
from tactile_node.threads.stoppable_thread import StoppableThread
from tactile_node.view.recognising import PadRecogniser
from tactile_node.view.source import Store
from tactile_node.view.states import PadState
from tactile_node.view.timeline import Moment, Timeline

RATE = 20.0  #: at which the position moves on [1/s]
GAP = 0.5    #: between two frames shown, from which on a contact is not followed [s]


class Recording(Protocol):
    """What reads a log or a bag into a timeline."""

    title: str
    pads: tuple[str, ...]

    def check(self) -> None:
        """Raise LogError where it cannot be read at all."""

    def read(self, timeline: Timeline, is_stopping: Callable[[], bool]) -> str:
        """Read all, as fast as possible; return what is wrong with it, '' for nothing."""


class RecordingSource:
    """A `Source` and its own `Player`. It is read once, from the first `start` on; what is read can be seen."""

    def __init__(self, recording: Recording, recogniser: Recogniser | None = None):
        self._recording = recording
        self.title = recording.title
        self.store = Store(recording.pads)
        self._timeline = Timeline()
        self._recogniser = recogniser or Recogniser()
        self._recognisers: dict[str, PadRecogniser] = {}
        self._shown: dict[str, Moment] = {}
        self._lock = threading.Lock()  # of position and is_playing, which only this class sets
        self.position, self.is_playing = 0.0, True
        self.player = self
        self._closing = threading.Event()
        self.is_complete = False
        self._reader: threading.Thread | None = None
        self._playing = StoppableThread(self._run, 'view_player')

    @property
    def length(self) -> float:
        return max(self._timeline.end - self._timeline.begin, 0.0)

    def play(self, is_playing: bool) -> None:
        with self._lock:
            if is_playing and self.is_complete and self.position >= self.length:
                self.position = 0.0
            self.is_playing = is_playing

    def seek(self, position: float) -> None:
        with self._lock:
            self.position = min(max(position, 0.0), self.length)

    def check(self) -> None:
        self._recording.check()

    def start(self) -> None:
        if self._reader is None:
            self._reader = threading.Thread(target=self._read, name='view_reader', daemon=True)
            self._reader.start()
        self._playing.start()

    def stop(self) -> None:
        self._playing.stop()

    def close(self) -> None:
        self.stop()
        self._closing.set()
        if self._reader is not None:
            self._reader.join()
        self._timeline.close()

    def age(self, state: PadState) -> float:
        return self._timeline.begin + self.position - state.stamp

    def show(self) -> None:
        """Put what is at the position into the store."""
        now = self._timeline.begin + self.position
        if not math.isfinite(now):
            return
        for pad in self.store.pads:
            index, before = self._timeline.index(pad, now), self._shown.get(pad)
            if index == -1:
                self._shown.pop(pad, None)
                self.store.forget(pad)
            elif before is None or index != before.number:
                self._shown[pad] = found = self._timeline.moment(pad, index)
                self.store.put(self._recognised(pad, found, before))
        self.store.put_bus(*self._timeline.facts(now))

    def _recognised(self, pad: str, found: Moment, before: Moment | None) -> PadState:
        if pad not in self._recognisers:
            self._recognisers[pad] = PadRecogniser(pad, found.pitch, found.unit, self._recogniser)
        elif before is None or not 0 <= found.frame.stamp - before.frame.stamp < GAP:
            self._recognisers[pad].restart()
        return self._recognisers[pad].state(found.frame, time.monotonic())

    def _read(self) -> None:
        try:
            problem = self._recording.read(self._timeline, self._closing.is_set)
        except (TactileError, OSError) as error:  # the file has gone, the disk of the timeline is full
            problem = f'not read to its end: {error}'
        self.store.put_problem(problem)
        self.is_complete = True

    def _run(self, stopping: threading.Event) -> None:
        last = time.monotonic()
        while not stopping.wait(1 / RATE):
            now = time.monotonic()
            with self._lock:
                if self.is_playing:
                    self.position = min(self.position + now - last, self.length)
            last = now
            is_complete = self.is_complete
            self.show()
            with self._lock:  # after its end has been shown
                self.is_playing &= not (is_complete and self.position >= self.length)
