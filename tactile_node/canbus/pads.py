"""The pads of one CAN bus: who they are, and whether they can share it."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from canopen import ObjectDictionary

from tactile_node.canbus.cob_id import reserved_for
from tactile_node.canbus.eds import check_against, load_eds
from tactile_node.canbus.layout import SkinLayout
from tactile_node.canbus.layout_file import load_layout
from tactile_node.errors import ConfigurationError

EMCY = 0x80  # + node-ID, CiA 301
MAX_NODE_ID = 127


@dataclass(frozen=True)
class PadSettings:
    """One pad: its name, the CANopen node that sends it, what the node's TPDOs mean and the node's EDS.

    Where several nodes make up the pad, ``further_nodes`` are the others' node-IDs; one EDS serves all.
    """

    name: str
    node_id: int
    layout: SkinLayout
    eds: str = ''  #: path; only a live bus needs it
    dictionary: ObjectDictionary | None = field(default=None, repr=False, compare=False)
    further_nodes: tuple[int, ...] = ()

    @property
    def node_ids(self) -> tuple[int, ...]:
        return self.node_id, *self.further_nodes

    @property
    def who(self) -> str:
        """The node and its pad, for messages."""
        return f'node {self.node_id} (pad {self.name!r})'

    @property
    def nodes(self) -> 'tuple[PadSettings, ...]':
        """The pad's nodes, each as a pad of the same name with only the TPDOs that this node sends."""
        return tuple(replace(self, node_id=node_id, layout=self.layout.of_node(i), further_nodes=())
                     for i, node_id in enumerate(self.node_ids)) if self.further_nodes else (self,)


def make_pad(name: str, node_id: int, layout: str, eds: str = '', further_nodes: Sequence[int] = ()) -> PadSettings:
    """Load layout and EDS (default: same name, suffix .eds) and check that they agree.

    Raises ConfigurationError.
    """
    loaded = load_layout(layout)
    pad = PadSettings(name, node_id, loaded, further_nodes=tuple(further_nodes))
    _check_node_ids(pad)
    eds = eds or loaded.source.rsplit('.', 1)[0] + '.eds'
    dictionary = load_eds(eds, node_id)
    check_against(dictionary, loaded, eds)
    return replace(pad, eds=eds, dictionary=dictionary)


def share_node_ids(layouts: Sequence[str], node_ids: Sequence[int]) -> list[tuple[int, ...]]:
    """Give each pad, in order, as many of ``node_ids`` as its layout has nodes; one layout may serve all pads.

    Raises ConfigurationError when they are too many or too few.
    """
    nodes = [load_layout(layout).nodes for layout in layouts]
    if len(nodes) == 1:
        nodes *= max(1, len(node_ids) // nodes[0])
    if sum(nodes) != len(node_ids):
        needed = ' + '.join(map(str, nodes))
        raise ConfigurationError('node-IDs', expected=f"a node-ID for each of the pads' nodes: {needed} of them",
                                 got=str(list(node_ids)),
                                 remedy='Give one for each pad; several where its layout says "nodes".')
    left = iter(node_ids)
    return [tuple(itertools.islice(left, count)) for count in nodes]


def check_pads(pads: tuple[PadSettings, ...]) -> None:
    """Raise ConfigurationError when these pads cannot share one bus."""
    if not pads:
        raise ConfigurationError('pads', expected='at least one pad on the bus', got='none',
                                 remedy='Name a pad.')
    for pad in pads:
        _check_node_ids(pad)
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


def _check_node_ids(pad: PadSettings) -> None:
    for node_id in pad.node_ids:
        if not 1 <= node_id <= MAX_NODE_ID:
            raise ConfigurationError(f'pad {pad.name!r}', expected=f'a node-ID 1..{MAX_NODE_ID}', got=str(node_id),
                                     remedy='Give the node-ID set on the device.')
    if len(pad.node_ids) != pad.layout.nodes:
        raise ConfigurationError(f'pad {pad.name!r}', expected=f'{pad.layout.nodes} node-IDs for {pad.layout.source}',
                                 got=str(list(pad.node_ids)), remedy='Give one for each of its nodes.')


def check_dictionaries(pads: tuple[PadSettings, ...]) -> None:
    """Raise ConfigurationError for a pad without the EDS that a live bus needs."""
    for pad in pads:
        if pad.dictionary is None:
            raise ConfigurationError(f'pad {pad.name!r}', expected='an EDS, for a live bus', got='none',
                                     remedy='Make the pad with make_pad(name, node_id, layout, eds).')


def _own(owners: dict[int, str], can_id: int, use: str, pad: str) -> None:
    where = f'pad {pad!r}, {use}'
    if reason := reserved_for(can_id) or ('more than 11 bits' if can_id > 0x7FF else None):
        raise ConfigurationError(where, expected='a COB-ID that CiA 301 leaves free',
                                 got=f'0x{can_id:03X} ({reason})',
                                 remedy='Change node_id, or cob_id in the layout.')
    if (other := owners.setdefault(can_id, where)) != where:
        raise ConfigurationError(where, expected='a COB-ID of its own', got=f'0x{can_id:03X}, as {other}',
                                 remedy='Change node_id, or cob_id in the layout.')


def _check_names_and_sync(pads: tuple[PadSettings, ...]) -> None:
    for key, values in (('name', [pad.name for pad in pads]),
                        ('node_id', [node_id for pad in pads for node_id in pad.node_ids])):
        if len(set(values)) != len(values):
            raise ConfigurationError('pads', expected=f'a {key} of its own for each', got=str(values),
                                     remedy='Give every pad another one.')
    syncs = {pad.layout.sync_cob_id for pad in pads}
    if len(syncs) > 1:
        raise ConfigurationError('pads', expected='one SYNC COB-ID on a bus',
                                 got=', '.join(map(hex, sorted(syncs))),
                                 remedy='Use the same sync_cob_id in their layouts.')
