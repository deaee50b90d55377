"""What became of a pad's TPDOs: used, or lost for a named reason."""

from enum import Enum
from typing import NamedTuple

from tactile_node.frames.taxel_frame import TaxelFrame


class LossReason(str, Enum):
    """Why a TPDO of a pad went into no taxel frame."""

    BEFORE_FIRST_SYNC = 'before_first_sync'
    OUT_OF_ORDER = 'out_of_order'  #: a TPDO that comes before these in a sweep came after them
    LATE = 'late'  #: of an earlier period, or possibly so
    DUPLICATE = 'duplicate'  #: the same COB-ID and bytes twice in a row
    SURPLUS = 'surplus'  #: after the period's frame was complete
    SHORT = 'short'  #: fewer bytes than mapped
    UNKNOWN_ROW = 'unknown_row'  #: a row number, or an MPDO, that the layout does not name
    OVER_LONG = 'over_long'  #: more bytes than mapped: the device maps something else
    BROKEN = 'broken'  #: an SDO upload that was aborted, lacks frames or has a wrong CRC
    INCOMPLETE = 'incomplete'  #: good, of a sweep that was dropped since others were missing
    UNFINISHED = 'unfinished'  #: the driver stopped within the period


class Loss(NamedTuple):
    reason: LossReason
    can_frames: int = 1


#: What came of a CAN frame or a SYNC, in order
Outcome = tuple[TaxelFrame | Loss, ...]


class PadStatistics(NamedTuple):
    """Counts of one pad since it was opened; every TPDO received is used, lost with a reason, or pending."""

    complete: int  #: taxel frames given with every TPDO
    incomplete: int  #: taxel frames given with NaN
    expected: int  #: TPDOs that these taxel frames should have brought
    received: int  #: TPDOs seen, good or not
    used: int  #: TPDOs whose taxels were given as valid
    pending: int  #: TPDOs of which it is not yet known what becomes of them
    losses: dict[str, int]  #: TPDOs dropped, by LossReason
    dropped: int = 0  #: incomplete taxel frames dropped, as asked for
    used_by_node: tuple[int, ...] = ()  #: ``used``, by the pad's nodes

    @property
    def published(self) -> int:
        """Taxel frames given, complete or not."""
        return self.complete + self.incomplete

    @property
    def missing(self) -> int:
        """TPDOs expected that brought no valid taxels."""
        return self.expected - self.used


class BusStatistics(NamedTuple):
    """Counts since construction. ``can_frames``: by service; 'tpdo' the pads' own, 'foreign' nobody's."""

    pads: dict[str, PadStatistics]
    can_frames: dict[str, int]
    queue_overruns: int = 0  #: CAN frames dropped because this process was too slow
    sync_overruns: int = 0  #: SYNCs not sent because this process was too slow
    poll_overruns: int = 0  #: polls of a DOMAIN left out because the ones before took too long
    consumer_errors: int = 0  #: exceptions of on_frame
    clock_jumps: int = 0  #: times the wall clock was set while stamps were taken
    stamps_ahead: float = 0.0  #: of the wall clock, since it was set back [s]
    unread: int = 0  #: lines of a log that could not be read
    unrecorded: int = 0  #: CAN frames that the recording lacks: it has failed, or its format has no place for them
