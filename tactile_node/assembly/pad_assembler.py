"""What the assemblers of pads have in common: which TPDO a CAN frame is, the counts, and how a taxel frame is given."""

from collections.abc import Sequence

import numpy as np

from tactile_node.assembly.frame_source import Loss, LossReason, PadStatistics, Results
from tactile_node.skin.layout import SkinLayout
from tactile_node.skin.taxel_codec import TaxelCodec
from tactile_node.taxel_frame import TaxelFrame


class TpdoTable:
    """The ranks of a pad's TPDOs: their places in the layout. ``node_ids``: those of the pad's nodes."""

    def __init__(self, layout: SkinLayout, node_ids: Sequence[int]):
        self.ranks: dict[int, dict[bytes, int]] = {}  # COB-ID -> prefix -> rank
        for rank, tpdo in enumerate(layout.tpdos):
            node_id = node_ids[tpdo.node]
            self.ranks.setdefault(tpdo.cob_id.of(node_id), {})[tpdo.prefix(node_id)] = rank
        self._prefix_lengths = {can_id: len(next(iter(ranks))) for can_id, ranks in self.ranks.items()}
        self._lengths = [tpdo.length for tpdo in layout.tpdos]

    def rank(self, can_id: int, data: bytes) -> int | LossReason:
        """The rank of a frame of this pad, or why it has none."""
        length = self._prefix_lengths[can_id]
        rank = self.ranks[can_id].get(data[:length])
        if rank is None:
            return LossReason.SHORT if len(data) < length else LossReason.UNKNOWN_ROW
        return rank

    def wrong_length(self, rank: int, data: bytes) -> LossReason | None:
        """Why these bytes are not what the layout maps to the TPDO ``rank``; None if they are."""
        wanted = self._lengths[rank]
        if len(data) == wanted:
            return None
        return LossReason.SHORT if len(data) < wanted else LossReason.OVER_LONG


class PadCounts:
    """Counts up from construction; see ``PadStatistics``. A DOMAIN counts as one TPDO."""

    def __init__(self, layout: SkinLayout):
        self._nodes = np.array([tpdo.node for tpdo in layout.tpdos] or [0], np.intp)  # by rank
        self._used = np.zeros(layout.nodes, np.int64)
        self._losses = dict.fromkeys(LossReason, 0)
        self._complete = 0
        self._incomplete = 0
        self._withheld = 0
        self._missing = 0
        self.received = 0

    def lose(self, reason: LossReason, can_frames: int = 1) -> Results:
        """So many TPDOs are lost."""
        self._losses[reason] += can_frames
        return (Loss(reason, can_frames),) if can_frames else ()

    def give(self, used: np.ndarray, missing: int) -> None:
        """A taxel frame was given, the first with the TPDOs ``used``, bool by rank; so many are missing in it."""
        self._used += np.bincount(self._nodes[used], minlength=len(self._used))
        self._complete += not missing
        self._incomplete += bool(missing)
        self._missing += missing

    def withhold(self, missing: int) -> None:
        """A taxel frame was withheld, because so many TPDOs are missing in it."""
        self._withheld += 1
        self._missing += missing

    def statistics(self, pending: int) -> PadStatistics:
        used = int(self._used.sum())
        return PadStatistics(
            complete=self._complete, incomplete=self._incomplete,
            expected=used + self._missing + self._losses[LossReason.INCOMPLETE], received=self.received, used=used,
            pending=pending, losses=dict(self._losses), withheld=self._withheld,
            used_by_node=tuple(self._used.tolist()))


class PadAssembler:
    """A pure state machine of one pad: no bus, no clock. Its methods return taxel frames that are finished, and losses.

    ``node_ids``: those of the pad's nodes, as many as the layout has.
    """

    service = 'tpdo'  #: under which its CAN frames are counted

    def __init__(self, layout: SkinLayout, node_ids: Sequence[int], drop_incomplete: bool = False):
        self.drop_incomplete = drop_incomplete  #: withhold taxel frames that lack TPDOs
        self._codec = TaxelCodec(layout)
        self._table = TpdoTable(layout, node_ids)
        self.can_ids = frozenset(self._table.ranks)  #: COB-IDs of its CAN frames
        self._counts = PadCounts(layout)

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

    def sync(self, timestamp: float) -> Results:
        """A SYNC was on the bus."""
        return ()

    def feed(self, can_id: int, data: bytes, timestamp: float) -> Results:
        """One CAN frame of this pad: the taxel frames that it completes or ends, losses, or nothing (more to come)."""
        raise NotImplementedError

    def end_period(self) -> Results:
        """End what is under way, since nothing follows (end of a log); the taxel frames not yet given."""
        raise NotImplementedError

    def statistics(self) -> PadStatistics:
        return self._counts.statistics(self._pending())

    def _forget(self) -> None:
        raise NotImplementedError

    def _pending(self) -> int:
        """TPDOs that may still be used or lost."""
        return 0

    def _give(self, stamp: float, sequence: int, payload: bytes | bytearray, fresh: np.ndarray) -> Results:
        """Give the taxel frame of the TPDOs that are ``fresh``, bool by rank; or withhold it and lose them."""
        missing = int((~fresh).sum())
        if missing and self.drop_incomplete:
            self._counts.withhold(missing)
            return self._counts.lose(LossReason.INCOMPLETE, int(fresh.sum()))
        self._counts.give(fresh, missing)
        values, status = self._codec.decode(payload, fresh)
        return (TaxelFrame(stamp, sequence, values, status, missing),)
