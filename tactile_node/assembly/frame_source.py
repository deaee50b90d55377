"""The common interface of a live bus and a recorded log, and what it loses; the driver node uses only this."""

from collections.abc import Callable
from typing import NamedTuple, Protocol

from tactile_node.assembly.health import BusHealth, TpdoOrder
from tactile_node.code_names import PhrasedCode
from tactile_node.taxel_frame import TaxelFrame


class LossReason(PhrasedCode):
    """Why a CAN frame of a pad is in no taxel frame."""

    BEFORE_FIRST_SYNC = 1, 'received before the first SYNC'
    OUT_OF_ORDER = 2, 'received after a TPDO that follows it in a sweep'
    LATE = 3, 'of an earlier period, possibly so, or of a SYNC that was held up'
    DUPLICATE = 4, 'the same COB-ID and bytes twice in a row'
    SURPLUS = 5, "after the period's frame was complete"
    SHORT = 6, 'fewer bytes than mapped'
    UNKNOWN_ROW = 7, 'a row number, or an MPDO, that is not in the layout'
    OVER_LONG = 8, 'more bytes than a CAN frame can have, or than the layout gives the DOMAIN'
    BROKEN = 9, 'an SDO upload that was aborted, lacks frames or has a wrong CRC'
    INCOMPLETE = 10, 'good, but of an incomplete taxel frame, which is withheld (drop_incomplete)'
    UNFINISHED = 11, 'the driver stopped within the period'


class PadStatistics(NamedTuple):
    """Counts of one pad since it was opened. received = used + pending + the sum of all losses.

    For a pad with a polled DOMAIN the counts are of SDO uploads in place of TPDOs.
    """

    complete: int  #: taxel frames given with every TPDO
    incomplete: int  #: taxel frames given with NaN
    expected: int  #: TPDOs that these taxel frames and the withheld ones should consist of
    received: int  #: TPDOs seen, good or not
    used: int  #: TPDOs whose taxels were given as valid
    pending: int  #: TPDOs that may still be used or lost
    losses: dict[LossReason, int]  #: TPDOs lost, of every reason; read only
    withheld: int = 0  #: incomplete taxel frames not given, because of ``drop_incomplete``
    padded: int = 0  #: TPDOs longer than mapped, up to 8 bytes: their first bytes were taken
    used_by_node: tuple[int, ...] = ()  #: ``used``, by the pad's nodes
    syncs: int = 0  #: SYNCs that began a period
    distinct_by_tpdo: tuple[tuple[int, ...], ...] = ()  #: TPDOs seen but DUPLICATEs, by node and its part of the layout
    fresh_by_tpdo: tuple[tuple[int, ...], ...] = ()  #: TPDOs good for a taxel frame, given or withheld; likewise
    orders: tuple[TpdoOrder | None, ...] = ()  #: by node; None where none was seen but the layout's

    @property
    def published(self) -> int:
        """Taxel frames given, complete or not."""
        return self.complete + self.incomplete

    @property
    def missing(self) -> int:
        """TPDOs expected that brought no valid taxels."""
        return self.expected - self.used


class BusStatistics(NamedTuple):
    """Counts since construction. ``can_frames``: by service; 'tpdo' are the pads' own, 'foreign' are no pad's."""

    pads: dict[str, PadStatistics]
    can_frames: dict[str, int]
    queue_overruns: int = 0  #: CAN frames not taken because this process was too slow
    sync_overruns: int = 0  #: SYNCs not sent because this process was too slow
    sync_pauses: int = 0  #: SYNCs left out, so that a free bus shows how far the nodes are
    poll_overruns: int = 0  #: polls of a DOMAIN left out because the ones before took too long
    consumer_errors: int = 0  #: exceptions of on_frame
    clock_jumps: int = 0  #: times the wall clock was set while stamps were taken
    stamps_ahead: float = 0.0  #: time by which they lead the wall clock, since it was set back [s]
    unread: int = 0  #: lines of a log that could not be read
    unrecorded: int = 0  #: CAN frames missing in the recording: it failed, or its format cannot hold them


#: Called with the pad's name and its frame
OnFrame = Callable[[str, TaxelFrame], None]


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
