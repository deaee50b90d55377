"""Tests that message counts alone reveal two senders, another SYNC producer, or a process that is too slow.

The tests need neither a clock nor a bus.
"""

import time
from collections.abc import Callable
from dataclasses import replace

import pytest

from tactile_node.assembly.facts import PadFacts
from tactile_node.assembly.health import NodeFault, Overload, SyncFault
from tactile_node.assembly.sync_assembler import SyncAssembler
from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.cia301.heartbeat import Heartbeats
from tactile_node.skin.pads import make_pads, with_dictionaries
from tactile_node.sources.bus_watch import BusCounts, OverloadWatch, SyncWatch
from tactile_node.sources.node_monitor import NodeMonitor
from tactile_node.sources.node_state import fault_of
from tactile_node.sources.sender_watch import SenderWatch

STEP = 0.02  # Time between two updates of the watches [s].
DELAY = 0.5  # Delay [s].


def times(seconds: float, begin: float = 0.0) -> list[float]:
    return [begin + i * STEP for i in range(round(seconds / STEP))]


def looks(sent: Callable[[float], int], answers: Callable[[int], bool] = lambda number: False,
          seconds: float = 12.0) -> list[tuple[float, bool]]:
    """Return, for each update, its time and True if the node then counts as two devices.

    Parameters
    ----------
    sent
        Returns the number of heartbeats received up to a time [s].
    answers
        Returns True if the heartbeat with a number is an answer to node guarding, which has a toggle bit.
    seconds
        Duration [s].
    """
    heartbeats = Heartbeats()
    senders, pad = senders_of(heartbeats)
    seen = []
    for now in times(seconds):
        while (number := heartbeats.of(32).heartbeats) < sent(now):
            heartbeats.feed(0x720, b'\x85' if answers(number) else b'\x05')
        senders.look(now, False, pad, BusCounts(0), 0.1, DELAY)
        seen.append((now, senders.are_two))
    return seen


def senders_of(heartbeats: Heartbeats) -> tuple[SenderWatch, PadFacts]:
    """Return the senders of node 32, and the counts of its pad before the first TPDO."""
    node = with_dictionaries(make_pads(['sim8x8_16bit.yaml'], (32,)))[0].nodes[0]
    return SenderWatch(node, heartbeats.of(32)), SyncAssembler(node.layout, (32,)).facts()


@pytest.mark.parametrize(('count', 'are_two'), [(1.0, False), (1.1, False), (2.0, True), (1.9, True)])
def test_heartbeats_of_two_producers_are_twice_as_many(count, are_two):
    """The heartbeat period is 0.1 s, and ``count`` heartbeats arrive in each period."""
    seen = [two for _, two in looks(lambda now: int(count * now / 0.1))]
    assert any(seen) == are_two and not any(seen[:100]) and seen[-1] == are_two


def test_heartbeats_that_an_adapter_has_held_back_are_of_one():
    def held_back(now):
        return int(now / 0.1) - (int(0.45 / 0.1) if 5.0 <= now < 5.45 else 0)
    assert not any(two for _, two in looks(held_back))


def test_answers_to_node_guarding_do_not_count_as_a_second_producer():
    seen = looks(lambda now: int(2 * now / 0.1), lambda number: number % 4 == 0)
    assert not any(two for _, two in seen)


def surplus(received: Callable[[float], list[int]], seconds: float = 5.0) -> list[tuple[int, ...]]:
    """Return the numbers of the surplus TPDOs found at each update.

    SYNC has a period of 20 ms, and ``received(now)`` has the count of each of the first TPDOs.
    """
    senders, pad = senders_of(Heartbeats())
    found = []
    for now in times(seconds):
        syncs = int(now / 0.02)
        senders.look(now, True, replace(pad, syncs=syncs, distinct_by_tpdo=(tuple(received(now)),)), BusCounts(syncs),
                     None, DELAY)
        found.append(tuple(tpdo.number for tpdo in senders.surplus))
        assert bool(found[-1]) == senders.are_two
    return found


def at_rates(*rates: float, held=lambda now: 0.0) -> Callable[[float], list[int]]:
    """In each SYNC period, TPDO i arrives ``rates[i]`` times, and an adapter holds it back for ``held(now)`` [s]."""
    return lambda now: [int(rate * (now - held(now)) / 0.02) for rate in rates]


def test_a_tpdo_that_arrives_twice_per_sync_is_found_within_a_second():
    found = surplus(at_rates(1.0, 2.0, 1.0))
    assert found[50] == found[-1] == (2,) and set(found) == {(), (2,)}


def test_a_second_sender_that_begins_later_is_found_within_a_second():
    found = surplus(lambda now: [int(now / 0.02) + int(max(0.0, now - 5.0) / 0.02)], 10.0)
    when = [now for now, numbers in zip(times(10.0), found) if numbers]
    assert 5.4 < when[0] < 6.0 and when[-1] > 9.9


def test_tpdos_that_an_adapter_has_held_back_are_of_one_sender():
    """SYNCs continue while the adapter holds their TPDOs back, and later all these TPDOs arrive at once."""
    assert set(surplus(at_rates(1.0, held=lambda now: now % 1.0 if now % 1.0 < 0.45 else 0.0))) == {()}


def test_lost_tpdos_do_not_prove_a_second_sender():
    assert set(surplus(at_rates(0.5, 1.0))) == {()}


