"""Define the common interface and the counts of a live bus and a recorded log.

The driver node uses a bus or a log only through this interface.
"""

from collections.abc import Callable
from typing import NamedTuple, Protocol

from tactile_node.assembly.health import BusHealth, TpdoOrder
from tactile_node.code_names import PhrasedCode
from tactile_node.taxel_frame import TaxelFrame


class LossReason(PhrasedCode):
    """Reason why a CAN frame of a pad does not contribute to any taxel frame."""

    BEFORE_FIRST_SYNC = 1, 'received before the first SYNC'
    OUT_OF_ORDER = 2, 'received after a TPDO that follows it in a sweep'
    LATE = 3, 'from an earlier period, or not proved to be from this one, or after a delayed SYNC'
    DUPLICATE = 4, 'the same COB-ID and bytes twice in a row'
    SURPLUS = 5, "after the period's frame was complete"
    SHORT = 6, 'fewer bytes than mapped'
    UNKNOWN_ROW = 7, 'a row number, or an MPDO, that is not in the layout'
    OVER_LONG = 8, 'more bytes than a CAN frame can have, or than the layout gives the DOMAIN'
    BROKEN = 9, 'an SDO upload that was aborted, lacks frames or has a wrong CRC'
    INCOMPLETE = 10, 'valid, but part of an incomplete taxel frame, which is withheld (drop_incomplete)'
    UNFINISHED = 11, 'the driver stopped within the period'


class PadStatistics(NamedTuple):
    """Counts of one pad since it was opened.

    The number of received TPDOs equals used + pending + the sum of all losses.

    For a pad with a polled DOMAIN, read "SDO upload" wherever this text says "TPDO".
    """

    complete: int  #: taxel frames emitted with all their TPDOs
    incomplete: int  #: taxel frames emitted with NaN for the missing taxels
    expected: int  #: TPDOs that all taxel frames, emitted or withheld, would hold if every frame were complete
    received: int  #: TPDOs received, valid or not
    used: int  #: TPDOs whose taxels were emitted with valid values
    pending: int  #: TPDOs that may still be used or lost
    losses: dict[LossReason, int]  #: number of TPDOs lost for each reason; read only
    withheld: int = 0  #: incomplete taxel frames that were not emitted because of ``drop_incomplete``
    padded: int = 0  #: TPDOs longer than their mapping, but at most 8 bytes long; only the mapped bytes are used
    used_by_node: tuple[int, ...] = ()  #: ``used`` for each node of the pad
    syncs: int = 0  #: SYNCs that began a period

    #: number of TPDOs received, without DUPLICATEs, by node and by TPDO in the order of the layout
    distinct_by_tpdo: tuple[tuple[int, ...], ...] = ()
    #: number of TPDOs used for a taxel frame, emitted or withheld, by node and by TPDO in the order of the layout
    fresh_by_tpdo: tuple[tuple[int, ...], ...] = ()
    #: order of each node's TPDOs if it differs from the layout, else None
    orders: tuple[TpdoOrder | None, ...] = ()

    @property
    def published(self) -> int:
        """Number of taxel frames emitted, complete or not."""
        return self.complete + self.incomplete

    @property
    def missing(self) -> int:
        """Number of expected TPDOs that delivered no valid taxels."""
        return self.expected - self.used


class BusStatistics(NamedTuple):
    """Counts of a bus or a log since construction."""

    pads: dict[str, PadStatistics]  #: counts of each pad, by pad name

    #: CAN frames received, by service; 'tpdo' counts the TPDOs of the pads, and 'foreign' counts the frames that belong
    #: to no pad
    can_frames: dict[str, int]
    queue_overruns: int = 0  #: CAN frames dropped because this process was too slow
    sync_overruns: int = 0  #: SYNCs not sent because this process was too slow

    #: SYNCs skipped on purpose to free the bus, so that the driver learns which SYNC each node is answering
    sync_pauses: int = 0
    poll_overruns: int = 0  #: polls of a DOMAIN skipped because earlier polls took too long
    consumer_errors: int = 0  #: exceptions raised by ``on_frame``
    clock_jumps: int = 0  #: number of times the wall clock was set
    stamps_ahead: float = 0.0  #: time by which the stamps lead the wall clock after it was set back [s]
    unread: int = 0  #: lines of a log that could not be read

    #: CAN frames missing from the recording, because writing failed or the file format cannot hold them
    unrecorded: int = 0


#: Function that receives the name of a pad and each of its taxel frames.
OnFrame = Callable[[str, TaxelFrame], None]


class FrameSource(Protocol):
    """Source of taxel frames. A source has its own thread, on which it calls ``on_frame`` with each taxel frame."""

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

    def age(self, stamp: float) -> float:
        """Return the time that has passed since a frame was acquired or played, measured on the steady clock [s].

        Parameters
        ----------
        stamp : float
            Stamp of the frame [s].
        """

    def auto_zero(self, pad: str) -> int:
        """Tell the devices of a pad to zero themselves (CiA 404).

        Parameters
        ----------
        pad : str
            Name of the pad.

        Returns
        -------
        int
            Number of channels zeroed.

        Raises
        ------
        DeviceError, BusError
            Raised if no channel was zeroed.
        HalfZeroedError
            Raised if only some channels were zeroed, or if a device did not answer.
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

    def statistics(self) -> BusStatistics:
        """Return the present counts."""

    def health(self) -> BusHealth:
        """Return the present state of the bus and its nodes."""
