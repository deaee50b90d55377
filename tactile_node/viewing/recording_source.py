"""Source of the views that plays a recording."""

import math
import threading
import time

from tactile_node.errors import TactileError
from tactile_node.shape.methods import VisibilityGuard, make_recogniser
from tactile_node.threads import ReportedThread, StoppableThread
from tactile_node.viewing.pad_recogniser import PadRecogniser
from tactile_node.viewing.recordings import BagRecording, LogRecording
from tactile_node.viewing.source import Store, ViewSource
from tactile_node.viewing.states import PadState
from tactile_node.viewing.timeline import Moment, Timeline

RECORDING_RATE = 20.0  #: rate at which the playback position is updated [1/s]
FRAME_GAP = 0.5  #: gap between displayed frames above which contact tracking restarts [s]


class RecordingSource(ViewSource):
    """A recording with its own player.

    The recording is read only once, beginning at the first `start`. Any part that has already been read can be shown
    immediately.
    """

    def __init__(self, recording: BagRecording | LogRecording, recogniser: VisibilityGuard | None = None):
        self._recording = recording
        self.title = recording.title
        self.store = Store(recording.pads)
        self._timeline = Timeline()
        self._recogniser = recogniser or make_recogniser()
        self._recognisers: dict[str, PadRecogniser] = {}
        self._shown: dict[str, Moment] = {}
        self._lock = threading.Lock()  # guards position and is_playing; only this class sets them
        self.position = 0.0  #: playback position [s since the start of the recording]
        self.is_playing = True
        self.player = self
        self._closing = threading.Event()
        self.is_complete = False  #: True once the whole recording has been read
        self._reader: threading.Thread | None = None
        self._playing = StoppableThread(self._run, 'view_player', self._died)

    @property
    def length(self) -> float:
        """Length of the part of the recording that has been read so far [s]."""
        return max(self._timeline.end - self._timeline.begin, 0.0)

    def play(self, is_playing: bool) -> None:
        """Play or pause. If playback is resumed at the end of the recording, it restarts from the beginning."""
        with self._lock:
            if is_playing and self.is_complete and self.position >= self.length:
                self.position = 0.0
            self.is_playing = is_playing

    def seek(self, position: float) -> None:
        """Move to ``position`` [s since the start of the recording]."""
        with self._lock:
            self.position = min(max(position, 0.0), self.length)

    def check(self) -> None:
        self._recording.check()

    def start(self) -> None:
        if self._reader is None:
            self._reader = ReportedThread(self._read, 'view_reader', on_death=self._died)
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
        """Store the state at the current playback position."""
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
        grasp, age = self._timeline.grasp(now)
        self.store.put_grasp(grasp and grasp._replace(acquired=time.monotonic() - age))

    def _recognised(self, pad: str, found: Moment, before: Moment | None) -> PadState:
        if pad not in self._recognisers:
            self._recognisers[pad] = PadRecogniser(pad, found.pitch, found.unit, self._recogniser)
        elif before is None or not 0 <= found.frame.stamp - before.frame.stamp < FRAME_GAP:
            self._recognisers[pad].restart()
        return self._recognisers[pad].state(found.frame, time.monotonic())

    def _read(self) -> None:
        try:
            self._recording.read(self._timeline, self._closing)
            problem = self._recording.doubt
            if not problem and self._recording.unread:
                problem = f'not shown: {self._recording.unread} parts (last: {self._recording.problem})'
        except (TactileError, OSError) as error:  # the file has been removed, or the timeline has filled the disk
            problem = f'not read to its end: {error}'
        if problem:
            self.store.put_problem(problem)
        self.is_complete = True

    def _died(self, error: Exception) -> None:
        """Report the error that ended a thread, and stop playback."""
        self.store.put_error(error)
        self.is_complete = True
        self.play(False)

    def _run(self, stopping: threading.Event) -> None:
        last = time.monotonic()
        while not stopping.wait(1 / RECORDING_RATE):
            now = time.monotonic()
            with self._lock:
                if self.is_playing:
                    self.position = min(self.position + now - last, self.length)
            last = now
            is_complete = self.is_complete
            self.show()
            with self._lock:  # pause only after the last frame has been shown
                self.is_playing &= not (is_complete and self.position >= self.length)
