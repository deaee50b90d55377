"""Compute the number of bits of a sweep and the planned load of a bus."""

from collections.abc import Iterable
from math import ceil

from tactile_node.cia301.frame_bits import load_bits
from tactile_node.errors import ConfigurationError
from tactile_node.skin.layout import SkinLayout

#: Bits of a SYNC without data. The counter in a SYNC is optional (CiA 301, 7.2.5), and this driver sends none.
SYNC_BITS = load_bits(0)


def sweep_bits(layout: SkinLayout) -> int:
    """Return the number of bits of one sweep of a pad, with worst-case bit stuffing.

    A sweep has one SYNC and all TPDOs that answer it. For a pad without SYNC, only the TPDOs count. For a polled pad,
    the result is 0.

    Examples
    --------
    >>> from tactile_node.skin.layout_file import load_layout
    >>> sweep_bits(load_layout('sim16x16.yaml')) == 32 * 135 + 55
    True
    """
    sync = SYNC_BITS if layout.needs_sync else 0
    return sync + tpdo_bits(layout)


def tpdo_bits(layout: SkinLayout) -> int:
    """Return the number of bits of the TPDOs of one sweep, without SYNC, with worst-case bit stuffing."""
    return sum(load_bits(tpdo.length) for tpdo in layout.tpdos)


#: Recommended highest bus load, as a share of time. Above it, other traffic (heartbeats, SDO, EMCY) delays sweeps.
MOST_LOAD = 0.9
#: Highest bus load that the driver accepts. Above it, a few foreign frames make nodes skip sweeps.
FULL_LOAD = 0.95


def planned_load(layouts: Iterable[SkinLayout], bitrate: int, sync_period: float) -> float:
    """Return the bus load that SYNC and the TPDOs of these pads cause, with worst-case bit stuffing.

    Parameters
    ----------
    layouts : iterable of SkinLayout
        Layouts of all pads on the bus.
    bitrate : int
        Bit rate [bit/s].
    sync_period : float
        Time between two SYNCs [s]. Pads without SYNC use the period in their layout.

    Returns
    -------
    float
        Share of time for which the bus is busy. The bus cannot carry a load above 1. A polled pad counts as 0, because
        its load is not known in advance.

    Examples
    --------
    >>> from tactile_node.skin.layout_file import load_layout
    >>> round(planned_load([load_layout('sim16x16.yaml')] * 4, 1_000_000, 0.02), 4)
    0.8668
    """
    pads = tuple(layouts)
    sync = SYNC_BITS / sync_period if any(pad.needs_sync for pad in pads) else 0.0
    return (sync + sum(tpdo_bits(pad) / sweep_period(pad, sync_period) for pad in pads)) / bitrate


def refuse_full_bus(layouts: Iterable[SkinLayout], bitrate: int, sync_period: float) -> None:
    """Raise ConfigurationError if the planned load of these pads exceeds FULL_LOAD.

    The message names the shortest ``sync_period`` that the bus can carry, if there is one. The parameters are those of
    `planned_load`.
    """
    pads = tuple(layouts)
    load = planned_load(pads, bitrate, sync_period)
    if load <= FULL_LOAD:
        return
    by_sync = planned_load([pad for pad in pads if pad.needs_sync], bitrate, sync_period)
    left = FULL_LOAD - (load - by_sync)  # load available for pads with SYNC
    least = ceil(1e4 * sync_period * by_sync / left) / 1e4 if by_sync and left > 0 else 0.0
    sweeps = f'{1 / least:.1f} sweeps per second' if least else ''
    slower = f'Set sync_period to {least:g} s ({sweeps}) or more, or connect' if least else 'Connect'
    raise ConfigurationError('sync_period and layouts', got=f'{100 * load:.0f} %',
                             expected=f'a bus that is busy for {100 * FULL_LOAD:.0f} % of the time at most',
                             remedy=f'{slower} some of the pads to another bus. Set allow_full_bus to accept this '
                             'load.')


def sweep_period(layout: SkinLayout, sync_period: float) -> float:
    """Return the time between two sweeps of a pad [s].

    With SYNC it is ``sync_period``. Without SYNC it is the period in the layout. If such a device also sends when
    values change, its sweeps may come more often.
    """
    return sync_period if layout.event_driven is None else layout.event_driven.period
