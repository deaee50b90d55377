"""Decide which fault a CANopen node has, and which actions recover the node.

The decision has no clock, bus or thread: `NodeMonitor` observes the node, `step` decides, and `SupervisedNode` carries
the actions out. docs/architecture.md draws the states.
"""

from dataclasses import dataclass, replace
from enum import Enum, auto
from math import inf
from typing import NamedTuple

from tactile_node.assembly.health import Failure, NodeFault, Outages


class Action(Enum):
    """An action of the driver on a node that has a fault."""

    CONFIGURE = auto()    #: set the node to PRE-OPERATIONAL, and configure it
    CHECK = auto()        #: check the configuration while the node sends TPDOs, and correct it
    START = auto()        #: send NMT start
    READ_ERRORS = auto()  #: read the errors that the node stores, and log them


RESTART = (Action.CONFIGURE, Action.START)

#: Actions that recover a node from each fault. No request to the node can clear NO_SYNC or TWO_SENDERS.
RECOVERY: dict[NodeFault, tuple[Action, ...]] = {
    NodeFault.BOOTED: RESTART,
    NodeFault.UNCONFIGURED: RESTART,
    NodeFault.RECONFIGURED: RESTART,
    NodeFault.SILENT: RESTART,
    NodeFault.NO_TAXELS: RESTART,
    NodeFault.NO_HEARTBEAT: (Action.CHECK, Action.START),
    NodeFault.TPDO_MISSING: (Action.CHECK,),
    NodeFault.NOT_OPERATIONAL: (Action.START, Action.READ_ERRORS),
    NodeFault.NO_SYNC: (),
    NodeFault.TWO_SENDERS: ()}

#: Faults for which a recovery interrupts the taxels or loads the bus, and may not help: two masters may be overwriting
#: the same object in turn. Such a fault counts as the same fault if it returns within SETTLING_TIME after a recovery.
RECURRING = (NodeFault.RECONFIGURED, NodeFault.TPDO_MISSING, NodeFault.NO_HEARTBEAT)
SETTLING_TIME = 10.0  #: time after the last recovery from a RECURRING fault until its return counts as a new fault [s]
FIRST_PAUSE = 0.1  #: pause between the first and the second attempt [s]
LAST_PAUSE = 0.5  #: longest pause between attempts [s], so that recovery soon follows the end of the cause
LAST_RECURRING_PAUSE = 30.0  #: longest pause between attempts to recover from a RECURRING fault [s]
MOST_DOUBLINGS = 10  #: number of doublings after which every pause has reached its longest value


class NodeSeen(NamedTuple):
    """Event: the observations of a node up to now."""

    is_active: bool         #: True if the node should be OPERATIONAL
    setup_fault: NodeFault  #: UNCONFIGURED, BOOTED or RECONFIGURED; NONE if the TPDOs match the layout
    are_two: bool           #: True if a second device sends with the node-ID or the COB-IDs
    is_silent: bool         #: True if the heartbeats are overdue
    is_operational: bool    #: True if the last heartbeat reported OPERATIONAL
    is_executing: bool      #: True if the node may still be executing the last command
    has_data: bool          #: True if taxels were received within the timeout
    has_new_data: bool      #: True if taxels were received within half of the timeout
    misses_tpdos: bool      #: True if some TPDOs bring no taxels, although other TPDOs do
    misses_sync: bool       #: True if the node needs SYNC, and the bus has none
    has_taxels_again: bool  #: True if valid taxels were received since the last command
    data_at: float          #: time when the last taxels were received [s]
    refuses_check: bool     #: True if the node refuses to be configured while it sends TPDOs


class NodeEvent(Enum):
    """An event without further data."""

    STOPPED = auto()    #: no taxels are expected from now on
    ATTEMPTED = auto()  #: the actions of the last step were carried out, with or without success


class Retries(NamedTuple):
    """Attempts to recover from one fault. The second attempt follows after FIRST_PAUSE, and each pause doubles.

    >>> attempted = Retries().attempted(10.0).attempted(20.0).attempted(30.0)
    >>> Retries().is_due(0.0), attempted.is_due(30.39), attempted.is_due(30.41), attempted.is_due(30.31, longest=0.3)
    (True, False, True, True)
    """

    made: int = 0  #: number of attempts
    last: float = -inf  #: time when the last attempt ended [s]

    def attempted(self, now: float) -> 'Retries':
        """Return the attempts including one that ended now."""
        return Retries(self.made + 1, now)

    def is_due(self, now: float, longest: float = LAST_PAUSE) -> bool:
        """Return True if the next attempt is due. The pause is never longer than ``longest`` [s]."""
        pause = FIRST_PAUSE * 2 ** min(self.made - 1, MOST_DOUBLINGS)
        return now >= self.last + min(pause, longest)


