"""The predefined connection set (CiA 301, 7.3.3): the COB-IDs of each service, and the ones that are reserved."""

from typing import NamedTuple

from tactile_node.cia301.node_id import MAX_NODE_ID, MIN_NODE_ID

NMT = 0x000
SYNC = 0x080  #: default, object 0x1005 can change it
TIME = 0x100
# Of these, add the node-ID:
EMCY = 0x080
SDO_RESPONSE = 0x580  #: server to client
SDO_REQUEST = 0x600  #: client to server
HEARTBEAT = 0x700  #: also boot-up and node guarding


class CanIdRange(NamedTuple):
    first: int
    last: int
    use: str


def _of_nodes(base: int, use: str) -> CanIdRange:
    return CanIdRange(base + MIN_NODE_ID, base + MAX_NODE_ID, use)


#: The names under which CAN frames of a service are counted
SERVICES = (CanIdRange(NMT, NMT, 'nmt'), _of_nodes(EMCY, 'emcy'), CanIdRange(TIME, TIME, 'time'),
            _of_nodes(SDO_RESPONSE, 'sdo'), _of_nodes(SDO_REQUEST, 'sdo'), _of_nodes(HEARTBEAT, 'heartbeat'))

#: Table "Restricted CAN-IDs" of CiA 301: no PDO and no SYNC may use these
RESERVED = (
    CanIdRange(NMT, NMT, 'NMT'), CanIdRange(0x001, 0x07F, 'reserved'), CanIdRange(0x101, 0x180, 'reserved'),
    _of_nodes(SDO_RESPONSE, 'SDO answers'), _of_nodes(SDO_REQUEST, 'SDO requests'),
    CanIdRange(0x6E0, 0x6FF, 'reserved'), _of_nodes(HEARTBEAT, 'NMT error control'),
    CanIdRange(0x780, 0x7FF, 'reserved'))


def node_of(can_id: int, base: int) -> int | None:
    """Return the node-ID of a COB-ID that is ``base`` + node-ID; None of any other.

    >>> node_of(0x720, HEARTBEAT), node_of(0x700, HEARTBEAT)
    (32, None)
    """
    node_id = can_id - base
    return node_id if MIN_NODE_ID <= node_id <= MAX_NODE_ID else None


def service_of(can_id: int) -> str:
    """Name the service of a COB-ID that is no pad's TPDO and not SYNC: 'nmt', 'emcy', ..., else 'foreign'."""
    return next((service.use for service in SERVICES if service.first <= can_id <= service.last), 'foreign')


def reserved_for(can_id: int) -> str | None:
    """Name what CiA 301 reserves ``can_id`` for; None when a PDO may use it."""
    return next((range_.use for range_ in RESERVED if range_.first <= can_id <= range_.last), None)
