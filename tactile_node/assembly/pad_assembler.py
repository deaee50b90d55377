"""What the assemblers of pads have in common: which TPDO a CAN frame is, the counts, and how a taxel frame is given."""

import logging
from collections.abc import Sequence

import numpy as np

from tactile_node.assembly.frame_source import LossReason, PadStatistics
from tactile_node.assembly.health import SentTpdo
from tactile_node.cia301.objects import MAX_PDO_BYTES
from tactile_node.skin.layout import SkinLayout
from tactile_node.skin.taxel_codec import TaxelCodec
from tactile_node.taxel_frame import TaxelFrame, TpdoAges

logger = logging.getLogger(__name__)

#: What comes of a CAN frame or a SYNC: the taxel frames that are finished, in order; often none
Frames = tuple[TaxelFrame, ...]


class PadAssembler:
    """A pure state machine of one pad: no bus, no clock. Its methods return what is finished, and count what is lost.

    ``node_ids``: those of the pad's nodes, as many as the layout has. A TPDO's rank is its place in the layout; a
    DOMAIN counts as one TPDO. Counts are from construction on; see ``PadStatistics``.
    """

    service = 'tpdo'  #: under which its CAN frames are counted

    def __init__(self, layout: SkinLayout, node_ids: Sequence[int]):
        self.drop_incomplete = False  #: withhold taxel frames that lack TPDOs
        self._codec = TaxelCodec(layout)
        self._ranks: dict[int, dict[bytes, int]] = {}  # COB-ID -> prefix -> rank
        for rank, tpdo in enumerate(layout.tpdos):
            node_id = node_ids[tpdo.node]
            self._ranks.setdefault(tpdo.cob_id.of(node_id), {})[tpdo.prefix(node_id)] = rank
        self._prefix_lengths = {can_id: len(next(iter(ranks))) for can_id, ranks in self._ranks.items()}
        self._lengths = [tpdo.length for tpdo in layout.tpdos]
        self._numbers = [tpdo.number for tpdo in layout.tpdos]
        self._padded = 0
        self.can_ids = frozenset(self._ranks)  #: COB-IDs of its CAN frames
        self._senders = np.array([tpdo.node for tpdo in layout.tpdos] or [0], np.intp)  # by rank
        self._used = np.zeros(layout.nodes, np.int64)
        self._losses = dict.fromkeys(LossReason, 0)
        self._complete = self._incomplete = self._withheld = self._missing = self._received = 0

    def restart(self) -> None:
        """Forget what is under way; the next taxel frame is number 0."""
        self._forget()
        self._sequence = -1

    def resume(self, lost_periods: int) -> None:
        """After an outage: forget what is under way, leave out ``lost_periods`` sequence numbers."""
        self._forget()
        self._sequence += lost_periods

    def start(self, node_id: int) -> None:
        """This node, which did not send, was started."""

    def sync(self, timestamp: float, late: float = 0.0) -> Frames:
        """A SYNC was on the bus, at most ``late`` [s] after its timestamp."""
        return ()

    def feed(self, can_id: int, data: bytes, timestamp: float) -> Frames:
        """One CAN frame of this pad: the taxel frames that it completes or ends, or none (more to come)."""
        self._received += 1
        length = self._prefix_lengths[can_id]
        rank = self._ranks[can_id].get(data[:length])
        if rank is None:
            return self._lose(LossReason.SHORT if len(data) < length else LossReason.UNKNOWN_ROW)
        mapped = self._lengths[rank]
        if mapped < len(data) <= MAX_PDO_BYTES:
            self._note_padded(SentTpdo(self._numbers[rank], can_id), len(data), mapped)
            data = data[:mapped]
        return self._feed_tpdo(rank, data, timestamp)

    def end_period(self) -> Frames:
        """End what is under way, since nothing follows (end of a log); the taxel frames not yet given."""
        raise NotImplementedError

    def statistics(self) -> PadStatistics:
        pending, used = self._pending(), int(self._used.sum())
        return PadStatistics(
            complete=self._complete, incomplete=self._incomplete,
            expected=used + self._missing + self._losses[LossReason.INCOMPLETE], received=self._received, used=used,
            pending=pending, losses=dict(self._losses), withheld=self._withheld, padded=self._padded,
            used_by_node=tuple(self._used.tolist()))

    def _feed_tpdo(self, rank: int, data: bytes, timestamp: float) -> Frames:
        raise NotImplementedError

    def _forget(self) -> None:
        raise NotImplementedError

    def _pending(self) -> int:
        """TPDOs that may still be used or lost."""
        return 0

    def _note_padded(self, tpdo: SentTpdo, size: int, mapped: int) -> None:
        """Count a TPDO of ``size`` bytes, of which the layout maps the first ones (CiA 301), and report the first."""
        if not self._padded:
            logger.warning('TPDO %d (COB-ID 0x%03X) has %d bytes, and the layout maps %d: the first %d are used. If '
                           'others hold the taxels, correct the layout.', *tpdo, size, mapped, mapped,
                           extra={'fact': tpdo})
        self._padded += 1

    def _wrong_length(self, rank: int, data: bytes) -> LossReason | None:
        """Why these bytes are not those of the TPDO ``rank``; None if they are. Padding is off already."""
        wanted = self._lengths[rank]
        if len(data) == wanted:
            return None
        return LossReason.SHORT if len(data) < wanted else LossReason.OVER_LONG

    def _lose(self, reason: LossReason, can_frames: int = 1) -> Frames:
        """So many TPDOs are lost: nothing comes of them."""
        self._losses[reason] += can_frames
        return ()

    def _count_withheld(self, missing: int) -> None:
        """A taxel frame was withheld, because so many TPDOs are missing in it."""
        self._withheld += 1
        self._missing += missing

    def _give(self, stamp: float, sequence: int, payload: bytes | bytearray, fresh: np.ndarray) -> Frames:
        """Give the taxel frame of the TPDOs that are ``fresh``, bool by rank; or withhold it and lose them."""
        missing = int((~fresh).sum())
        if missing and self.drop_incomplete:
            self._count_withheld(missing)
            return self._lose(LossReason.INCOMPLETE, int(fresh.sum()))
        return self._give_frame(stamp, sequence, payload, fresh, fresh, missing)

    def _give_frame(self, stamp: float, sequence: int, payload: bytes | bytearray, fresh: np.ndarray, used: np.ndarray,
                    missing: int, ages: TpdoAges | None = None) -> Frames:
        """Give it although so many TPDOs are ``missing``; it is the first with the TPDOs ``used``, bool by rank."""
        self._used += np.bincount(self._senders[used], minlength=len(self._used))
        self._complete += not missing
        self._incomplete += bool(missing)
        self._missing += missing
        values, status = self._codec.decode(payload, fresh)
        return (TaxelFrame(stamp, sequence, values, status, missing, ages),)
