"""Tests of the decision which fault a node has and what the driver does about it, in virtual time."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tactile_node.assembly.health import BusFault, Failure, NodeFault
from tactile_node.sources.node_state import RECOVERY, Action, NodeEvent, NodeSeen, NodeState, Retries, fault_of, step

ROUND = 0.02  # Time between two observations [s].
WELL = NodeSeen(
    is_active=True, setup_fault=NodeFault.NONE, are_two=False, is_silent=False, is_operational=True,
    is_executing=False, has_data=True, has_new_data=True, misses_tpdos=False, misses_sync=False,
    has_taxels_again=True, data_at=0.0, refuses_check=False)
MUTE = WELL._replace(has_data=False, has_new_data=False, has_taxels_again=False)
CONFIGURE, CHECK, START, READ_ERRORS = Action
RESTART = (CONFIGURE, START)
UNPLUGGED = Failure(BusFault.RECEPTION_FAILED, 'no such device')


def observed(*events: NodeSeen | Failure | NodeEvent, begin: float = 100.0) -> NodeState:
    """Return the state after events that occur once a second."""
    state = NodeState()
    for second, event in enumerate(events):
        state, _ = step(state, event, begin + second)
    return state


def attempts(seen: Callable[[float], NodeSeen], seconds: float, state: NodeState | None = None) -> list[float]:
    """Return the times of the attempts, each of which ends at once, while ``seen(now)`` is observed in each round."""
    state, times = state or NodeState(), []
    for number in range(round(seconds / ROUND)):
        now = number * ROUND
        state, actions = step(state, seen(now), now)
        if actions:
            times.append(round(now, 2))
            state, _ = step(state, NodeEvent.ATTEMPTED, now)
    return times


@pytest.mark.parametrize(('seen', 'fault', 'actions'), [
    ({}, NodeFault.NONE, ()),
    ({'setup_fault': NodeFault.BOOTED}, NodeFault.BOOTED, RESTART),
    ({'setup_fault': NodeFault.UNCONFIGURED}, NodeFault.UNCONFIGURED, RESTART),
    ({'setup_fault': NodeFault.RECONFIGURED}, NodeFault.RECONFIGURED, RESTART),
    ({'setup_fault': NodeFault.BOOTED, 'is_silent': True}, NodeFault.SILENT, RESTART),
    ({'is_silent': True, 'has_new_data': False}, NodeFault.SILENT, RESTART),
    ({'is_silent': True}, NodeFault.NO_HEARTBEAT, (CHECK, START)),
    ({'is_silent': True, 'refuses_check': True}, NodeFault.NO_HEARTBEAT, RESTART),
    ({'is_operational': False}, NodeFault.NOT_OPERATIONAL, (START,)),
    ({'is_operational': False, 'refuses_check': True}, NodeFault.NOT_OPERATIONAL, (START,)),
    ({'is_operational': False, 'is_executing': True}, NodeFault.NONE, ()),
    ({'misses_tpdos': True}, NodeFault.TPDO_MISSING, (CHECK,)),
    ({'misses_tpdos': True, 'refuses_check': True}, NodeFault.TPDO_MISSING, RESTART),
    ({'has_data': False}, NodeFault.NO_TAXELS, RESTART),
    ({'has_data': False, 'misses_sync': True}, NodeFault.NO_SYNC, ()),
    ({'has_data': False, 'is_executing': True}, NodeFault.NONE, ()),
    ({'are_two': True, 'is_silent': True, 'setup_fault': NodeFault.BOOTED}, NodeFault.TWO_SENDERS, ())], ids=str)
def test_each_fault_has_its_first_actions(seen, fault, actions):
    state, due = step(NodeState(), WELL._replace(**seen), 100.0)
    assert state.fault is fault is fault_of(WELL._replace(**seen)) and due == actions


@pytest.mark.parametrize(('seen', 'fault', 'actions'), [
    ({'is_operational': False, 'has_data': False}, NodeFault.NONE, ()),
    ({'is_silent': True}, NodeFault.SILENT, (CONFIGURE,)),
    ({'setup_fault': NodeFault.BOOTED}, NodeFault.BOOTED, (CONFIGURE,))], ids=str)
def test_a_node_that_is_to_be_stopped_is_configured_and_not_started(seen, fault, actions):
    state, due = step(NodeState(), WELL._replace(is_active=False, **seen), 100.0)
    assert state.fault is fault and due == actions
    assert state.outages.count == 0, 'no taxels are expected, so none are missing'


def test_the_errors_of_a_node_are_read_if_the_first_start_does_not_help():
    refusing, due = WELL._replace(is_operational=False), []
    state = NodeState()
    for now in (0.0, 1.0, 2.0):
        state, actions = step(state, refusing, now)
        state, _ = step(state, NodeEvent.ATTEMPTED, now)
        due.append(actions)
    assert due == [(START,), (START, READ_ERRORS), (START, READ_ERRORS)]


def test_attempts_follow_at_growing_pauses_of_at_most_half_a_second():
    assert attempts(lambda now: MUTE, 2.3) == pytest.approx([0.0, 0.1, 0.3, 0.7, 1.2, 1.7, 2.2], abs=2 * ROUND)


def test_no_attempt_follows_while_one_is_under_way():
    state, actions = step(NodeState(), MUTE, 0.0)
    state, _ = step(state, NodeEvent.ATTEMPTED, 3.0)  # the device has not answered for 3 s
    assert actions and step(state, MUTE, 3.08)[1] == () and step(state, MUTE, 3.12)[1] == RESTART


@pytest.mark.parametrize('seen', [
    {'misses_tpdos': True}, {'is_silent': True}, {'setup_fault': NodeFault.RECONFIGURED}], ids=str)
def test_attempts_that_disturb_a_working_node_become_rare(seen):
    times = attempts(lambda now: WELL._replace(**seen), 200.0)
    pauses = [round(after - before, 2) for before, after in zip(times, times[1:])]
    assert pauses[:10] == pytest.approx([0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4, 12.8, 25.6, 30.0], abs=2 * ROUND)
    assert max(pauses) <= 30.0 + ROUND
    assert not Retries(5000, last=100.0).is_due(129.9, longest=30.0), 'the pause has no overflow'


def test_a_new_fault_is_attended_to_at_once():
    def seen(now: float) -> NodeSeen:
        return MUTE if now < 1.0 else WELL._replace(setup_fault=NodeFault.BOOTED)
    times = attempts(seen, 1.2)
    assert times == pytest.approx([0.0, 0.1, 0.3, 0.7, 1.0, 1.1], abs=2 * ROUND) and 1.0 in times


def test_a_fault_that_returns_is_new_unless_two_masters_may_be_fighting():
    def returning(fault: NodeSeen) -> Callable[[float], NodeSeen]:
        return lambda now: fault if now % 0.25 < 0.05 else WELL
    changed = WELL._replace(setup_fault=NodeFault.RECONFIGURED)
    booted = WELL._replace(setup_fault=NodeFault.BOOTED)
    assert len(attempts(returning(booted), 4.0)) == 16
    assert len(attempts(returning(changed), 4.0)) <= 6


def test_a_returning_fault_is_new_after_ten_seconds_without_it():
    def seen(now: float) -> NodeSeen:
        return WELL if 2.0 <= now < pause_end else WELL._replace(misses_tpdos=True)
    pause_end = 12.0
    before = attempts(seen, 2.0)
    assert attempts(seen, 12.18) == pytest.approx([*before, 12.0, 12.1], abs=2 * ROUND)
    pause_end = 10.0
    assert attempts(seen, 10.2) == [*before, 10.0]  # in the row of attempts, the pause is over, and the next is longer


@pytest.mark.parametrize('event', [UNPLUGGED, NodeEvent.STOPPED], ids=['bus failed', 'stopped'])
def test_a_change_of_the_circumstances_is_a_new_chance(event):
    state = NodeState()
    for now in (0.0, 1.0, 2.0, 3.0):
        state, _ = step(state, MUTE, now)
        state, _ = step(state, NodeEvent.ATTEMPTED, now)
    assert step(state, MUTE, 3.1)[1] == ()
    state, _ = step(state, event, 3.1)
    assert step(state, MUTE, 3.1)[1] == RESTART


def test_an_outage_lasts_from_the_last_taxels_to_the_next_and_keeps_its_first_cause():
    silent = MUTE._replace(is_silent=True, data_at=99.5)
    booted = MUTE._replace(setup_fault=NodeFault.BOOTED, data_at=99.5)
    awaiting = WELL._replace(has_taxels_again=False)
    state = observed(WELL, silent, booted, awaiting)
    assert state.fault is NodeFault.AWAITING_TAXELS
    assert (state.outages.count, state.outages.cause, state.outages.current) == (1, NodeFault.SILENT, NodeFault.BOOTED)
    assert state.outages.until(104.0).seconds == 4.5
    ended, _ = step(state, WELL, 105.0)
    assert ended.fault is NodeFault.NONE and ended.outages.current is None
    assert ended.outages.until(200.0).seconds == 5.5


@pytest.mark.parametrize('seen', [{'misses_tpdos': True}, {'is_silent': True}], ids=str)
def test_a_node_that_still_sends_taxels_has_no_outage(seen):
    assert observed(WELL, WELL._replace(**seen)).outages.count == 0


def test_a_failed_bus_is_an_outage_of_its_nodes_until_their_taxels_are_back():
    unconfigured = MUTE._replace(setup_fault=NodeFault.UNCONFIGURED, data_at=103.0)
    failed = observed(WELL, UNPLUGGED, UNPLUGGED)
    assert (failed.fault, failed.outages.cause) == (NodeFault.AWAITING_TAXELS, UNPLUGGED)
    opened = observed(WELL, UNPLUGGED, UNPLUGGED, UNPLUGGED, unconfigured)
    assert (opened.fault, opened.outages.count) == (NodeFault.UNCONFIGURED, 1)
    assert (opened.outages.cause, opened.outages.current) == (UNPLUGGED, NodeFault.UNCONFIGURED)
    well, _ = step(opened, WELL, 106.0)
    assert (well.fault, well.outages.seconds) == (NodeFault.NONE, 5.0)


def test_a_fault_remains_while_the_bus_is_gone():
    booted = MUTE._replace(setup_fault=NodeFault.BOOTED)
    assert observed(booted, UNPLUGGED).fault is NodeFault.BOOTED
    assert observed(UNPLUGGED).fault is NodeFault.NOT_KNOWN, 'nothing is known of a node before it was observed'


def test_a_stop_ends_the_outage():
    state = observed(WELL, UNPLUGGED, NodeEvent.STOPPED)
    assert (state.fault, state.outages.current, state.outages.until(200.0).seconds) == (NodeFault.NONE, None, 1.0)


def test_a_node_that_is_stopped_during_an_outage_is_ready_without_taxels():
    idle = MUTE._replace(is_active=False, is_operational=False)
    state = observed(MUTE, idle)
    assert (state.fault, state.outages.current) == (NodeFault.NONE, None)


def test_the_documented_actions_are_those_of_the_code():
    """docs/architecture.md lists each fault with its observations and its actions."""
    text = (Path(__file__).parents[1] / 'docs/architecture.md').read_text()
    _, table = text.split('| fault | observation | actions |\n')
    lines = table.split('\n\n')[0].splitlines()[1:]
    rows = [[cell.strip(' `') for cell in line.strip('|').split('|')] for line in lines]
    documented = {NodeFault[name]: actions for name, _, actions in rows}
    assert documented == {fault: ', '.join(action.name for action in actions) or 'none'
                          for fault, actions in RECOVERY.items()}
