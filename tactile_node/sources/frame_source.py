"""Define the common interface of a live bus and a recorded log.

The driver node uses a bus or a log only through this interface.
"""

from typing import Protocol

from tactile_node.assembly.facts import BusFacts


class FrameSource(Protocol):
    """Source of taxel frames.

    A source calls ``on_frame`` with each taxel frame, which contains the time of acquisition on the steady clock. A bus
    calls it on the chain thread of the process, and a log on its own thread.
    """

    def open(self) -> None:
        """Open the bus or the log.

        Raises BusError if the bus cannot be opened, and LogError if the log cannot be read.
        """

    def configure(self) -> None:
        """Find the devices, check their identity and configure them.

        Raises DeviceError if a device cannot be used, and BusError if the bus fails.
        """

    def start(self) -> None:
        """Start delivering frames.

        For a bus, the sequence numbers start at 0. For a log, playback continues where it stopped.
        """

    def stop(self) -> None:
        """Stop delivering frames. ``start`` may be called again."""

    def close(self) -> None:
        """Release the bus or the log. ``close`` is allowed in every state and may be repeated."""

    def auto_zero(self, pad: str) -> int:
        """Tell the devices of the pad ``pad`` to zero themselves (CiA 404).

        Returns the number of channels zeroed, and raises the errors of `bus_devices.auto_zero`.
        """

    def boots(self, pad: str) -> int:
        """Return how often the devices of ``pad`` have booted. A device loses its unsaved settings when it boots."""

    def adjust(self, drop_incomplete: bool, heartbeat_timeout: float) -> None:
        """Change settings. The method may be called at any time.

        Parameters
        ----------
        drop_incomplete : bool
            True to withhold incomplete taxel frames.
        heartbeat_timeout : float
            Longest time without a heartbeat [s].
        """

    def facts(self) -> BusFacts:
        """Return the present facts about the bus or the log, its pads and their nodes."""
