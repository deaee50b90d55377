"""Data sources that the views can use without ROS: a live bus and a recording.

While a viewer shows a live bus, this process is the CANopen master of that bus.
"""

import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from tactile_node.bus.bus_settings import BusSettings
from tactile_node.bus.threads import StoppableThread
from tactile_node.errors import BusError, TactileError
from tactile_node.shape.methods import VisibilityGuard, make_recogniser
from tactile_node.skin.pads import LivePad
from tactile_node.sources.supervisor import Supervisor
from tactile_node.taxel_frame import TaxelFrame
from tactile_node.threads import ReportedThread
from tactile_node.viewing.recordings import FACTS_PERIOD, BagRecording, LogRecording, Moment, Timeline
from tactile_node.viewing.source import Store, ViewSource
from tactile_node.viewing.states import PadState, facts_of
from tactile_node.viewing.touch_finder import PadRecogniser

RECOGNITION_RATE = 16.0  #: rate at which shapes are recognised [1/s]; a viewer would not notice a higher rate
REOPEN_PERIOD = 2.0  #: delay before the bus is reopened after an error [s]
LISTENING = 0.25    #: time to listen for the SYNC of another master [s]


class NewestFrames:
    """Holds only the newest frame of each pad. A newer frame overwrites an unread frame."""

    def __init__(self) -> None:
        self._has_come = threading.Event()
        self._frames: dict[str, TaxelFrame] = {}

    def put(self, pad: str, frame: TaxelFrame) -> None:
        self._frames[pad] = frame
        self._has_come.set()

    def take(self, timeout: float) -> dict[str, TaxelFrame]:
        """Wait at most ``timeout`` [s] for a frame, then return each pad's newest frame since the last call."""
        self._has_come.wait(timeout)
        self._has_come.clear()
        return {pad: self._frames.pop(pad) for pad in list(self._frames)}


class BusSource(ViewSource):
    """A live bus that is open only between `start` and `stop`, so that the source sends nothing while nobody is
    watching."""

    def __init__(self, settings: BusSettings, pads: tuple[LivePad, ...], recogniser: VisibilityGuard | None = None):
        self._settings, self._pads = settings, pads
        self.title = f'{settings.interface} {settings.channel}'
        self.store = Store([pad.name for pad in pads])
        self._recogniser = recogniser or make_recogniser()
        self._following = StoppableThread(self._run, 'view_bus', self.store.put_error)

    def check(self) -> None:
        """Open the bus and configure its devices. Raises BusError or DeviceError."""
        with self._opened(NewestFrames()):
            pass

    def start(self) -> None:
        self._following.start()

    def stop(self) -> None:
        self._following.stop()
        self.store.clear()

    @contextmanager
    def _opened(self, frames: NewestFrames) -> Iterator[Supervisor]:
        bus = Supervisor(self._settings, self._pads, frames.put)
        try:
            bus.open()
            self._refuse_other_master(bus)
            bus.configure()
            yield bus
        finally:
            bus.close()

    def _refuse_other_master(self, bus: Supervisor) -> None:
        """Raise BusError if another master sends SYNC, because our SYNC and NMT commands would disturb that master."""
        time.sleep(LISTENING)
        if bus.statistics().can_frames.get('sync', 0):
            raise BusError(f'CAN bus {self.title}', expected='no other master, because this command starts the pads',
                           got='SYNC from another master',
                           remedy='To view the topics of that driver, leave out --interface.')

    def _run(self, stopping: threading.Event) -> None:
        while not stopping.is_set():
            frames = NewestFrames()
            try:
                with self._opened(frames) as bus:
                    bus.start()
                    self.store.put_problem('')
                    self._follow(bus, frames, stopping)
            except TactileError as error:
                self.store.put_problem(str(error))
                stopping.wait(REOPEN_PERIOD)

    def _follow(self, bus: Supervisor, frames: NewestFrames, stopping: threading.Event) -> None:
        recognisers = {pad.name: PadRecogniser(pad.name, pad.layout.pitch, pad.layout.value.unit, self._recogniser)
                       for pad in self._pads}
        looked = 0.0
        while not stopping.is_set():
            begun = time.monotonic()
            for pad, frame in frames.take(FACTS_PERIOD).items():
                self.store.put(recognisers[pad].state(frame, time.monotonic() - bus.age(frame.stamp)))
            if time.monotonic() - looked >= FACTS_PERIOD:
                looked = time.monotonic()
                self.store.put_bus(facts_of(bus.statistics(), bus.health()))
            stopping.wait(max(0.0, begun + 1 / RECOGNITION_RATE - time.monotonic()))


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
        self._lock = threading.Lock()  # this lock protects position and is_playing, which only this class sets
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
        """Play or pause. Playback that is resumed at the end of the recording restarts from the beginning."""
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

    def _recognised(self, pad: str, found: Moment, before: Moment | None) -> PadState:
        if pad not in self._recognisers:
            self._recognisers[pad] = PadRecogniser(pad, found.pitch, found.unit, self._recogniser)
        elif before is None or not 0 <= found.frame.stamp - before.frame.stamp < FRAME_GAP:
            self._recognisers[pad].restart()
        return self._recognisers[pad].state(found.frame, time.monotonic())

    def _read(self) -> None:
        try:
            problem = self._recording.read(self._timeline, self._closing.is_set)
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
