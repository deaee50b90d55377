"""Whether pads can share one CAN bus: node-IDs, names, COB-IDs and SYNC must not collide."""

from tactile_node.cia301.cob_id import ID_MASK
from tactile_node.cia301.connection_set import EMCY, reserved_for
from tactile_node.errors import ConfigurationError
from tactile_node.skin.pads import LivePad, PadSettings, check_node_ids


def check_pads(pads: tuple[PadSettings, ...]) -> None:
    """Raise ConfigurationError when these pads cannot share one bus."""
    if not pads:
        raise ConfigurationError('pads', expected='at least one pad on the bus', got='none',
                                 remedy='Name a pad.')
    for pad in pads:
        check_node_ids(pad)
    _check_names_and_sync(pads)
    owners: dict[int, str] = {}
    for pad in pads:
        for node_id in pad.node_ids:
            _own(owners, EMCY + node_id, f'EMCY of node {node_id}', pad.name)
    for sync in {pad.layout.sync_cob_id for pad in pads}:
        _own(owners, sync, 'SYNC', 'all')
    for pad in pads:
        for tpdo in pad.layout.tpdos:
            node_id = pad.node_ids[tpdo.node]
            _own(owners, tpdo.cob_id.of(node_id), f'TPDO {tpdo.number} of node {node_id}', pad.name)


def live_pads(pads: tuple[PadSettings, ...]) -> tuple[LivePad, ...]:
    """The same pads; ConfigurationError when one is without the EDS that a live bus needs."""
    return tuple(_live(pad) for pad in pads)


def _live(pad: PadSettings) -> LivePad:
    if not isinstance(pad, LivePad):
        raise ConfigurationError(f'pad {pad.name!r}', expected='an EDS, for a live bus', got='none',
                                 remedy='Make the pad with make_pad(name, node_id, layout, eds).')
    return pad


def _own(owners: dict[int, str], can_id: int, use: str, pad: str) -> None:
    where = f'pad {pad!r}, {use}'
    if reason := reserved_for(can_id) or ('more than 11 bits' if can_id > ID_MASK else None):
        raise ConfigurationError(where, expected='a COB-ID that CiA 301 does not reserve',
                                 got=f'0x{can_id:03X} ({reason})',
                                 remedy='Change node_id, or cob_id in the layout.')
    if (other := owners.setdefault(can_id, where)) != where:
        raise ConfigurationError(where, expected='a COB-ID that is used only once', got=f'0x{can_id:03X}, as {other}',
                                 remedy='Change node_id, or cob_id in the layout.')


def _check_names_and_sync(pads: tuple[PadSettings, ...]) -> None:
    for key, values in (('name', [pad.name for pad in pads]),
                        ('node_id', [node_id for pad in pads for node_id in pad.node_ids])):
        if len(set(values)) != len(values):
            raise ConfigurationError('pads', expected=f'a different {key} for each', got=str(values),
                                     remedy='Give every pad a different one.')
    syncs = {pad.layout.sync_cob_id for pad in pads}
    if len(syncs) > 1:
        raise ConfigurationError('pads', expected='one SYNC COB-ID on a bus',
                                 got=', '.join(map(hex, sorted(syncs))),
                                 remedy='Use the same sync_cob_id in their layouts.')
