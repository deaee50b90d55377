"""State of a pad and its bus at one moment, in a form common to all sources."""

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
from tactile_node.taxel_frame import TaxelStatus


class SeenContact(NamedTuple):
    """The largest contact and its recognised shape. If the whole pad is visible and empty, `shape` is 'none'."""

    shape: str          #: name of the shape class, as published on the topics
    reason: str         #: reason why the shape is unknown, or '' if it is known
    probabilities: Mapping[str, float]
    outline: np.ndarray | None            #: corners (n, 2) in the pad frame [m], or None without a shape
    dimensions: tuple[tuple[str, float], ...]  #: names and lengths of the dimensions [m]
    size_is_bound: bool                   #: True if the dimensions are lower bounds
    force: float                          #: force of the contact [N], or NaN if unknown
    mask: np.ndarray | None               #: mask of the contact's taxels, bool (rows, cols), or None if unknown
    force_is_bound: bool = False          #: True if the force is a lower bound, because taxels are saturated or hidden
    moves: str = ''                       #: motion and last event as text from `moving_words`

    @property
    def confidence(self) -> float:
        """Probability of ``shape``."""
        return self.probabilities.get(self.shape, 0.0)


SAID_FOR = 3.0  #: time for which an event is shown [s]


def moving_words(moving: int, speed: float, rate: float, event: int, age: float) -> str:
    """Return the motion and the last event of a contact as text, or '' if there is nothing to report.

    Parameters
    ----------
    moving
        Sum of `Moving` flags.
    speed
        Speed of the shift or slide [m/s].
    rate
        Rate of turning [rad/s].
    event
        Last event as an `EventKind`, or 0 if there is none.
    age
        Age of the event [s].

    Examples
    --------

    >>> moving_words(Moving.SLIDING, 0.0123, math.nan, EventKind.SLIDING, 0.44)
    'sliding 12.3 mm/s, event: sliding 0.4 s ago'
    """
    said = [f'{word} {1e3 * speed:.1f} mm/s' for word, flag in (('shifting', Moving.SHIFTING),
                                                                ('sliding', Moving.SLIDING)) if moving & flag]
    said += [f'turning {math.degrees(rate):.0f} deg/s'] if moving & Moving.TURNING else []
    said += [f'event: {EventKind(event).name.lower()} {age:.1f} s ago'] if event and age < SAID_FOR else []
    return ', '.join(said)


class PadState(NamedTuple):
    """One taxel frame of a pad and the contact recognised in it. The arrays are read-only."""

    pad: str
    stamp: float         #: acquisition time [s, Unix epoch]
    acquired: float      #: acquisition time by time.monotonic [s], or the display time for a recording
    values: np.ndarray   #: taxel values, float (rows, cols), NaN where there is no valid value
    status: np.ndarray   #: `TaxelStatus` of each taxel, uint8 (rows, cols)
    pitch: float         #: [m]
    unit: str            #: unit of the values: 'Pa', 'N' or '1'
    contact: SeenContact | None = None  #: recognised contact, or None if the source does not recognise contacts

    @property
    def hidden(self) -> np.ndarray:
        """Mask of the taxels without a valid value, without the places where there is no taxel."""
        return np.isnan(self.values) & (self.status != TaxelStatus.UNMAPPED)


class GraspFacts(NamedTuple):
    """The grasp between two pads."""

    contact: str     #: name of a GraspContact, in lower case
    is_fresh: bool   #: True if the results of both pads are recent
    is_stable: bool
    acquired: float      #: acquisition time of the older pad's data by time.monotonic [s], or -inf if unknown


class NodeFacts(NamedTuple):
    """A CANopen node of a pad."""

    node_id: int
    nmt_state: str
    heartbeat_age: float  #: age of the last heartbeat [s], or NaN if none was received
    fault: str            #: fault of the node as text, or '' if there is none
    emergency: str        #: last EMCY as text, or '' if there is none


