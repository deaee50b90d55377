"""Tests of sweeps at the capacity limit of the bus, in virtual time."""

import os
from itertools import product

import numpy as np
import pytest
from wire import Node, frame_seconds
from wire_worlds import HOST, ONE, TWO, TWO_NODES, WIRE, period_at, played, random_world, rising

LONG = bool(os.environ.get('TACTILE_LONG'))
LOADS = (0.8, 0.9, 0.95, 0.98) if LONG else (0.8, 0.98)
PADS = {'one pad': ONE, 'two pads': TWO, 'a pad of two nodes': TWO_NODES}
FOREIGN = (0.0, 0.05, 0.08, 0.15) if LONG else (0.0, 0.08)
CLOCKS = (HOST, WIRE)


def with_pads(*choices):
    """Return each combination of ``choices`` with one of PADS in turn, or with all of PADS with TACTILE_LONG."""
    return [pytest.param(*chosen, pads, id=f'{"-".join(map(str, chosen))}-{name}')
            for i, chosen in enumerate(product(*choices)) for j, (name, pads) in enumerate(PADS.items())
            if LONG or i % len(PADS) == j]


#: Number of sweeps in a simulation, and the number of the sweep that a fault affects.
SWEEPS, EVENT = (600, 200) if LONG else (180, 60)


@pytest.mark.parametrize('clock', [HOST, WIRE])
@pytest.mark.parametrize('load', LOADS)
def test_a_sync_late_by_half_a_period_or_jitter_costs_nothing(load, clock):
    period = period_at(load, ONE)
    rng = np.random.default_rng(7)
    late, shaken = np.arange(SWEEPS) * period, np.arange(SWEEPS) * period + rng.uniform(-3e-4, 3e-4, SWEEPS)
    late[EVENT] += period / 2
    for syncs in (late, rising(shaken)):
        seen, = played(ONE, syncs, clock)
        assert not seen.wrong and len(seen.whole) >= SWEEPS - 1


@pytest.mark.parametrize(('load', 'clock', 'pads'), with_pads(LOADS, CLOCKS))
def test_a_skipped_sweep_costs_a_few_more(load, pads, clock):
    """A free bus proves that the node will not answer late.

    On a full bus, the driver omits SYNCs to obtain this proof.
    """
    for seen in played(pads, np.arange(SWEEPS) * period_at(load, pads), clock, skips=lambda number: number == EVENT):
        assert not seen.wrong and len(seen.answered) >= SWEEPS - 6 and len(seen.answered) - len(seen.whole) <= 4


@pytest.mark.slow
@pytest.mark.parametrize(('over', 'after', 'clock'), [
    (1.01, 0.98, WIRE), (1.1, 0.9, HOST),
    *LONG * [(1.01, 0.98, HOST), (1.1, 0.9, WIRE), *((*loads, clock) for loads in ((1.01, 0.8), (1.03, 0.95))
                                                      for clock in (HOST, WIRE))]])
def test_no_stamp_is_wrong_during_an_overload_and_all_sweeps_are_whole_after_it(over, after, clock):
    """Under overload, the node falls behind, omits sweeps and later catches up.

    From time to time, the driver omits a SYNC to find out which SYNC the node is answering.
    """
    loads = np.concatenate((np.full(50, 0.8), np.full(200, over), np.full(100, after)))
    syncs = np.concatenate(([0.0], np.cumsum([period_at(load, ONE) for load in loads])[:-1]))
    seen, = played(ONE, syncs, clock)
    assert not seen.wrong and set(range(255, len(syncs) - 1)) <= set(seen.whole)
    assert len(seen.whole) >= 0.75 * len(seen.answered)


@pytest.mark.parametrize('clock', [HOST, WIRE])
@pytest.mark.parametrize('delay', [0.005, 0.012, 0.018])
def test_a_slow_node_that_leaves_out_a_sweep_has_no_wrong_stamp(delay, clock):
    """If the node takes more than half a period to answer, each sweep crosses the next SYNC."""
    seen, = played(ONE, np.arange(SWEEPS) * 0.02, clock, delay=lambda number: delay,
                   skips=lambda number: number in (EVENT, 3 * EVENT // 2))
    assert not seen.wrong and len(seen.whole) >= SWEEPS - 16


@pytest.mark.parametrize('clock', [HOST, WIRE])
def test_a_node_that_is_gone_holds_up_no_other(clock):
    """A lost node must not delay the other node, even if the lost node has skipped a sweep and answered once more."""
    gone = played(TWO, np.arange(SWEEPS) * period_at(0.95, TWO), clock,
                  first_skips=lambda number: number == EVENT or number > EVENT + 1)
    assert not gone[1].wrong and len(gone[1].whole) >= SWEEPS - 8


def test_on_a_bus_that_is_never_idle_for_long_a_sweep_left_out_costs_not_all():
    """Another device uses part of the bus time, and the rest is free."""
    chatter = Node([0x700], size=1, skips=lambda number: True)
    chatter.chatter(np.arange(0, SWEEPS * 0.02, 0.0004))
    seen, = played(ONE, np.arange(SWEEPS) * 0.02, WIRE, skips=lambda number: number == EVENT, chatter=[chatter])
    assert not seen.wrong and len(seen.whole) >= SWEEPS - 3


@pytest.mark.parametrize(('load', 'foreign', 'clock', 'pads'), with_pads(LOADS, FOREIGN, CLOCKS))
def test_foreign_frames_that_go_first_give_no_frame_a_wrong_stamp(load, foreign, pads, clock):
    """Without foreign frames, all sweeps arrive whole.

    If foreign frames overload the bus, the nodes fall behind and omit sweeps. Above a load of 94 % (90 % with slcan),
    the end of each sweep crosses the next SYNC. At such a load, the assembler once returned only 1 whole frame in
    1,000.
    """
    period = period_at(load, pads)
    others = Node([0x081], skips=lambda number: True)
    if foreign:
        others.chatter(np.arange(0.0, SWEEPS * period, frame_seconds(8) / foreign))
    for seen in played(pads, np.arange(SWEEPS) * period, clock, chatter=[others]):
        assert not seen.wrong and (foreign or len(seen.answered) == SWEEPS)
        # The end of the last sweep may remain uncertain, because no other sweep follows.
        assert len(seen.whole) >= (0.3 * len(seen.answered) if foreign else SWEEPS - 1)


@pytest.mark.slow
@pytest.mark.parametrize('clock', CLOCKS)
@pytest.mark.parametrize('pads', PADS.values(), ids=PADS)
def test_random_timings_and_losses_never_mix_two_sweeps(pads, clock):
    """No frame may have the stamp of a SYNC that its sweep does not answer."""
    assert not any(seen.wrong for seed in range(12 if LONG else 2) for seen in random_world(pads, clock, seed))
