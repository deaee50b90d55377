"""Simulated pads on one python-can bus."""

from collections.abc import Callable, Sequence

import can

from tactile_node.bus.bus_network import BusNetwork, open_bus
from tactile_node.bus.bus_settings import DEFAULT_BITRATE
from tactile_node.simulator.device import SimulatedDevice, TaxelSource
from tactile_node.skin.pad_rules import check_pads
from tactile_node.skin.pads import LivePad


class SkinSimulator:
    """Devices for ``pads``, each with its ``sources[pad.name]``, from ``start`` to ``stop`` on one bus.

    ``on_failure`` is called with the error when the bus fails.

    >>> from tactile_node.skin.pads import make_pad
    >>> import numpy as np
    >>> pad = make_pad('left', 32, 'sim16x16.yaml')
    >>> simulator = SkinSimulator([pad], {'left': lambda t: np.zeros((16, 16))})
    >>> simulator.start('virtual', 'skin'); simulator.stop()
    """

    def __init__(self, pads: Sequence[LivePad], sources: dict[str, TaxelSource],
                 on_failure: Callable[[Exception], None] = lambda error: None):
        check_pads(tuple(pads))
        self._nodes = [node for pad in pads for node in pad.nodes]
        self._sources = sources
        self._on_failure = on_failure
        self._network: BusNetwork | None = None
        self.devices: dict[int, SimulatedDevice] = {}  #: by node-ID

    def start(self, interface: str, channel: str, bitrate: int = DEFAULT_BITRATE) -> None:
        """Open the bus by name and boot the devices; BusError."""
        self.start_on(open_bus(interface, channel, bitrate, {}))

    def start_on(self, bus: can.BusABC) -> None:
        """Boot the devices on ``bus``, which is closed by ``stop``."""
        self._network = BusNetwork(bus, lambda batch: None, lambda fault, error: self._on_failure(error))
        for node in self._nodes:
            device = self.devices[node.node_id] = SimulatedDevice(self._network, node, self._sources[node.pad])
            device.boot()

    def stop(self) -> None:
        """Switch the devices off and close the bus."""
        for device in self.devices.values():
            device.power_off()
        self.devices.clear()
        if self._network is not None:
            self._network.close()
            self._network = None
