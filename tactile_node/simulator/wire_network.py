"""One device's place on a simulated wire, as a canopen Network."""

import random
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from canopen import Network
from canopen.network import PeriodicMessageTask

from tactile_node.bus.bus_settings import DEFAULT_BITRATE
from tactile_node.cia301.frame_bits import Frame, Stuffing, bits_of
from tactile_node.simulator.segment import Segment
from tactile_node.simulator.wire import Carried, Wire


@dataclass(frozen=True)
class WireSettings:
    """How long frames and answers take."""

    bitrate: int = DEFAULT_BITRATE  #: bit/s
    stuffing: Stuffing = Stuffing.WORST
    delay: float = 0.0003   #: of a device, from the end of the frame that it answers until its answer is ready [s]
    jitter: float = 0.0001  #: by which that may be longer, evenly distributed [s]
    most_sweeps: int = 2    #: that a device has not sent to the end, when it begins no other
    batch: float = 0.0005   #: that a frame waits, at most, to be handed to the host with those after it [s]
    seed: int = 0

    def wire(self) -> Wire:
        return Wire(self.bitrate, bits_of(self.stuffing))


class WireNetwork(Network):
    """A canopen Network over its queue on the segment; ``to_wall_clock`` is added to stamps [s]."""

    def __init__(self, segment: Segment, settings: WireSettings, node_id: int, to_wall_clock: float = 0.0):
        super().__init__()
        self._segment = segment
        self._settings = settings
        self._to_wall_clock = to_wall_clock
        self._random = random.Random(settings.seed << 7 | node_id)
        self._sender = segment.join(self._receive)

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """From any thread."""
        frame = Frame(can_id, bytes(data), is_extended=can_id > 0x7FF, is_remote=remote)
        self._segment.submit(lambda: self._sender.put(self._next_ready(), frame))

    def send_sweep(self, frames: Iterator[tuple[int, bytes]]) -> None:
        """Queue a whole sweep; it is skipped, and ``frames`` not taken, while too many wait."""
        self._segment.submit(lambda: self._sender.put_sweep(
            self._next_ready(), (Frame(can_id, data) for can_id, data in frames), self._settings.most_sweeps))

    def send_periodic(self, can_id: int, data: Iterable[int], period: float, remote: bool = False) -> 'PeriodicFrame':
        """Send a frame now and every ``period`` [s] of the wire's time."""
        periodic = PeriodicFrame(self, can_id, bytes(data), period, remote)
        self._segment.submit(lambda: periodic.send(self._segment))
        return periodic

    def __delitem__(self, node_id: int) -> None:
        """A device without supply sends nothing."""
        super().__delitem__(node_id)
        self._segment.submit(self._sender.clear)

    def _next_ready(self) -> float:
        return self._segment.now + self._settings.delay + self._settings.jitter * self._random.random()

    def _receive(self, carried: Carried) -> None:
        frame = carried.frame
        callbacks = self.subscribers.get(frame.can_id)
        if callbacks and not (frame.is_remote or frame.is_extended):
            for callback in tuple(callbacks):
                callback(frame.can_id, bytearray(frame.data), carried.end + self._to_wall_clock)


class PeriodicFrame(PeriodicMessageTask):
    """As python-can's cyclic task, in wire time."""

    def __init__(self, network: WireNetwork, can_id: int, data: bytes, period: float, remote: bool):
        self._network = network
        self._can_id, self._data, self._remote = can_id, data, remote
        self._period = period
        self._is_stopped = False

    def send(self, segment: Segment) -> None:
        if not self._is_stopped:
            segment.at(segment.now + self._period, lambda: self.send(segment))
            self._network.send_message(self._can_id, self._data, self._remote)

    def update(self, data: Iterable[int]) -> None:
        self._data = bytes(data)

    def stop(self) -> None:
        self._is_stopped = True
