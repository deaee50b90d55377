"""The common interface of a live bus and a recorded log; the driver node uses only this."""

from typing import Protocol

from tactile_node.frames.health import BusHealth
from tactile_node.frames.losses import BusStatistics


class FrameSource(Protocol):
    """Gives taxel frames to ``on_frame(pad name, TaxelFrame)``, on its own thread."""

    def open(self) -> None:
        """Open the bus or the log. Raises BusError, LogError."""

    def configure(self) -> None:
        """Find the devices, check their identity and configure them. Raises DeviceError, BusError."""

    def start(self) -> None:
        """Start the frames; a bus's sequence numbers begin at 0, a log's continue where it was stopped."""

    def stop(self) -> None:
        """Stop the frames; ``start`` may follow."""

    def close(self) -> None:
        """Release everything; allowed in any state, also twice."""

    def age(self, stamp: float) -> float:
        """Time since the frame of ``stamp`` was acquired, or played, by the steady clock [s]."""

    def auto_zero(self, pad: str) -> int:
        """Let the pad's devices zero themselves (CiA 404); how many channels.

        Raises DeviceError, BusError where none is zeroed, HalfZeroedError where some are.
        """

    def boots(self, pad: str) -> int:
        """Number of boot-ups of the pad's devices; each loses the settings that a device has not saved."""

    def adjust(self, drop_incomplete: bool, heartbeat_timeout: float) -> None:
        """Change these settings at any time; see BusSettings and Supervisor."""

    def statistics(self) -> BusStatistics:
        """Counts so far."""

    def health(self) -> BusHealth:
        """State of bus and nodes now."""
