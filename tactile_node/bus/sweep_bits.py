"""What a pad's sweep costs on the wire."""

from tactile_node.bus.bus_monitor import FRAME_BITS
from tactile_node.cia301.pdo import MAX_PDO_BYTES
from tactile_node.skin.layout import SkinLayout

SYNC_BITS = FRAME_BITS[0]  #: SYNC has no data here (CiA 301, 7.2.5: its counter is optional)


def sweep_bits(layout: SkinLayout) -> int:
    """Return the bits of a SYNC and all TPDOs that answer it, with bit stuffing at its worst; 0 for a polled pad.

    Without SYNC, those of all TPDOs once.

    >>> from tactile_node.skin.layout_file import load_layout
    >>> sweep_bits(load_layout('sim16x16.yaml')) == 32 * 135 + 55
    True
    """
    sync = SYNC_BITS if layout.needs_sync else 0
    return sync + tpdo_bits(layout)


def tpdo_bits(layout: SkinLayout) -> int:
    """Return the bits of all TPDOs of a sweep, likewise."""
    return sum(FRAME_BITS[min(tpdo.length, MAX_PDO_BYTES)] for tpdo in layout.tpdos)
