"""Describe the pads of one CAN bus (names, node-IDs, layouts and EDS), and check that they can share the bus."""

import itertools
import logging
from collections.abc import Sequence
from dataclasses import dataclass, field

from canopen import ObjectDictionary

from tactile_node.cia301.objects import EMCY, ID_MASK, MAX_NODE_ID, MIN_NODE_ID, reserved_for
from tactile_node.errors import ConfigurationError
from tactile_node.package_files import is_found
from tactile_node.skin.eds import load_eds
from tactile_node.skin.eds_rules import Identity, check_against, identity_of
from tactile_node.skin.field_hints import field_hints
from tactile_node.skin.layout import SkinLayout
from tactile_node.skin.layout_file import load_layout

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class PadSettings:
    """One pad: its name, the node-IDs of its CANopen nodes, and its layout.

    A PadSettings is sufficient for a recorded log. A live bus needs a `LivePad`.
    """

    name: str
    node_ids: tuple[int, ...]
    layout: SkinLayout


@dataclass(frozen=True)
class CanopenNode:
    """One CANopen node of a pad on a live bus."""

    node_id: int
    pad: str  #: name of the pad
    position: int  #: number of the node among the pad's nodes, from 0
    layout: SkinLayout  #: part of the pad's layout that this node sends
    eds: str  #: path of the EDS file
    dictionary: ObjectDictionary = field(repr=False, compare=False)  #: object dictionary from the EDS for the node-ID

    @property
    def label(self) -> str:
        """Description of the node and the pad for messages."""
        return f'node {self.node_id} (pad {self.pad!r})'


@dataclass(frozen=True)
class LivePad(PadSettings):
    """A pad on a live bus, with an object dictionary for each node."""

    nodes: tuple[CanopenNode, ...]


def make_pad(name: str, node_id: int, layout: str, eds: str = '') -> LivePad:
    """Return a pad with a single node and an EDS, as in `make_pads`."""
    return with_dictionaries(make_pads([layout], [node_id], [name]), [eds])[0]


