"""Simulated pads on one python-can bus."""

from collections.abc import Callable, Sequence

import can

from tactile_node.bus.bus_network import BusNetwork, open_bus
from tactile_node.bus.bus_settings import DEFAULT_BITRATE
from tactile_node.simulator.device import SimulatedDevice, TaxelSource
from tactile_node.simulator.wire_gateway import WireGateway
from tactile_node.simulator.wire_network import WireSettings
from tactile_node.simulator.wire_report import WireReport
from tactile_node.skin.pad_rules import check_pads
from tactile_node.skin.pads import CanopenNode, LivePad


class SkinSimulator:
    """Devices for ``pads``, each with its ``sources[pad.name]``, from ``start`` to ``stop`` on one bus.

    ``on_failure`` is called with the error when the bus fails. ``wire``: frames take their time on a simulated wire
    before they are on the bus; None: they are sent at once.

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
        self.devices: dict[int, SimulatedDevice] = {}  #: by node-ID

    def start(self, interface: str, channel: str, bitrate: int = DEFAULT_BITRATE) -> None:
        """Open the bus by name and boot the devices; BusError."""
        self.start_on(open_bus(interface, channel, bitrate, {}))

    def start_on(self, bus: can.BusABC) -> None:
        """Boot the devices on ``bus``, which is closed by ``stop``."""
        if self._wire is not None:
            self._gateway = WireGateway(bus, self._wire, self._on_failure)
        received = self._gateway.received if self._gateway is not None else lambda batch: None
        self._network = BusNetwork(bus, received, lambda fault, error: self._on_failure(error))
        for node in self._nodes:
            device = self.devices[node.node_id] = self._device(node, self._network)
            device.boot()
        if self._gateway is not None:
            self._gateway.wait_until_idle()  # boot-ups are over, as without a wire

    def _device(self, node: CanopenNode, shared: BusNetwork) -> SimulatedDevice:
        source = self._sources[node.pad]
        if self._gateway is None:
            return SimulatedDevice(shared, node, source)
        network = self._gateway.network(node.node_id)
        return SimulatedDevice(network, node, source, network.send_sweep)

    def report(self) -> WireReport | None:
        """What the wire has carried since the report before; None without a wire."""
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
