"""What a live bus and a recorded log have in common: the driver node sees only this."""

from typing import Protocol

from tactile_node.frames.health import BusHealth
from tactile_node.frames.losses import BusStatistics


class FrameSource(Protocol):
    """Gives taxel frames to ``on_frame(pad name, TaxelFrame)``, on a thread of its own."""

    def open(self) -> None:
        """Open the bus or the log; BusError or LogError."""

    def configure(self) -> None:
        """Find the devices, check who they are and configure them; DeviceError."""

    def start(self) -> None:
        """Let frames flow; a bus's sequence numbers begin at 0, a log's go on where it was stopped."""

    def stop(self) -> None:
        """Stop the flow; ``start`` may follow."""

    def close(self) -> None:
        """Give everything back; allowed in any state, also twice."""

    def auto_zero(self, pad: str) -> int:
        """Let the pad's devices zero themselves (CiA 404); how many channels.

        Raises DeviceError, BusError where none is zeroed, HalfZeroedError where some are.
        """

    def boots(self, pad: str) -> int:
        """Boot-ups seen of the pad's devices: what they have not saved is lost with each."""

    def adjust(self, drop_incomplete: bool, heartbeat_timeout: float) -> None:
        """Change these while frames flow, or do not; see BusSettings and Supervisor."""

    def statistics(self) -> BusStatistics:
        """Counts so far."""

    def health(self) -> BusHealth:
        """State of bus and nodes now."""
