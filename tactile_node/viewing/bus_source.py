"""Source of the views that reads a bus without ROS. While it is viewed, this process is the CANopen master of the bus.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from tactile_node.bus.bus_settings import BusSettings
from tactile_node.errors import BusError, TactileError
from tactile_node.shape.methods import VisibilityGuard, make_recogniser
from tactile_node.skin.pads import LivePad
from tactile_node.sources.supervisor import Supervisor
from tactile_node.taxel_frame import TaxelFrame
from tactile_node.threads import StoppableThread
from tactile_node.viewing.pad_recogniser import PadRecogniser
from tactile_node.viewing.recordings import FACTS_PERIOD
from tactile_node.viewing.source import Store, ViewSource

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
        if bus.facts().can_frames.get('sync', 0):
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
                self.store.put(recognisers[pad].state(frame, frame.acquired))
            if time.monotonic() - looked >= FACTS_PERIOD:
                looked = time.monotonic()
                self.store.put_bus(bus.facts())
            stopping.wait(max(0.0, begun + 1 / RECOGNITION_RATE - time.monotonic()))
