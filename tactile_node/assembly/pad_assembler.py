"""Base class of the assemblers.

The class finds the TPDO of each CAN frame, keeps the counts and builds the taxel frames.
"""

import logging
from collections.abc import Sequence

import numpy as np

from tactile_node.assembly.facts import LossReason, PadFacts
from tactile_node.assembly.health import SentTpdo
from tactile_node.cia301.objects import MAX_PDO_BYTES
from tactile_node.skin.layout import SkinLayout
from tactile_node.skin.taxel_codec import TaxelCodec
from tactile_node.taxel_frame import TaxelFrame, TpdoAges

logger = logging.getLogger(__name__)

#: Taxel frames finished by a CAN frame or a SYNC, in order. The tuple is often empty.
TaxelFrames = tuple[TaxelFrame, ...]


class PadAssembler:
    """State machine of one pad, without access to a bus or a clock.

    The methods return finished frames and count lost TPDOs.

    The rank of a TPDO is its position in the layout. A polled DOMAIN counts as one TPDO. All counts start at
    construction; see `PadFacts`.

    Parameters
    ----------
    layout : SkinLayout
        Layout of the pad.
    node_ids : sequence of int
        Node-IDs of the pad, one for each node of the layout.
    """

    service = 'tpdo'  #: service under which the pad's CAN frames are counted
    answers_sync = False  #: True if the pad's TPDOs answer SYNC

    def __init__(self, layout: SkinLayout, node_ids: Sequence[int]):
        self.drop_incomplete = False  #: True to withhold taxel frames that lack TPDOs
        self._codec = TaxelCodec(layout)
        ranks: dict[int, dict[bytes, int]] = {}  # COB-ID -> prefix -> rank
        for rank, tpdo in enumerate(layout.tpdos):
            node_id = node_ids[tpdo.node]
            ranks.setdefault(tpdo.cob_id.of(node_id), {})[tpdo.prefix(node_id)] = rank
        # COB-ID -> length of the prefixes, and rank by prefix
        self._ranks = {can_id: (len(next(iter(by_prefix))), by_prefix) for can_id, by_prefix in ranks.items()}
        self._lengths = [tpdo.length for tpdo in layout.tpdos]
        self._numbers = [tpdo.number for tpdo in layout.tpdos]
        self._padded = 0
        self.can_ids = frozenset(self._ranks)  #: COB-IDs of the pad's CAN frames
        self._senders = np.array([tpdo.node for tpdo in layout.tpdos] or [0], np.intp)  # node number by rank
        self._used = np.zeros(layout.nodes, np.int64)
        self._losses = dict.fromkeys(LossReason, 0)
        self._complete = self._incomplete = self._withheld = self._missing = self._received = 0

    @property
    def is_in_doubt(self) -> bool:
        """True if no SYNC may be sent until the driver knows which SYNC each node is answering.

        Any thread may read this property.
        """
        return False

    def restart(self) -> None:
        """Discard unfinished frames. The next taxel frame has sequence number 0."""
        self._forget()
        self._sequence = -1

    def resume(self, lost_periods: int) -> None:
        """Continue after an outage: discard unfinished frames and skip ``lost_periods`` sequence numbers."""
        self._forget()
        self._sequence += lost_periods

    def node_started(self, node_id: int) -> None:
        """Record that a silent node was started."""

    def bus_was_free(self) -> None:
        """Record that a free bus has proved that no answer to an earlier SYNC can arrive (``FreeBus``)."""

    def sync(self, stamp: float, late: float = 0.0) -> TaxelFrames:
        """Process a SYNC that was sent at most ``late`` [s] after its stamp, and return the finished frames."""
        return ()

    def feed(self, can_id: int, data: bytes, stamp: float) -> TaxelFrames:
        """Process a CAN frame of this pad.

        Parameters
        ----------
        can_id : int
            COB-ID of the frame.
        data : bytes
            Data of the frame.
        stamp : float
            Stamp of the frame [s].

        Returns
        -------
        tuple of TaxelFrame
            Taxel frames finished by this CAN frame.
        """
        self._received += 1
        length, ranks = self._ranks[can_id]
        rank = ranks.get(data[:length])
        if rank is None:
            return self._lose(LossReason.SHORT if len(data) < length else LossReason.UNKNOWN_ROW)
        mapped = self._lengths[rank]
        if mapped < len(data) <= MAX_PDO_BYTES:
            self._note_padded(rank, can_id, len(data))
            data = data[:mapped]
        return self._feed_tpdo(rank, data, stamp)

    def end_period(self) -> TaxelFrames:
        """End the present period at the end of a log, and return the taxel frames that were not emitted yet."""
        raise NotImplementedError

    def facts(self) -> PadFacts:
        """Return the counts since construction. The assembler does not know the name and the nodes of its pad."""
        pending, used = self._pending(), int(self._used.sum())
        return PadFacts(
            frames_complete=self._complete, frames_incomplete=self._incomplete, frames_withheld=self._withheld,
            tpdos_expected=used + self._missing + self._losses[LossReason.INCOMPLETE], tpdos_received=self._received,
            tpdos_padded=self._padded, tpdos_used=used, tpdos_pending=pending, losses=dict(self._losses),
            used_by_node=tuple(self._used.tolist()))

    def _feed_tpdo(self, rank: int, data: bytes, stamp: float) -> TaxelFrames:
        raise NotImplementedError

    def _forget(self) -> None:
        raise NotImplementedError

    def _pending(self) -> int:
        """Return the number of TPDOs that may still be used or lost."""
        return 0

    def _note_padded(self, rank: int, can_id: int, size: int) -> None:
        """Count a TPDO that is longer than mapped, and log the first such TPDO. CiA 301 allows longer TPDOs."""
        if not self._padded:
            tpdo, mapped = SentTpdo(self._numbers[rank], can_id), self._lengths[rank]
            logger.warning('TPDO %d (COB-ID 0x%03X) has %d bytes, but the layout maps only %d. The first %d bytes are '
                           'used. If other bytes hold the taxels, correct the layout.', *tpdo, size, mapped, mapped,
                           extra={'fact': tpdo})
        self._padded += 1

    def _wrong_length(self, rank: int, data: bytes) -> LossReason | None:
        """Return the reason why data without padding do not fit the length of their TPDO, or None if they fit."""
        wanted = self._lengths[rank]
        if len(data) == wanted:
            return None
        return LossReason.SHORT if len(data) < wanted else LossReason.OVER_LONG

    def _lose(self, reason: LossReason, can_frames: int = 1) -> TaxelFrames:
        """Count lost TPDOs. Return an empty tuple, because a lost TPDO completes no taxel frame."""
        self._losses[reason] += can_frames
        return ()

    def _count_withheld(self, missing: int) -> None:
        """Count a withheld taxel frame in which ``missing`` TPDOs are missing."""
        self._withheld += 1
        self._missing += missing

    def _emit_or_withhold(self, stamp: float, sequence: int, payload: bytes | bytearray,
                          fresh: np.ndarray) -> TaxelFrames:
        """Emit a taxel frame from the ``fresh`` TPDOs (bool by rank), or withhold it and count these TPDOs as lost."""
        missing = int((~fresh).sum())
        if missing and self.drop_incomplete:
            self._count_withheld(missing)
            return self._lose(LossReason.INCOMPLETE, int(fresh.sum()))
        return self._emit_frame(stamp, sequence, payload, fresh, fresh, missing)

    def _emit_frame(self, stamp: float, sequence: int, payload: bytes | bytearray, fresh: np.ndarray,
                    used: np.ndarray, missing: int, ages: TpdoAges | None = None) -> TaxelFrames:
        """Emit a taxel frame in which ``missing`` TPDOs are missing.

        ``used`` (bool by rank) marks the TPDOs that no earlier frame contained. Only the TPDOs marked in ``used`` are
        counted as used.
        """
        self._used += np.bincount(self._senders[used], minlength=len(self._used))
        self._complete += not missing
        self._incomplete += bool(missing)
        self._missing += missing
        values, status = self._codec.decode(payload, fresh)
        return (TaxelFrame(stamp, sequence, values, status, missing, ages),)
