"""Turn the facts of ``health`` into sentences for logs, /diagnostics and status messages."""

from math import isnan

from tactile_node.assembly.health import (
    BusFault,
    Failure,
    NodeFault,
    SentTpdo,
    SyncState,
    TpdoOrder,
)
from tactile_node.errors import BusError, ConfigurationError, DeviceAbsentError, DeviceError, LogError, TactileError

_REACTIONS = {
    NodeFault.SILENT: 'The driver configures and starts it as soon as it answers.',
    NodeFault.NO_SYNC: 'Start the SYNC producer, or set produce_sync.',
    NodeFault.TPDO_MISSING: 'The driver checks its configuration while it sends.',
    NodeFault.TWO_SENDERS: 'The driver publishes none of its values until one of the devices is gone.'}

_FAULTS: tuple[tuple[type[TactileError], BusFault], ...] = (
    (BusError, BusFault.NOT_OPENED), (LogError, BusFault.LOG_UNUSABLE),
    (DeviceAbsentError, BusFault.DEVICE_ABSENT), (DeviceError, BusFault.DEVICE_UNUSABLE),
    (ConfigurationError, BusFault.WRONG_CONFIGURATION))


def failure_of(error: Exception) -> Failure:
    """Return the bus fault that corresponds to an error, with the error's text.

    An error that is not a `TactileError` becomes INTERNAL_ERROR.
    """
    if not isinstance(error, TactileError):
        return Failure(BusFault.INTERNAL_ERROR, f'{type(error).__name__}: {error}')
    return Failure(next((fault for kind, fault in _FAULTS if isinstance(error, kind)), BusFault.NOT_KNOWN), str(error))


def tpdos_text(tpdos: tuple[SentTpdo, ...]) -> str:
    """Name each TPDO once, because several frames may belong to one multiplexed TPDO.

    Examples
    --------
    >>> tpdos_text((SentTpdo(1, 0x1A0), SentTpdo(1, 0x1A0), SentTpdo(3, 0x3A0)))
    'TPDO 1 (COB-ID 0x1A0), TPDO 3 (COB-ID 0x3A0)'
    """
    return ', '.join(f'TPDO {number} (COB-ID 0x{can_id:03X})' for number, can_id in dict.fromkeys(tpdos))


def order_text(order: TpdoOrder) -> str:
    """Return a clause about a node whose TPDO order differs from the layout, without a full stop.

    Examples
    --------
    >>> order_text(TpdoOrder(32, ('1', '2', '3'), ('3', '1', '2')))
    'it sends its TPDOs in the order 1, 2, 3, and the layout has 3, 1, 2'
    """
    return f'it sends its TPDOs in the order {", ".join(order.sent)}, and the layout has {", ".join(order.layout)}'


def sync_text(sync: SyncState) -> str:
    """Return a clause about a SYNC fault, without a full stop, or '' if there is no fault.

    Examples
    --------
    >>> from tactile_node.assembly.health import SyncFault
    >>> sync_text(SyncState(SyncFault.OTHER_PERIOD, period=0.04))
    'the period of SYNC differs from sync_period: 40.0 ms'
    """
    if not sync.fault.is_fault:
        return ''
    return sync.fault.phrase + (
        f': {sync.foreign} SYNCs so far' if isnan(sync.period) else f': {1e3 * sync.period:.1f} ms')


def load_text(load: float, pads: int) -> str:
    """Return a clause about the planned load of a bus, without a full stop.

    Parameters
    ----------
    load : float
        Planned load as a share of time; the bus cannot carry a load above 1.
    pads : int
        Number of pads on the bus.

    Examples
    --------
    >>> load_text(1.3015, 3)
    'the bus would be busy for 130 % of the time with 3 pads, more than it can carry'
    """
    beyond = ', more than it can carry' if load > 1 else ''
    return f'the bus would be busy for {100 * load:.0f} % of the time with {pads} pad{"s" * (pads > 1)}{beyond}'


def reaction_text(fault: NodeFault) -> str:
    """Return a sentence that says how the driver reacts to a fault, or what the user can do."""
    return _REACTIONS.get(fault, 'The driver configures and starts it again.')


def node_label(pad: str, node_id: int) -> str:
    """Return the node label that begins a message."""
    return f'Node {node_id} (pad {pad!r})'