@dataclass(frozen=True)
class NodeState:
    """State of the supervision of one node."""

    fault: NodeFault = NodeFault.NOT_KNOWN
    outages: Outages[Failure | NodeFault] = Outages()
    retries: Retries = Retries()
    retried: NodeFault = NodeFault.NONE  #: fault that ``retries`` counts; NONE if any next fault is a new fault


def step(state: NodeState, event: NodeSeen | Failure | NodeEvent, now: float) -> tuple[NodeState, tuple[Action, ...]]:
    """Return the state of a node after an event, and the actions that are due.

    Parameters
    ----------
    state
        State before the event.
    event
        Observations of the node, a failure of its bus, or another event.
    now
        Time of the event on the monotonic clock [s].
    """
    match event:
        case NodeSeen():
            fault = fault_of(event)
            if not fault.is_fault:
                return _without_fault(state, event, now), ()
            state = _with_fault(state, event, fault, now)
            return state, _actions_due(state, event, now)
        case Failure():
            fault = NodeFault.AWAITING_TAXELS if state.fault is NodeFault.NONE else state.fault
            return NodeState(fault, state.outages.begin(now, event), Retries(), state.retried), ()
        case NodeEvent.STOPPED:
            fault = NodeFault.NONE if state.fault is NodeFault.AWAITING_TAXELS else state.fault
            return NodeState(fault, state.outages.end(now), Retries(), state.retried), ()
        case NodeEvent.ATTEMPTED:
            return replace(state, retries=state.retries.attempted(now)), ()


def fault_of(seen: NodeSeen) -> NodeFault:
    """Return the fault that explains the observations, or NONE. The first fault of this list that applies wins."""
    if seen.are_two:
        return NodeFault.TWO_SENDERS
    if seen.setup_fault.is_fault:
        return NodeFault.SILENT if seen.is_silent else seen.setup_fault
    # the heartbeat and the data may have stopped together, so only new data prove that the node still sends
    if seen.is_silent:
        return NodeFault.NO_HEARTBEAT if seen.is_active and seen.has_new_data else NodeFault.SILENT
    if not seen.is_active or seen.is_executing:
        return NodeFault.NONE
    if not seen.is_operational:
        return NodeFault.NOT_OPERATIONAL
    if seen.has_data:
        return NodeFault.TPDO_MISSING if seen.misses_tpdos else NodeFault.NONE
    return NodeFault.NO_SYNC if seen.misses_sync else NodeFault.NO_TAXELS


def _without_fault(state: NodeState, seen: NodeSeen, now: float) -> NodeState:
    if state.outages.begun is not None and seen.is_active and not seen.has_taxels_again:
        return replace(state, fault=NodeFault.AWAITING_TAXELS)
    state = replace(state, fault=NodeFault.NONE, outages=state.outages.end(now))
    if state.retried in RECURRING and now - state.retries.last < SETTLING_TIME:
        return state
    return replace(state, retried=NodeFault.NONE)


def _with_fault(state: NodeState, seen: NodeSeen, fault: NodeFault, now: float) -> NodeState:
    stops_taxels = Action.CHECK not in RECOVERY[fault]
    outages = state.outages.begin(seen.data_at, fault) if stops_taxels and seen.is_active else state.outages
    retries = state.retries if fault is state.retried else Retries()
    return NodeState(fault, outages, retries, retried=fault)


def _actions_due(state: NodeState, seen: NodeSeen, now: float) -> tuple[Action, ...]:
    if not state.retries.is_due(now, LAST_RECURRING_PAUSE if state.fault in RECURRING else LAST_PAUSE):
        return ()
    actions = RECOVERY[state.fault]
    if seen.refuses_check and Action.CHECK in actions:
        actions = RESTART
    omitted = set() if seen.is_active else {Action.START}
    if not state.retries.made:
        omitted.add(Action.READ_ERRORS)  # most nodes start at the first command
    return tuple(action for action in actions if action not in omitted)
