"""The load of a bus: bits of a sweep, planned load."""

from collections.abc import Iterable
from math import ceil

from tactile_node.cia301.frame_bits import load_bits
from tactile_node.errors import ConfigurationError
from tactile_node.skin.layout import SkinLayout

SYNC_BITS = load_bits(0)  #: SYNC has no data here (CiA 301, 7.2.5: its counter is optional)


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
    return sum(load_bits(tpdo.length) for tpdo in layout.tpdos)


MOST_LOAD = 0.9  #: share of the bus's time; beyond, other traffic (heartbeats, SDO, EMCY) delays sweeps
FULL_LOAD = 0.95  #: beyond, a few foreign frames make nodes leave out sweeps


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


def refuse_full_bus(layouts: Iterable[SkinLayout], bitrate: int, sync_period: float) -> None:
    """Raise ConfigurationError, with the rate that fits, where the load of these pads would be above FULL_LOAD."""
    pads = tuple(layouts)
    load = planned_load(pads, bitrate, sync_period)
    if load <= FULL_LOAD:
        return
    by_sync = planned_load([pad for pad in pads if pad.needs_sync], bitrate, sync_period)
    left = FULL_LOAD - (load - by_sync)  # by pads that have their own period
    least = ceil(1e4 * sync_period * by_sync / left) / 1e4 if by_sync and left > 0 else 0.0
    slower = f'a sync_period of {least:g} s ({1 / least:.1f} sweeps a second) or more, or ' if least else ''
    raise ConfigurationError('sync_period and layouts', got=f'{100 * load:.0f} %',
                             expected=f'a bus that is busy for {100 * FULL_LOAD:.0f} % of the time at most',
                             remedy=f'Give {slower}some of the pads another bus; allow_full_bus lets it be.')


def sweep_period(layout: SkinLayout, sync_period: float) -> float:
    """Return the least time between two sweeps [s]; without SYNC the device's own, beside what changes add."""
    return sync_period if layout.event_driven is None else layout.event_driven.period
