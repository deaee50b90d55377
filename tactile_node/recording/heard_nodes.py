"""Whose heartbeats are in a log: with another node-ID, a pad may be put together from the TPDOs of two others."""

from collections.abc import Sequence

from tactile_node.cia301.connection_set import HEARTBEAT, node_of
from tactile_node.cia301.node_id import MAX_NODE_ID, MIN_NODE_ID
from tactile_node.skin.pads import PadSettings


class HeardNodes:
    """Of the heartbeats and boot-ups that were fed, those of other nodes on the COB-IDs of ``pads``."""

    def __init__(self, pads: Sequence[PadSettings]):
        self._neighbours = {pad.name: _neighbours(pad) for pad in pads}
        self._own = {pad.name: set(pad.node_ids) for pad in pads}
        self._heard: set[int] = set()

    def feed(self, can_id: int) -> None:
        node_id = node_of(can_id, HEARTBEAT)
        if node_id is not None:
            self._heard.add(node_id)

    def strangers(self) -> dict[str, list[int]]:
        """Return, by pad, the nodes that were heard and would send the pad's COB-IDs, where its own were not heard."""
        return {name: sorted(found) for name, neighbours in self._neighbours.items()
                if not self._heard & self._own[name] and (found := self._heard & neighbours)}


def _neighbours(pad: PadSettings) -> set[int]:
    """Node-IDs with which a device of this layout sends some of the pad's COB-IDs."""
    tpdos = pad.layout.tpdos
    own = {tpdo.cob_id.of(pad.node_ids[tpdo.node]) for tpdo in tpdos}
    return {node_id for node_id in range(MIN_NODE_ID, MAX_NODE_ID + 1) if node_id not in pad.node_ids
            and any(tpdo.cob_id.of(node_id) in own for tpdo in tpdos if tpdo.cob_id.relative)}
