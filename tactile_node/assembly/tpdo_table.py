"""Which TPDO of a layout a CAN frame is: by its COB-ID and, where it is multiplexed, its first bytes."""

from collections.abc import Sequence

from tactile_node.frames.losses import LossReason
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
