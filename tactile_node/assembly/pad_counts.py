"""What became of the CAN frames and taxel frames of one pad without SYNC."""

import numpy as np

from tactile_node.frames.losses import Loss, LossReason, PadStatistics, Results
from tactile_node.skin.layout import SkinLayout


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
