"""Devices on a simulated wire that keeps time, and the bus behind which a host sees them."""

import time
from collections.abc import Callable, Sequence

import can

from tactile_node.bus.reception import Batch
from tactile_node.cia301.frame_bits import Frame
from tactile_node.simulator.live_segment import LiveSegment
from tactile_node.simulator.slcan_pty import SlcanPty
from tactile_node.simulator.wire_network import WireNetwork, WireSettings
from tactile_node.simulator.wire_report import WireReport

MOST_WAIT = 1.0  #: s


class WireGateway:
    """What the host sends on ``bus`` takes its place on the wire; what devices send is handed over as it ends.

    ``on_failure`` is called with the error when the bus takes no frame.
    """

    def __init__(self, bus: can.BusABC, settings: WireSettings, on_failure: Callable[[Exception], None]):
        self._bus = bus
        self._settings = settings
        self._on_failure = on_failure
        self._to_wall_clock = time.time() - time.monotonic()
        self._segment = LiveSegment(settings.wire(), self._hand_over, lambda: getattr(bus, 'lost', 0),
                                    settings.batch, is_shared=not isinstance(bus, SlcanPty))
        self._segment.start()

    def network(self, node_id: int) -> WireNetwork:
        """A device's place on the wire."""
        return WireNetwork(self._segment, self._settings, node_id, self._to_wall_clock)

    def received(self, batch: Batch) -> None:
        """The host has sent these frames."""
        for message in batch.messages:
            if not message.is_error_frame and not message.is_fd:
                self._segment.send(frame_of(message))

    def report(self) -> WireReport:
        """Of the time since the report before."""
        return self._segment.report()

    def wait_until_idle(self) -> None:
        """Return when the wire has carried what waits, unless it is kept busy."""
        self._segment.wait_until_idle(MOST_WAIT)

    def stop(self) -> None:
        self._segment.stop()

    def _hand_over(self, frames: Sequence[Frame]) -> None:
        try:
            if isinstance(self._bus, SlcanPty):
                self._bus.send_all(frames)
            else:
                for frame in frames:
                    self._bus.send(message_of(frame))
        except (can.CanError, OSError, ValueError) as error:
            self._on_failure(error)


def frame_of(message: can.Message) -> Frame:
    return Frame(message.arbitration_id, bytes(message.data or b''), message.is_extended_id, message.is_remote_frame,
                 message.dlc if message.is_remote_frame else 0)


def message_of(frame: Frame) -> can.Message:
    return can.Message(arbitration_id=frame.can_id, is_extended_id=frame.is_extended,
                       is_remote_frame=frame.is_remote, dlc=frame.dlc, data=frame.data, is_rx=False)
