"""Simulate the CANopen devices of one or more pads on one python-can bus."""

import random
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import can
from canopen import Network
from canopen.network import PeriodicMessageTask

from tactile_node.bus.bus_network import BusNetwork
from tactile_node.bus.bus_settings import DEFAULT_BITRATE
from tactile_node.bus.open_bus import open_bus
from tactile_node.cia301.frame_bits import CanFrame
from tactile_node.simulator.device import SimulatedDevice, TaxelSource
from tactile_node.simulator.segment import Segment
from tactile_node.simulator.wire import Carried, WireReport
from tactile_node.simulator.wire_gateway import WireGateway
from tactile_node.skin.pads import LivePad, check_pads


@dataclass(frozen=True)
class WireSettings:
    """Timing of the simulated wire and of the devices on it."""

    bitrate: int = DEFAULT_BITRATE  #: bit rate of the wire [bit/s]
    delay: float = 0.0003   #: time from the end of a request until the device has its response ready [s]
    jitter: float = 0.0001  #: maximum random addition to ``delay``, uniformly distributed [s]
    most_sweeps: int = 2    #: number of unsent sweeps at which a device starts to skip sweeps
    batch: float = 0.0005   #: maximum time for which a frame waits to be delivered together with later frames [s]
    seed: int = 0           #: seed of the random jitter


class WireNetwork(Network):
    """A canopen Network that sends CAN frames on a simulated wire through a separate queue.

    Parameters
    ----------
    segment
        Wire on which the network sends and receives.
    settings
        Timing settings of the wire.
    node_id
        Node-ID of the device, which also seeds the random jitter.
    to_wall_clock
        Offset added to the stamps of received frames [s].
    """

    def __init__(self, segment: Segment, settings: WireSettings, node_id: int, to_wall_clock: float = 0.0):
        super().__init__()
        self._segment = segment
        self._settings = settings
        self._to_wall_clock = to_wall_clock
        self._random = random.Random(settings.seed << 7 | node_id)
        self._sender = segment.join(self._receive)

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Queue a frame. Any thread may call this method."""
        frame = CanFrame(can_id, bytes(data), is_extended=can_id > 0x7FF, is_remote=remote)
        self._segment.submit(lambda: self._sender.put(self._next_ready(), frame))

    def send_sweep(self, frames: Iterator[tuple[int, bytes]]) -> None:
        """Queue a complete sweep. If too many sweeps are queued, the sweep is skipped and ``frames`` is not read."""
        self._segment.submit(lambda: self._sender.put_sweep(
            self._next_ready(), (CanFrame(can_id, data) for can_id, data in frames), self._settings.most_sweeps))

    def send_periodic(self, can_id: int, data: Iterable[int], period: float, remote: bool = False) -> 'PeriodicFrame':
        """Send a frame now, then again every ``period`` seconds of wire time."""
        periodic = PeriodicFrame(self, can_id, bytes(data), period, remote)
        self._segment.submit(lambda: periodic.send(self._segment))
        return periodic

    def __delitem__(self, node_id: int) -> None:
        """Remove a device and drop its queued frames, because a device without power is silent."""
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
    """A cyclic task as in python-can, but timed by the wire."""

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


class SkinSimulator:
    """Simulates the devices of pads on one bus, from ``start`` to ``stop``.

    Parameters
    ----------
    pads
        Pads to simulate.
    sources
        Function for each pad, by name, that returns the taxel values at a given time.
    on_failure
        Called with the error if the bus fails.
    wire
        Timing of the simulated wire, or None to send frames immediately.

    Examples
    --------

    >>> from tactile_node.skin.pads import make_pad
    >>> import numpy as np
    >>> pad = make_pad('left', 32, 'sim16x16.yaml')
    >>> simulator = SkinSimulator([pad], {'left': lambda t: np.zeros((16, 16))})
    >>> simulator.start('virtual', 'skin'); simulator.stop()
    """

    def __init__(self, pads: Sequence[LivePad], sources: dict[str, TaxelSource],
                 on_failure: Callable[[Exception], None] = lambda error: None, wire: WireSettings | None = None):
        check_pads(tuple(pads))
        self._nodes = [node for pad in pads for node in pad.nodes]
        self._sources = sources
        self._on_failure = on_failure
        self._wire = wire
        self._network: BusNetwork | None = None
        self._gateway: WireGateway | None = None
        self.devices: dict[int, SimulatedDevice] = {}  #: devices by node-ID

    def start(self, interface: str, channel: str, bitrate: int = DEFAULT_BITRATE) -> None:
        """Open the bus by name and boot the devices. Raises BusError if the bus cannot be opened."""
        self.start_on(open_bus(interface, channel, bitrate))

    def start_on(self, bus: can.BusABC) -> None:
        """Boot the devices on ``bus``. ``stop`` closes the bus."""
        if self._wire is not None:
            self._gateway = WireGateway(bus, self._wire.bitrate, self._wire.batch, self._on_failure)
        received = self._gateway.received if self._gateway is not None else lambda batch: None
        self._network = BusNetwork(bus, received, lambda fault, error: self._on_failure(error))
        for node in self._nodes:
            source = self._sources[node.pad]
            if self._wire is None or self._gateway is None:
                device = SimulatedDevice(self._network, node, source)
            else:
                network = WireNetwork(self._gateway, self._wire, node.node_id, self._gateway.to_wall_clock)
                device = SimulatedDevice(network, node, source, network.send_sweep)
            self.devices[node.node_id] = device
            device.boot()
        if self._gateway is not None:
            # The boot-up messages must have been sent before the method returns, just as without a wire.
            self._gateway.wait_until_idle(timeout=1.0)

    def report(self) -> WireReport | None:
        """Return a report on the wire since the last report, or None without a wire."""
        return self._gateway.report() if self._gateway is not None else None

    def stop(self) -> None:
        """Switch the devices off and close the bus."""
        for device in self.devices.values():
            device.power_off()
        self.devices.clear()
        if self._gateway is not None:
            self._gateway.stop()
            self._gateway = None
        if self._network is not None:
            self._network.close()
            self._network = None
