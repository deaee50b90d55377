"""How a bus and its nodes are, at one moment: what the driver tells on /diagnostics."""

from typing import NamedTuple

from tactile_node.cia301.emergency import Emergency


class Outages(NamedTuple):
    """Times without taxels since construction, the one under way included."""

    count: int = 0
    seconds: float = 0.0
    reason: str = ''  #: what began the last one


class NodeHealth(NamedTuple):
    """One pad's node. ``trouble`` is a sentence, empty while all is well."""

    node_id: int
    state: str  #: NMT state by name, as last heard
    is_operational: bool  #: and heard of late
    heartbeat_age: float | None  #: [s], None when it was never heard
    trouble: str = ''
    boots: int = 0  #: boot-up messages seen
    emergencies: int = 0
    last_emergency: Emergency | None = None
    outages: Outages = Outages()
    distrusted: int = 0  #: taxel frames given without values, since the node was not configured


class ErrorCounters(NamedTuple):
    """Of the CAN controller (ISO 11898-1), as its last error frame told: 96 warns, above 127 it is passive."""

    sending: int = 0
    receiving: int = 0


class BusHealth(NamedTuple):
    """``failure``: why nothing can be received, None while it can; ``nodes`` of each pad by name, none for a log."""

    failure: str | None = None
    is_active: bool = True  #: SYNC on, nodes are to be OPERATIONAL
    nodes: dict[str, tuple[NodeHealth, ...]] = {}  #: read only
    outages: Outages = Outages()
    load: float = 0.0  #: part of the bus's time in use, bit stuffing at its worst, over the last second
    is_error_passive: bool = False
    error_counters: ErrorCounters = ErrorCounters()
    foreign_commands: int = 0
    last_command: str = ''  #: of another master
