"""Pads of a live bus without ROS: this process is the master that starts them, while somebody looks."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from tactile_node.bus.bus_settings import BusSettings
from tactile_node.errors import BusError, TactileError
from tactile_node.frames.taxel_frame import TaxelFrame
from tactile_node.library.contacts import Recogniser
from tactile_node.skin.pads import LivePad
from tactile_node.supervision.supervisor import Supervisor
from tactile_node.threads.stoppable_thread import StoppableThread
from tactile_node.view.recognising import PadRecogniser
from tactile_node.view.source import Store
from tactile_node.view.states import PadState, facts_of

RATE = 16.0        #: at which the newest frames are recognised [1/s]: an eye needs no more
FACTS_PERIOD = 0.5  #: s
RETRY_PERIOD = 2.0  #: s
LISTENING = 0.25   #: for the SYNC of another master [s]


class NewestFrames:
    """A slot for each pad: a frame that is not taken in time is replaced."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._frames: dict[str, TaxelFrame] = {}

    def put(self, pad: str, frame: TaxelFrame) -> None:
        with self._changed:
            self._frames[pad] = frame
            self._changed.notify()

    def take(self, timeout: float) -> dict[str, TaxelFrame]:
        """Return the newest frame of each pad since the last call; wait for one up to ``timeout`` [s]."""
        with self._changed:
            self._changed.wait_for(lambda: self._frames, timeout)
            frames, self._frames = self._frames, {}
        return frames


class BusSource:
    """A `Source`: opens the bus at `start` and closes it at `stop`, so that no bus is busy for nothing."""

    player = None

    def __init__(self, settings: BusSettings, pads: tuple[LivePad, ...], recogniser: Recogniser | None = None):
        self._settings, self._pads = settings, pads
        self.title = f'{settings.interface} {settings.channel}'
        self.store = Store([pad.name for pad in pads])
        self._recogniser = recogniser or Recogniser()
        self._following = StoppableThread(self._run, 'view_bus')

    def check(self) -> None:
        """Find the bus and its devices. Raises BusError, DeviceError."""
        with self._opened(NewestFrames()):
            pass

    def start(self) -> None:
        self._following.start()

    def stop(self) -> None:
        self._following.stop()
        self.store.clear()

    def close(self) -> None:
        self.stop()

    def age(self, state: PadState) -> float:
        return time.monotonic() - state.acquired

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
        """A second SYNC, and our NMT commands, would disturb the driver that runs already."""
        time.sleep(LISTENING)
        if bus.statistics().can_frames.get('sync', 0):
            raise BusError(f'CAN bus {self.title}', expected='no other master, since this command starts the pads',
                           got='SYNC of another one', remedy='View the topics of its driver: leave out --interface.')

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
                stopping.wait(RETRY_PERIOD)

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
            stopping.wait(max(0.0, begun + 1 / RATE - time.monotonic()))
