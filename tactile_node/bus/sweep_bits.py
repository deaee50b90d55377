"""What a pad's sweep costs on the wire."""

from tactile_node.bus.bus_monitor import FRAME_BITS
from tactile_node.cia301.pdo import MAX_PDO_BYTES
from tactile_node.skin.layout import SkinLayout


def sweep_bits(layout: SkinLayout) -> int:
    """Return the bits of a SYNC and all TPDOs that answer it, with bit stuffing at its worst; 0 for a polled pad.

    >>> from tactile_node.skin.layout_file import load_layout
    >>> sweep_bits(load_layout('sim16x16.yaml')) == 32 * 135 + 55
    True
    """
    if not layout.needs_sync:
        return 0
    return FRAME_BITS[0] + sum(FRAME_BITS[min(tpdo.length, MAX_PDO_BYTES)] for tpdo in layout.tpdos)
