"""Which TPDO of a layout a CAN frame is: by its COB-ID and, where it is multiplexed, its first bytes."""

from collections.abc import Sequence

import numpy as np

from tactile_node.assembly.frame_source import Loss, LossReason, PadStatistics, Results
from tactile_node.skin.layout import SkinLayout


class TpdoTable:
    """The ranks of a pad's TPDOs: their places in the layout. ``node_ids``: those of the pad's nodes."""

    def __init__(self, layout: SkinLayout, node_ids: Sequence[int]):
        self._ranks: dict[int, dict[bytes, int]] = {}  # COB-ID -> prefix -> rank
        for rank, tpdo in enumerate(layout.tpdos):
            node_id = node_ids[tpdo.node]
            self._ranks.setdefault(tpdo.cob_id.of(node_id), {})[tpdo.prefix(node_id)] = rank
        self._prefix_lengths = {can_id: len(next(iter(ranks))) for can_id, ranks in self._ranks.items()}
        self._lengths = [tpdo.length for tpdo in layout.tpdos]

    @property
    def can_ids(self) -> frozenset[int]:
        return frozenset(self._ranks)

    def rank(self, can_id: int, data: bytes) -> int | LossReason:
        """The rank of a frame of this pad, or why it has none."""
        length = self._prefix_lengths[can_id]
        rank = self._ranks[can_id].get(data[:length])
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
    """Counts up from construction; see ``PadStatistics``."""

    def __init__(self, layout: SkinLayout):
        self._nodes = np.array([tpdo.node for tpdo in layout.tpdos], np.intp)  # by rank
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
            used_by_node=tuple(int(count) for count in self._used))