def test_a_tpdo_is_missing_once_only_the_others_have_come_for_the_timeout():
    senders, pad = senders_of(Heartbeats())
    found = []
    for now, first, others in ((0.1, 1, 1), (0.5, 1, 5), (0.7, 1, 7), (0.8, 2, 8), (1.2, 2, 8), (1.4, 2, 8)):
        senders.look(now, True, replace(pad, fresh_by_tpdo=((first, *[others] * 15),)), BusCounts(0), None, DELAY)
        found.append([tpdo.number for tpdo in senders.missing])
    assert found == [[], [], [1], [], [], []]  # at the end, all TPDOs have stopped


def overloads(late: dict[float, float], dropped_at: float = 99.0, held: tuple[float, float] = (99.0, 99.0)):
    """Return the overload found at each update and the number of stalls.

    During the interval ``held``, the assembler processes nothing.
    """
    calls, found = [], {}
    watch = OverloadWatch(calls.append, 0.25)
    for now in times(3.0, begin=100.0):
        watch.woke(now, late.get(round(now - 100, 2), 0.0))
        found[round(now - 100, 2)] = watch.update(now, 7 * (now - 100 >= dropped_at))
        if not held[0] <= now - 100 < held[1]:
            while calls:
                calls.pop()()
    return found, watch.stalls


def test_a_process_that_runs_is_not_overloaded():
    found, stalls = overloads({1.0: 0.2})
    assert set(found.values()) == {Overload.NONE} and stalls == 0


@pytest.mark.parametrize(('given', 'kind', 'begin'), [
    ({'late': {1.0: 0.4}}, Overload.STALLED, 1.0), ({'late': {}, 'dropped_at': 1.0}, Overload.DROPPED, 1.0),
    ({'late': {}, 'held': (0.98, 1.4)}, Overload.BEHIND, 1.26)])
def test_each_sign_of_an_overload_counts_for_a_while(given, kind, begin):
    found, stalls = overloads(**given)
    assert {at for at, overload in found.items() if overload is kind} >= {begin, round(begin + 0.4, 2)}
    assert found[0.9] is Overload.NONE and found[2.5] is Overload.NONE
    assert stalls == (kind is Overload.STALLED)


def test_a_reopened_bus_has_no_pending_call():
    watch = OverloadWatch(lambda call: None, 0.25)
    watch.update(100.0, 0)
    watch.restart()
    assert watch.update(101.0, 0) is Overload.NONE


def syncs(produce: bool, counts, is_active: bool = True):
    watch = SyncWatch(produce, 0.02)
    return [watch.update(now, is_active, count).fault for now, count in counts]


def test_a_foreign_sync_is_reported_for_a_second_while_we_produce():
    found = syncs(True, [(now, int(now >= 1.0)) for now in times(4.0)])
    assert found[0] is SyncFault.NONE and found[50] is found[95] is SyncFault.SECOND_PRODUCER
    assert found[-1] is SyncFault.NONE


def test_a_foreign_sync_while_inactive_does_not_count_as_a_second_producer():
    assert SyncFault.SECOND_PRODUCER not in syncs(True, [(now, int(now / 0.02)) for now in times(4.0)], False)


@pytest.mark.parametrize(('period', 'fault'), [
    (0.02, SyncFault.NONE), (0.021, SyncFault.NONE), (0.03, SyncFault.OTHER_PERIOD), (0.01, SyncFault.OTHER_PERIOD)])
def test_a_period_that_is_not_ours_is_reported(period, fault):
    assert syncs(False, [(now, int(now / period)) for now in times(5.0)])[-1] is fault


def test_a_producer_that_begins_within_a_window_has_its_own_period():
    found = syncs(False, [(now, int(max(0.0, now - 1.5) / 0.02)) for now in times(6.0)])
    assert SyncFault.OTHER_PERIOD not in found


@pytest.mark.parametrize('silent', [0.7, 2.0, 5.0])
def test_heartbeats_of_a_silence_are_of_one_device_and_a_second_one_after_it_is_found(silent):
    def held_back(now):
        return int((min(now, 3.0) if now < 3.0 + silent else now) / 0.1)
    assert not any(two for _, two in looks(held_back))
    both = looks(lambda now: held_back(now) + int(max(0.0, now - 3.0 - silent) / 0.1))
    found = next(now for now, two in both if two)
    assert 3.0 + silent < found < 3.0 + silent + 4.0


@pytest.mark.parametrize(('stalls', 'is_reported'), [([5.0], False), ([1.0, 1.05], False), ([0.4] * 60, True)])
def test_a_stall_excuses_a_silence_but_endless_stalls_do_not(stalls, is_reported):
    """A node falls silent after its first heartbeat while this process stalls for the times in ``stalls`` [s]."""
    bus = BusMonitor([32])
    node = with_dictionaries(make_pads(['sim8x8_16bit.yaml'], (32,)))[0].nodes[0]
    monitor, pad = NodeMonitor(node, bus, 0.5, 0.5), SyncAssembler(node.layout, (32,)).facts()
    now = time.monotonic()
    monitor.expect(now - 1.0)
    bus.heartbeats.feed(0x720, b'\x05')
    faults = []
    for stall in stalls:
        now += stall
        faults.append(fault_of(monitor.look(now, False, pad, BusCounts(0, is_overloaded=True, ran_again=now))))
    assert (faults[-1] is NodeFault.SILENT) == is_reported, faults
