"""What is shown of a pad and of its bus at one moment: facts, from any source."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from tactile_node.assembly import counters
from tactile_node.assembly.fault_text import failure_text, node_text
from tactile_node.assembly.frame_source import BusStatistics, PadStatistics
from tactile_node.assembly.health import BusHealth, NodeHealth
from tactile_node.cia301.objects import state_name
from tactile_node.pose.events import EventKind, Moving


class SeenContact(NamedTuple):
    """The largest contact as recognised; of a pad that is seen and empty, `shape` is 'none'."""

    shape: str          #: class name, as on topics
    reason: str         #: why it is unknown, '' for another shape
    probabilities: Mapping[str, float]
    outline: np.ndarray | None            #: corners (n, 2) in the pad's frame [m]; None: no shape, so no outline
    dimensions: tuple[tuple[str, float], ...]  #: name, length [m]
    size_is_bound: bool                   #: it may be larger
    force: float                          #: [N], NaN: not known
    mask: np.ndarray | None               #: bool (rows, cols), its taxels; None: not known
    force_is_bound: bool = False          #: it may be more: taxels are saturated or hidden
    moves: str = ''                       #: what moves and what has just happened, see `moving_words`

    @property
    def confidence(self) -> float:
        """Probability of ``shape``."""
        return self.probabilities.get(self.shape, 0.0)


SAID_FOR = 3.0  #: s after an event


def moving_words(moving: int, speed: float, rate: float, event: int, age: float) -> str:
    """Return what a contact does, by a sum of `Moving`, and its last ``event``, ``age`` [s] ago; '' for nothing new.

    >>> moving_words(Moving.SLIDING, 0.0123, math.nan, EventKind.SLIDING, 0.44)
    'sliding 12.3 mm/s, event: sliding 0.4 s ago'
    """
    said = [f'sliding {1e3 * speed:.1f} mm/s'] if moving & Moving.SLIDING else []
    said += [f'turning {math.degrees(rate):.0f} deg/s'] if moving & Moving.TURNING else []
    said += [f'event: {EventKind(event).name.lower()} {age:.1f} s ago'] if event and age < SAID_FOR else []
    return ', '.join(said)


class PadState(NamedTuple):
    """One taxel frame of a pad and what was recognised in it; arrays are read-only."""

    pad: str
    stamp: float         #: of the acquisition [s, Unix epoch]
    acquired: float      #: its time by the steady clock (time.monotonic) [s]; of a recording, when it was shown
    values: np.ndarray   #: float, (rows, cols), NaN = no valid value
    status: np.ndarray   #: uint8 TaxelStatus, (rows, cols)
    pitch: float         #: [m]
    unit: str            #: 'Pa', 'N' or '1'
    contact: SeenContact | None = None  #: None: nothing recognises this frame


class GraspFacts(NamedTuple):
    """The grasp of two pads."""

    contact: str     #: name of a GraspContact, in lower case
    is_fresh: bool   #: both sides are current
    is_stable: bool
    acquired: float  #: the older side, by the steady clock [s]; -inf: not known


class NodeFacts(NamedTuple):
    """A CANopen node of a pad."""

    node_id: int
    nmt_state: str
    heartbeat_age: float  #: [s], NaN: none received
    fault: str            #: '' without one
    emergency: str        #: the last EMCY, '' without one


class PadFacts(NamedTuple):
    """The fate of a pad's CAN frames since the source was opened."""

    pad: str
    frames_complete: int
    frames_incomplete: int
    expected: int               #: TPDOs
    used: int                   #: TPDOs
    losses: Mapping[str, int]   #: TPDOs lost, by reason; reasons without any are left out
    nodes: tuple[NodeFacts, ...] = ()
    faulty_taxels: tuple[tuple[int, int, str], ...] = ()  #: row, column, fault


class BusFacts(NamedTuple):
    """State of a bus and its pads."""

    failure: str                #: '' while it works
    load: float                 #: part of the bus's time in use; NaN: not known (a log)
    counts: Mapping[str, int]   #: what was lost of the bus itself, by name; those without any are left out
    pads: tuple[PadFacts, ...]


def facts_of(statistics: BusStatistics, health: BusHealth, load_is_known: bool = True) -> BusFacts:
    """Return the facts of a live bus or a log; a log knows no load."""
    counts = counters.read_counters(counters.BUS_LOSSES, statistics)
    return BusFacts(failure_text(health.failure), health.load if load_is_known else math.nan, _some(counts),
                    tuple(_pad(name, pad, health.nodes.get(name, ())) for name, pad in statistics.pads.items()))


def facts_of_status(message: Any) -> BusFacts:
    """Return the facts of a SkinStatus, from a topic or a bag."""
    counts = {loss.name: int(getattr(message, loss.name)) for loss in counters.BUS_LOSSES if loss.is_field}
    return BusFacts(message.failure, float(message.bus_load), _some(counts), tuple(map(_pad_of_status, message.pads)))


def _some(counts: dict[str, int]) -> dict[str, int]:
    return {name: count for name, count in counts.items() if count}


def _pad(name: str, pad: PadStatistics, nodes: tuple[NodeHealth, ...]) -> PadFacts:
    losses = {reason.key: count for reason, count in pad.losses.items()}
    return PadFacts(name, pad.complete, pad.incomplete, pad.expected, pad.used, _some(losses),
                    tuple(_node(name, node) for node in nodes))


def _node(pad: str, node: NodeHealth) -> NodeFacts:
    return NodeFacts(node.node_id, state_name(node.state),
                     math.nan if node.heartbeat_age is None else node.heartbeat_age,
                     node_text(pad, node), str(node.last_emergency or ''))


def _pad_of_status(pad: Any) -> PadFacts:
    losses = {reason: int(count) for reason, count in zip(pad.loss_reasons, pad.loss_counts)}
    nodes = tuple(NodeFacts(node.node_id, node.nmt_state_text, float(node.heartbeat_age), node.fault_text,
                            node.emcy_last) for node in pad.nodes)
    faulty = tuple((int(taxel.row), int(taxel.col), taxel.fault) for taxel in pad.faulty_taxels)
    return PadFacts(pad.pad, int(pad.frames_complete), int(pad.frames_incomplete), int(pad.tpdos_expected),
                    int(pad.tpdos_used), _some(losses), nodes, faulty)