def make_pads(layouts: Sequence[str], node_ids: Sequence[int], names: Sequence[str] = ()) -> tuple[PadSettings, ...]:
    """Return pads without an EDS, which suffice for a log.

    Parameters
    ----------
    layouts
        Layout of each pad, or one layout for all pads.
    node_ids
        Node-IDs of all pads. Each pad takes as many node-IDs, in order, as its layout has nodes.
    names
        Name of each pad. Without names, each pad is named after its first node, for example pad32.

    Raises
    ------
    ConfigurationError
        Raised if a layout is invalid, or if the numbers of layouts, node-IDs and names are inconsistent.

    Examples
    --------
    >>> [(pad.name, pad.node_ids) for pad in make_pads(['sim16x16.yaml'], [32, 64])]
    [('pad32', (32,)), ('pad64', (64,))]
    """
    loaded = [load_layout(layout) for layout in one_for_each('layouts', layouts, names or layouts)]
    if len(loaded) == 1 and not names:
        loaded *= max(1, len(node_ids) // loaded[0].nodes)
    if sum(layout.nodes for layout in loaded) != len(node_ids):
        needed = ' + '.join(str(layout.nodes) for layout in loaded)
        raise ConfigurationError('node-IDs', expected=f"{needed} node-IDs, one for each of the pads' nodes",
                                 got=str(list(node_ids)),
                                 remedy='Give one node-ID for each pad, or several if its layout has "nodes".')
    left = iter(node_ids)
    shared = [tuple(itertools.islice(left, layout.nodes)) for layout in loaded]
    pads = tuple(PadSettings(name, shares, layout) for name, shares, layout
                 in zip(names or [f'pad{first}' for first, *_ in shared], shared, loaded))
    for pad in pads:
        check_node_ids(pad)
    return pads


def with_dictionaries(pads: Sequence[PadSettings], eds: Sequence[str] = ('',)) -> tuple[LivePad, ...]:
    """Return the pads with their EDS, which a live bus needs, and check that each EDS matches the layout.

    Parameters
    ----------
    pads
        Pads without an EDS.
    eds
        EDS of each pad, or one EDS for all pads. '' means the layout's name with the suffix .eds. The EDS is read
        separately for each node of a pad.

    Raises
    ------
    ConfigurationError
        Raised if an EDS cannot be read or does not match the layout.
    """
    return tuple(_with_dictionary(pad, path) for pad, path in zip(pads, one_for_each('eds', eds, pads)))


def identities_of(pads: Sequence[PadSettings], eds: Sequence[str] = ('',)) -> dict[str, Identity]:
    """Return the identity from each pad's EDS, by pad name.

    Pads without an EDS next to the layout are omitted, because a log needs no EDS.

    Parameters
    ----------
    pads
        Pads of the log.
    eds
        EDS of each pad, or one EDS for all pads. '' means the layout's name with the suffix .eds.

    Raises
    ------
    ConfigurationError
        Raised if a given or existing EDS cannot be read.
    """
    paths = zip(pads, one_for_each('eds', eds, pads))
    read = [(pad, _eds_path(pad, path)) for pad, path in paths if path or is_found(_eds_path(pad, path))]
    return {pad.name: identity_of(load_eds(path, pad.node_ids[0]), path) for pad, path in read}


def check_node_ids(pad: PadSettings) -> None:
    """Raise ConfigurationError if a node-ID is out of range, or if the number of node-IDs does not match the layout."""
    for node_id in pad.node_ids:
        if not MIN_NODE_ID <= node_id <= MAX_NODE_ID:
            raise ConfigurationError(f'pad {pad.name!r}', expected=f'a node-ID {MIN_NODE_ID}..{MAX_NODE_ID}',
                                     got=str(node_id), remedy='Give the node-ID that is set on the device.')
    if len(pad.node_ids) != pad.layout.nodes:
        raise ConfigurationError(f'pad {pad.name!r}', expected=f'{pad.layout.nodes} node-IDs for {pad.layout.source}',
                                 got=str(list(pad.node_ids)), remedy='Give one node-ID for each node.')


def one_for_each(what: str, given: Sequence[str], pads: Sequence[object]) -> list[str]:
    """Return one value per pad. Raises ConfigurationError unless ``given`` has a single value or one value per pad."""
    if len(given) not in (1, len(pads)):
        raise ConfigurationError(what, expected=f'one value, or one for each of the {len(pads)} pads',
                                 got=str(list(given)), remedy='Give one value for each pad.')
    return list(given) * (len(pads) if len(given) == 1 else 1)


def _eds_path(pad: PadSettings, path: str) -> str:
    return path or pad.layout.source.rsplit('.', 1)[0] + '.eds'


def _with_dictionary(pad: PadSettings, path: str) -> LivePad:
    path = _eds_path(pad, path)
    nodes = tuple(CanopenNode(node_id, pad.name, position, pad.layout.of_node(position), eds=path,
                              dictionary=load_eds(path, node_id))
                  for position, node_id in enumerate(pad.node_ids))
    check_against(nodes[0].dictionary, pad.layout, path)
    for hint in field_hints(pad.layout, nodes[0].dictionary):
        logger.warning('%s: %s.', pad.layout.source, hint)
    return LivePad(pad.name, pad.node_ids, pad.layout, nodes)


def check_pads(pads: tuple[PadSettings, ...]) -> None:
    """Raise ConfigurationError if the pads cannot share one bus."""
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
    """Return ``pads`` unchanged. Raises ConfigurationError if a pad has no EDS, which a live bus needs."""
    return tuple(_live(pad) for pad in pads)


def _live(pad: PadSettings) -> LivePad:
    if not isinstance(pad, LivePad):
        raise ConfigurationError(f'pad {pad.name!r}', expected='an EDS, which a live bus needs', got='none',
                                 remedy='Create the pad with make_pad(name, node_id, layout, eds).')
    return pad


def _own(owners: dict[int, str], can_id: int, use: str, pad: str) -> None:
    where = f'pad {pad!r}, {use}'
    if reason := reserved_for(can_id) or ('more than 11 bits' if can_id > ID_MASK else None):
        raise ConfigurationError(where, expected='a COB-ID that CiA 301 does not reserve',
                                 got=f'0x{can_id:03X} ({reason})',
                                 remedy='Change the node-ID, or cob_id in the layout.')
    if (other := owners.setdefault(can_id, where)) != where:
        raise ConfigurationError(where, expected='a COB-ID that is used only once', got=f'0x{can_id:03X}, as {other}',
                                 remedy='Change the node-ID, or cob_id in the layout.')


def _check_names_and_sync(pads: tuple[PadSettings, ...]) -> None:
    # The node-IDs come first, because the name of a pad may be made from its node-ID.
    for key, values in (('node-ID', [node_id for pad in pads for node_id in pad.node_ids]),
                        ('name', [pad.name for pad in pads])):
        if len(set(values)) != len(values):
            raise ConfigurationError('pads', expected=f'a different {key} for each', got=str(values),
                                     remedy=f'Give every pad its own {key}.')
    syncs = {pad.layout.sync_cob_id for pad in pads}
    if len(syncs) > 1:
        raise ConfigurationError('pads', expected='a single COB-ID for SYNC on the bus',
                                 got=', '.join(map(hex, sorted(syncs))),
                                 remedy='Use the same sync_cob_id in all layouts.')
