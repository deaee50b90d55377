"""How much of a bus's time its pads will take, by their layouts: known before anything is on the bus."""

from collections.abc import Iterable

from tactile_node.bus.sweep_bits import SYNC_BITS, tpdo_bits
from tactile_node.skin.layout import SkinLayout

MOST_LOAD = 0.9  #: of the bus's time; beyond, other traffic (heartbeats, SDO, EMCY) delays sweeps


def planned_load(layouts: Iterable[SkinLayout], bitrate: int, sync_period: float) -> float:
    """Return the share of the bus's time that SYNC and the TPDOs of these pads take, bit stuffing at its worst.

    Above 1 the bus cannot carry them. ``bitrate`` [bit/s], ``sync_period`` [s]; pads without SYNC have their own
    period. Of a polled pad nothing is known: it counts as 0.

    >>> from tactile_node.skin.layout_file import load_layout
    >>> round(planned_load([load_layout('sim16x16.yaml')] * 4, 1_000_000, 0.02), 4)
    0.8668
    """
    pads = tuple(layouts)
    sync = SYNC_BITS / sync_period if any(pad.needs_sync for pad in pads) else 0.0
    return (sync + sum(tpdo_bits(pad) / sweep_period(pad, sync_period) for pad in pads)) / bitrate


def sweep_period(layout: SkinLayout, sync_period: float) -> float:
    """Return the least time between two sweeps [s]; without SYNC the device's own, beside what changes add."""
    return sync_period if layout.event_driven is None else layout.event_driven.period