class PadCounts(NamedTuple):
    """Counters of a pad, since the source was opened or within a recording."""

    frames_complete: int = 0
    frames_incomplete: int = 0
    expected: int = 0   #: number of expected TPDOs
    received: int = 0   #: number of received TPDOs
    used: int = 0       #: number of used TPDOs
    losses: Mapping[str, int] = {}  #: number of lost TPDOs by reason, omitting reasons without losses

    def plus(self, other: 'PadCounts', factor: int = 1) -> 'PadCounts':
        """Return the sum of these counters and ``factor`` times the ``other`` counters."""
        counts = (mine + factor * theirs for mine, theirs in zip(self[:-1], other[:-1]))
        losses = {reason: self.losses.get(reason, 0) + factor * other.losses.get(reason, 0)
                  for reason in (*self.losses, *other.losses)}
        return PadCounts._make((*counts, _some(losses)))

    def minus(self, other: 'PadCounts') -> 'PadCounts':
        """Return the difference between these and the ``other`` counters."""
        return self.plus(other, -1)

    @property
    def is_possible(self) -> bool:
        """True if no counter is negative, as in a difference across a restart of the driver."""
        return min(*self[:-1], *self.losses.values()) >= 0


class PadFacts(NamedTuple):
    """Counters and faults of a pad since the source was opened."""

    pad: str
    counts: PadCounts
    nodes: tuple[NodeFacts, ...] = ()
    faulty_taxels: tuple[tuple[int, int, str], ...] = ()  #: row, column and fault of each faulty taxel


class BusFacts(NamedTuple):
    """State of a bus and its pads."""

    failure: str                #: failure of the bus as text, or '' while the bus works
    load: float                 #: fraction of time for which the bus is busy, or NaN if unknown, as for a log
    counts: Mapping[str, int]   #: number of losses on the bus itself by name, omitting names without losses
    pads: tuple[PadFacts, ...]


def facts_of(statistics: BusStatistics, health: BusHealth, load_is_known: bool = True) -> BusFacts:
    """Return the facts of a live bus or a log. The bus load of a log is not known."""
    counts = counters.read_counters(counters.BUS_LOSSES, statistics)
    return BusFacts(failure_text(health.failure), health.load if load_is_known else math.nan, _some(counts),
                    tuple(_pad(name, pad, health.nodes.get(name, ())) for name, pad in statistics.pads.items()))


def facts_of_status(message: Any) -> BusFacts:
    """Return the facts in a SkinStatus, from a topic or a bag."""
    counts = {loss.name: int(getattr(message, loss.name)) for loss in counters.BUS_LOSSES if loss.is_field}
    return BusFacts(message.failure, float(message.bus_load), _some(counts), tuple(map(_pad_of_status, message.pads)))


def counts_of_status(pad: Any) -> PadCounts:
    """Return the counters in a PadStatus, from a topic or a bag."""
    losses = {reason: int(count) for reason, count in zip(pad.loss_reasons, pad.loss_counts)}
    return PadCounts(int(pad.frames_complete), int(pad.frames_incomplete), int(pad.tpdos_expected),
                     int(pad.tpdos_received), int(pad.tpdos_used), _some(losses))


def _some(counts: dict[str, int]) -> dict[str, int]:
    return {name: count for name, count in counts.items() if count}


def _pad(name: str, pad: PadStatistics, nodes: tuple[NodeHealth, ...]) -> PadFacts:
    losses = {reason.key: count for reason, count in pad.losses.items()}
    counts = PadCounts(pad.complete, pad.incomplete, pad.expected, pad.received, pad.used, _some(losses))
    return PadFacts(name, counts, tuple(_node(name, node) for node in nodes))


def _node(pad: str, node: NodeHealth) -> NodeFacts:
    return NodeFacts(node.node_id, state_name(node.state),
                     math.nan if node.heartbeat_age is None else node.heartbeat_age,
                     node_text(pad, node), str(node.last_emergency or ''))


def _pad_of_status(pad: Any) -> PadFacts:
    nodes = tuple(NodeFacts(node.node_id, node.nmt_state_text, float(node.heartbeat_age), node.fault_text,
                            node.emcy_last) for node in pad.nodes)
    faulty = tuple((int(taxel.row), int(taxel.col), taxel.fault) for taxel in pad.faulty_taxels)
    return PadFacts(pad.pad, counts_of_status(pad), nodes, faulty)
