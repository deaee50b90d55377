"""Compute the number of bits in a sweep and the planned load of a bus."""

from collections.abc import Iterable
from math import ceil

from tactile_node.cia301.frame_bits import load_bits
from tactile_node.errors import ConfigurationError
from tactile_node.skin.layout import SkinLayout

#: Number of bits in a SYNC without data. The SYNC counter is optional (CiA 301, 7.2.5), and this driver sends none.
SYNC_BITS = load_bits(0)


def sweep_bits(layout: SkinLayout) -> int:
    """Return the number of bits of one sweep of a pad, with worst-case bit stuffing.

    A sweep consists of one SYNC and all TPDOs that answer it. For a pad without SYNC, the result counts only the TPDOs.
    For a polled pad, the result is 0.

    Examples
    --------
    >>> from tactile_node.skin.layout_file import load_layout
    >>> sweep_bits(load_layout('sim16x16.yaml')) == 32 * 135 + 55
    True
    """
    sync = SYNC_BITS if layout.needs_sync else 0
    return sync + tpdo_bits(layout)


def tpdo_bits(layout: SkinLayout) -> int:
    """Return the number of bits in the TPDOs of one sweep, without SYNC, with worst-case bit stuffing."""
    return sum(load_bits(tpdo.length) for tpdo in layout.tpdos)


#: Highest recommended bus load, as a share of time. Above this load, other traffic (heartbeats, SDO, EMCY) delays
#: sweeps.
MOST_LOAD = 0.9
#: Highest bus load that the driver accepts. Above this load, a few foreign frames cause nodes to skip sweeps.
FULL_LOAD = 0.95


def planned_load(layouts: Iterable[SkinLayout], bitrate: int, sync_period: float) -> float:
    """Return the bus load caused by SYNC and the TPDOs of these pads, with worst-case bit stuffing.

    Parameters
    ----------
    layouts : iterable of SkinLayout
        Layouts of all pads on the bus.
    bitrate : int
        Bit rate [bit/s].
    sync_period : float
        Time between two SYNCs [s]. A pad without SYNC uses the period in its layout instead.

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
    """Raise ConfigurationError if the planned load of the pads exceeds FULL_LOAD.

    The message states the shortest ``sync_period`` that the bus can carry, if there is one. See `planned_load` for the
    parameters.
    """
    pads = tuple(layouts)
    load = planned_load(pads, bitrate, sync_period)
    if load <= FULL_LOAD:
        return
    by_sync = planned_load([pad for pad in pads if pad.needs_sync], bitrate, sync_period)
    left = FULL_LOAD - (load - by_sync)  # bus load that remains for pads with SYNC
    least = ceil(1e4 * sync_period * by_sync / left) / 1e4 if by_sync and left > 0 else 0.0
    sweeps = f'{1 / least:.1f} sweeps per second' if least else ''
    slower = f'Set sync_period to {least:g} s ({sweeps}) or more, or connect' if least else 'Connect'
    raise ConfigurationError('sync_period and layouts', got=f'{100 * load:.0f} %',
                             expected=f'a bus load of at most {100 * FULL_LOAD:.0f} %',
                             remedy=f'{slower} some of the pads to another bus. Set allow_full_bus to accept this '
                             'load.')


def sweep_period(layout: SkinLayout, sync_period: float) -> float:
    """Return the time between two sweeps of a pad [s].

    For a pad with SYNC, that time is ``sync_period``. For a pad without SYNC, that time is the period in its layout. A
    device without SYNC that also sends when values change may send sweeps more often.
    """
    return sync_period if layout.event_driven is None else layout.event_driven.period
