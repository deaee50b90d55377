"""State of bus and pads as `BusFacts`: from a source of taxel frames, or from a SkinStatus message."""

import math
from typing import Any

from tactile_node.cia301.nmt import state_name
from tactile_node.frames import counters
from tactile_node.frames.fault_text import failure_text, node_text
from tactile_node.frames.health import BusHealth, NodeHealth
from tactile_node.frames.losses import BusStatistics, PadStatistics
from tactile_node.view.states import BusFacts, NodeFacts, PadFacts


def facts_of(statistics: BusStatistics, health: BusHealth, load_is_known: bool = True) -> BusFacts:
    """Of a live bus or a log; a log knows no load."""
    counts = counters.read_counters(counters.BUS_LOSSES, statistics)
    return BusFacts(failure_text(health.failure), health.load if load_is_known else math.nan, _some(counts),
                    tuple(_pad(name, pad, health.nodes.get(name, ())) for name, pad in statistics.pads.items()))


def facts_of_status(message: Any) -> BusFacts:
    """Of a SkinStatus, from a topic or a bag."""
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
