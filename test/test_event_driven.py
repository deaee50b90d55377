"""Tests for skins without SYNC, frame by frame, as sweeps and as snapshots in which each TPDO has an age.

Three TPDOs of node 1 (0x181, 0x281, 0x381) carry a row of 2 taxels each, with value = 2 (counts - 10) Pa. The simulated
devices send the number of their scan in every taxel, so a frame that mixes two scans can be recognised.
"""

import itertools
import os
import re

import numpy as np
import pytest
from can_bench import TINY, Loss, is_balanced, only, tally, telling, tiny_layout
from can_bench import taxel_frames as frames

from tactile_node.assembly.facts import LossReason
from tactile_node.assembly.snapshot_assembler import SNAPSHOT_WAIT, SnapshotAssembler
from tactile_node.assembly.sweep_assembler import SweepAssembler
from tactile_node.errors import ConfigurationError
from tactile_node.sources.node_trust import without_values
from tactile_node.taxel_frame import TaxelStatus

LONG = bool(os.environ.get('TACTILE_LONG'))
T = 0.02
MAX_AGE = 0.05
SWEEPS = TINY + 'event_driven: {transmission_type: 254, event_timer: 0.02, frames: sweeps}\n'
SNAPSHOTS = TINY + ('event_driven: {transmission_type: 255, event_timer: 0.02, inhibit_time: 0.0005, '
                    'frames: snapshots, max_age: 0.05}\n')
MULTIPLEXED = '''
rows: 4
cols: 2
pitch: 0.004
value: {unit: Pa, scale: 1.0, bits: 8}
event_driven: {transmission_type: 254, event_timer: 0, period: 0.01, frames: sweeps, inhibit_time: 0.0005}
tpdos:
- {number: 1, cob_id: 0x190, rows: {first: 0, count: 4, step: [1, 0]}, map: {object: 0x2200, sub: 1, bits: 8, count: 3},
   taxels: {first: [0, 0], step: [0, 1], count: 2, start_bit: 8, bit_step: 8}}
'''
RANKS = 0x181, 0x281, 0x381


def of_layout(layout):
    kind = SweepAssembler if layout.event_driven.is_sweeps else SnapshotAssembler
    return kind(layout, layout.event_driven, (1,))


def made(folder, text, **options):
    return telling(of_layout(tiny_layout(folder, text)), **options)


@pytest.fixture
def sweeps(tmp_path):
    return made(tmp_path, SWEEPS)


@pytest.fixture
def snapshots(tmp_path):
    return made(tmp_path, SNAPSHOTS)


def send(assembler, rank, at, counts=10):
    """Send the same counts for both taxels of a row."""
    return assembler.feed(RANKS[rank], bytes([counts, counts]), at)


def sweep(assembler, at, counts=10, ranks=range(3)):
    """Send the TPDOs ``ranks`` of one scan, 1 ms apart, and return the results."""
    return sum((send(assembler, rank, at + 0.001 * i, counts) for i, rank in enumerate(ranks)), ())


def rows(frame):
    """Return the counts of each row, or None for a row without a value, after checking that both taxels agree."""
    assert ((frame.status == TaxelStatus.VALID) == ~np.isnan(frame.values)).all()
    assert (frame.status[np.isnan(frame.values)] == TaxelStatus.STALE).all()
    np.testing.assert_array_equal(frame.values[:, 0], frame.values[:, 1])
    return [None if np.isnan(value) else int(value / 2 + 10) for value in frame.values[:, 0]]


def test_a_sweep_is_given_with_its_last_tpdo_and_stamped_with_its_first(sweeps):
    assert send(sweeps, 0, 5.0, 11) == send(sweeps, 1, 5.001, 12) == ()
    frame = only(send(sweeps, 2, 5.002, 13))
    assert (rows(frame), frame.stamp, frame.sequence, frame.missing_can_frames) == ([11, 12, 13], 5.0, 0, 0)
    assert frame.tpdo_ages is None
    assert tally(sweeps) == (1, 0, 3, 3, 3, 0)


def test_no_frame_of_any_loss_pattern_mixes_two_sweeps(tmp_path):
    """In three sweeps of three TPDOs, each TPDO is either lost or received, so there are 512 cases.

    The stamp of a frame is that of the first TPDO received.
    """
    layout = tiny_layout(tmp_path, SWEEPS)
    for kept in itertools.product((False, True), repeat=9):
        assembler, results, wanted, sequence = of_layout(layout), (), [], 0
        for scan in range(3):
            ranks = [rank for rank in range(3) if kept[3 * scan + rank]]
            for rank in ranks:
                results += send(assembler, rank, 5 + scan * T + 0.001 * rank, 20 + scan)
            if ranks:
                counts = [20 + scan if rank in ranks else None for rank in range(3)]
                wanted.append((counts, 5 + scan * T + 0.001 * ranks[0], sequence, 3 - len(ranks)))
            sequence += bool(wanted)  # The event timer shows how many sweeps were lost, except before the first frame.
        found = frames(results + assembler.end_period())
        assert [(rows(frame), frame.stamp, frame.sequence, frame.missing_can_frames) for frame in found] == wanted, kept
        assert is_balanced(assembler) and assembler.facts().missing == sum(missing for *_, missing in wanted)


def test_duplicates_change_nothing(sweeps):
    assert send(sweeps, 0, 5.0, 11) == ()
    assert send(sweeps, 0, 5.0001, 11) == (Loss(LossReason.DUPLICATE),)
    frame = only(sweep(sweeps, 5.001, 11, [1, 2]))
    assert send(sweeps, 2, 5.003, 11) == (Loss(LossReason.DUPLICATE),)
    assert rows(frame) == [11, 11, 11] and only(sweep(sweeps, 5 + T)).sequence == 1 and is_balanced(sweeps)


def test_equal_bytes_of_the_next_sweep_are_not_a_duplicate(tmp_path):
    """Without a touch, a pad with a single TPDO sends the same bytes in every sweep."""
    one = re.sub(r'(?m)^- \{number: [23].*\n', '', SWEEPS).replace('rows: 3', 'rows: 1')
    assembler = made(tmp_path, one)
    found = [only(send(assembler, 0, 5 + T * i)) for i in range(3)]
    assert [frame.sequence for frame in found] == [0, 1, 2]


def test_a_changed_order_makes_two_incomplete_frames(sweeps):
    results = sweep(sweeps, 5, 11, [0, 2, 1]) + sweep(sweeps, 5 + T, 12)
    assert [rows(frame) for frame in frames(results)] == [[11, None, 11], [None, 11, None], [12, 12, 12]]
    assert is_balanced(sweeps)


@pytest.mark.parametrize('at', [4.0, 4.9995, 5.09])
def test_a_stamp_out_of_range_belongs_to_another_sweep(sweeps, at):
    send(sweeps, 0, 5.0, 11)
    results = send(sweeps, 1, at, 12) + sweeps.end_period()
    assert [rows(frame) for frame in frames(results)] == [[11, None, None], [None, 12, None]]
    sequences = [frame.sequence for frame in frames(results)]
    assert sequences == sorted(set(sequences))


def test_a_pause_leaves_out_the_sequence_numbers_of_lost_sweeps(sweeps, tmp_path):
    """The event timer is the longest time between two sweeps.

    Without an event timer, the number of lost sweeps is unknown.
    """
    given = [only(sweep(sweeps, at)).sequence for at in (5.0, 5 + 1.4 * T, 5 + 4.4 * T)]
    assert given == [0, 1, 4]
    other = made(tmp_path, SWEEPS.replace('event_timer: 0.02', 'event_timer: 0, period: 0.02'))
    assert [only(sweep(other, at)).sequence for at in (5.0, 5.5)] == [0, 1]


def test_one_stamp_far_ahead_costs_that_sweep_and_none_after_it(sweeps):
    sweep(sweeps, 5.0)
    assert not frames(sweep(sweeps, 5e6))
    assert [len(frames(sweep(sweeps, 5 + k * T))) for k in (2, 3)] == [1, 1] and is_balanced(sweeps)


def test_sweeps_that_an_adapter_has_held_back_are_late(sweeps):
    """TPDOs are stamped on arrival, so held-back sweeps follow each other faster than any device sends them."""
    for number in range(10):
        sweep(sweeps, number * T)
    burst = [frames(sweep(sweeps, 20 * T + 0.0035 * i, counts=100)) for i in range(5)]
    after = [frames(sweep(sweeps, 22 * T + 0.85 * T * i)) for i in range(3)]
    assert not any(burst) and all(len(given) == 1 and rows(given[0]) == [10, 10, 10] for given in after)
    assert sweeps.facts().losses[LossReason.LATE] == 15 and is_balanced(sweeps)


@pytest.mark.parametrize('data', ['0A', '0A0A' + 7 * '00'])
def test_a_wrong_length_is_a_loss_and_its_taxels_are_stale(sweeps, snapshots, data):
    reason = LossReason.SHORT if len(data) == 2 else LossReason.OVER_LONG
    send(sweeps, 0, 5.0)
    assert sweeps.feed(0x281, bytes.fromhex(data), 5.001) == (Loss(reason),)
    assert rows(only(send(sweeps, 2, 5.002))) == [10, None, 10] and is_balanced(sweeps)
    send(snapshots, 0, 5.0)
    assert snapshots.feed(0x281, bytes.fromhex(data), 5.001) == (Loss(reason),)
    assert rows(only(snapshots.end_period())) == [10, None, None] and is_balanced(snapshots)


def test_rows_of_a_multiplexed_tpdo_are_a_sweep(tmp_path):
    assembler = made(tmp_path, MULTIPLEXED)
    results = [assembler.feed(0x190, bytes([row, 3, 4]), 5 + 0.0005 * row) for row in range(4)]
    assert results[:3] == [(), (), ()] and only(results[3]).values.tolist() == [[3, 4]] * 4
    assert assembler.feed(0x190, bytes([4, 3, 4]), 5.01) == (Loss(LossReason.UNKNOWN_ROW),)
    assert assembler.feed(0x190, b'', 5.01) == (Loss(LossReason.SHORT),)


@pytest.mark.parametrize('text', [SWEEPS, SNAPSHOTS], ids=['sweeps', 'snapshots'])
def test_after_a_restart_nothing_of_before_is_given(tmp_path, text):
    assembler = made(tmp_path, text)
    sweep(assembler, 5.0, 11)
    sweep(assembler, 5 + T, 12, [0, 1])
    assembler.restart()
    assert assembler.facts().losses[LossReason.UNFINISHED] == 2
    frame = only(frames(sweep(assembler, 5 + T + 0.002, 13, [2]) + assembler.end_period()))
    assert (rows(frame), frame.sequence) == ([None, None, 13], 0)
    assembler.resume(7)
    assert only(sweep(assembler, 6.0)).sequence == 8 and is_balanced(assembler)


@pytest.mark.parametrize('text', [SWEEPS, SNAPSHOTS], ids=['sweeps', 'snapshots'])
def test_tpdos_from_before_and_after_the_start_of_a_node_are_not_joined(tmp_path, text):
    """The node restarts within milliseconds, and its range or mapping may have changed meanwhile."""
    assembler = made(tmp_path, text)
    results = sweep(assembler, 5.0, 11, [0, 1])
    assembler.node_started(1)
    results += sweep(assembler, 5.002, 12, [2]) + assembler.end_period()
    assert [rows(frame) for frame in frames(results)] == [[11, 11, None], [None, None, 12]]
    assert is_balanced(assembler)


@pytest.mark.parametrize('text', [SWEEPS, SNAPSHOTS], ids=['sweeps', 'snapshots'])
def test_incomplete_frames_can_be_withheld(tmp_path, text):
    assembler = made(tmp_path, text, drop_incomplete=True)
    found = frames(sweep(assembler, 5.0, 11, [0, 1]) + sweep(assembler, 5 + T, 12))
    counts = assembler.facts()
    assert [rows(frame) for frame in found] == [[12, 12, 12]]
    assert (counts.frames_withheld, counts.losses[LossReason.INCOMPLETE], counts.tpdos_used) == (1, 2, 3)
    assert is_balanced(assembler)


# Snapshots

def test_a_snapshot_has_the_age_of_each_tpdo(snapshots):
    assert send(snapshots, 2, 5.0, 13) == send(snapshots, 0, 5.004, 11) == ()
    frame = only(send(snapshots, 1, 5.010, 12))
    assert (rows(frame), frame.stamp, frame.sequence) == ([11, 12, 13], 5.010, 0)
    np.testing.assert_allclose(frame.tpdo_ages.ages, [0.006, 0, 0.010], atol=1e-6)
    assert frame.tpdo_ages.taxel_tpdos.tolist() == [[0, 0], [1, 1], [2, 2]]
    assert frame.tpdo_ages.of(2, 1) == pytest.approx(0.010, abs=1e-6)
    assert tally(snapshots) == (1, 0, 3, 3, 3, 0)


def test_ages_stay_with_a_frame_whose_values_are_taken_away(snapshots, tmp_path):
    """The driver removes the values of a node that was not configured and of a pad that is not valid."""
    frame = only(sweep(snapshots, 5.0, ranks=[2, 1, 0]))
    partly = without_values(frame, tiny_layout(tmp_path).tpdos[2:])
    assert partly.tpdo_ages is frame.tpdo_ages and frame.without(frame.has_value).tpdo_ages is frame.tpdo_ages


def test_the_fastest_tpdo_sets_the_pace_and_none_of_it_is_lost(snapshots):
    sweep(snapshots, 5.0, 11)
    results = sum((send(snapshots, 0, 5 + 0.005 * i, 11 + i) for i in range(1, 8)), ())
    assert [rows(frame)[0] for frame in frames(results)] == [12, 13, 14, 15, 16, 17]
    assert [frame.tpdo_ages.ages[2] for frame in frames(results)] == pytest.approx(
        [0.003, 0.008, 0.013, 0.018, 0.023, 0.028], abs=5e-4)


def test_a_change_does_not_wait_for_the_event_timer_while_others_come(snapshots):
    sweep(snapshots, 5.0)
    send(snapshots, 0, 5.015, 99)
    frame = only(send(snapshots, 1, 5.015 + SNAPSHOT_WAIT + 0.001))
    assert rows(frame)[0] == 99 and frame.stamp == 5.015


def test_a_tpdo_that_stops_is_stale_within_its_age_and_never_valid_after(snapshots):
    results = sweep(snapshots, 5.0, 77)
    results += sum((sweep(snapshots, 5 + T * i, 11, [0, 2]) for i in range(1, 20)), ())
    stopped = 5.001
    for frame in frames(results):
        assert (rows(frame)[1] == 77) == (frame.stamp - stopped <= MAX_AGE)
        assert frame.missing_can_frames == (frame.stamp - stopped > MAX_AGE)
    last = frames(results)[-1]
    # The last snapshot does not wait for the stopped TPDO, which is no longer expected.
    assert last.stamp == 5 + T * 19 + 0.001
    assert rows(frames(sweep(snapshots, 6.0, 12))[-1]) == [12, 12, 12] and is_balanced(snapshots)


@pytest.mark.slow
def test_no_random_fault_makes_old_values_valid_or_ages_wrong(tmp_path):
    """TPDOs arrive at random rates, and their stamps have jitter.

    Each value must be the last one sent, and its age must match its stamp.
    """
    random, layout = np.random.default_rng(9), tiny_layout(tmp_path, SNAPSHOTS)
    for _ in range(60 if LONG else 30):
        assembler, given, last = of_layout(layout), [], {}
        rates = random.uniform(0.002, 0.1, 3)
        events = sorted((at, rank) for rank in range(3) for at in np.cumsum(random.exponential(rates[rank], 60)))
        for number, (at, rank) in enumerate(events):
            stamp = 5 + at - random.uniform(0, 0.004)
            counts = 10 + number % 200
            before, last = last, {**last, rank: (counts, stamp)}
            found = frames(send(assembler, rank, stamp, counts))
            given += [(frame, before, last) for frame in found]
            assert is_balanced(assembler)
        for frame, *latest in given:
            for rank, counts in enumerate(rows(frame)):
                age = float(frame.tpdo_ages.ages[rank])
                assert age >= 0 and (counts is None or age <= MAX_AGE + 1e-6)
                claimed = [sent[0] == counts and abs(frame.stamp - age - sent[1]) < 1e-5
                           for sent in (each.get(rank, (None, 0)) for each in latest)]
                assert counts is None or any(claimed)
        stamps = [frame.stamp for frame, *_ in given]
        sequences = [frame.sequence for frame, *_ in given]
        assert len(given) > 20 and stamps == sorted(stamps) and sequences == list(range(len(sequences)))


def test_silence_makes_all_values_stale_and_a_repetition_renews_no_age(snapshots):
    sweep(snapshots, 5.0, 11)
    frame = frames(send(snapshots, 0, 5.2, 12) + snapshots.end_period())[-1]
    assert rows(frame) == [12, None, None]
    sweep(snapshots, 6.0, 11)
    assert send(snapshots, 2, 6.004, 11) == (Loss(LossReason.DUPLICATE),)
    frame = frames(send(snapshots, 0, 6.005, 12) + snapshots.end_period())[-1]
    assert frame.tpdo_ages.ages[2] == pytest.approx(0.003, abs=1e-6)


def test_a_clock_that_was_set_back_forgets_all_values(snapshots):
    """If the assembler kept the old values, new values would be STALE until the clock had caught up."""
    sweep(snapshots, 5.0, 11)
    results = sweep(snapshots, 2.0, 12, [0, 1]) + snapshots.end_period()
    frame = only(frames(results))
    assert rows(frame) == [12, 12, None] and frame.stamp == 2.001 and is_balanced(snapshots)


def test_one_stamp_of_the_future_spoils_one_frame(snapshots):
    sweep(snapshots, 5.0, 11)
    results = send(snapshots, 1, 5000.0, 12) + sweep(snapshots, 5 + T, 13)
    assert [rows(frame) for frame in frames(results)] == [[None, 12, None], [13, 13, 13]]
    assert frames(results)[-1].stamp == 5 + T + 0.002 and is_balanced(snapshots)


def test_at_the_start_a_snapshot_waits_for_all_tpdos(snapshots):
    assert sweep(snapshots, 5.0, 11, [0]) == sweep(snapshots, 5.015, 11, [1]) == ()
    assert rows(only(sweep(snapshots, 5.018, 11, [2]))) == [11, 11, 11]


def test_used_by_node_and_a_node_that_ends(tmp_path):
    """A silent node makes only its own rows STALE.

    The pad has two nodes, and the assembler counts the TPDOs of each node separately.
    """
    text = 'nodes: 2\n' + SNAPSHOTS.replace('number: 3', 'node: 1, number: 3')
    layout = tiny_layout(tmp_path, text)
    assembler = telling(SnapshotAssembler(layout, layout.event_driven, (1, 2)))
    ids = {0: 0x181, 1: 0x281, 2: 0x382}
    results = sum((assembler.feed(ids[rank], bytes([11, 11]), 5 + 0.001 * rank) for rank in range(3)), ())
    results += sum((assembler.feed(ids[rank], bytes([12, 12]), 5 + T * i + 0.001 * rank)
                    for i in range(1, 6) for rank in range(2)), ())
    assert rows(frames(results)[0]) == [11, 11, 11] and rows(frames(results)[-1]) == [12, 12, None]
    assert assembler.facts().used_by_node[1] == 1 and is_balanced(assembler)


BAD = {
    'no type': (SWEEPS.replace('transmission_type: 254, ', ''), 'key "event_driven.transmission_type"'),
    'synchronous type': (SWEEPS.replace('254', '1'), '254..255'),
    'no timer': (SWEEPS.replace('event_timer: 0.02, ', ''), 'key "event_driven.event_timer"'),
    'half a millisecond': (SWEEPS.replace('0.02', '0.0205'), 'steps of 0.001 s'),
    'milliseconds': (SWEEPS.replace('0.02', '20000'), '20 ms is 0.02'),
    'inhibit too fine': (SNAPSHOTS.replace('0.0005', '0.00005'), 'steps of 0.0001 s'),
    'inhibit beyond the timer': (SNAPSHOTS.replace('0.0005', '0.021'), 'at most the event timer'),
    'neither': (SWEEPS.replace('frames: sweeps', 'frames: both'), 'key "event_driven.frames"'),
    'sweeps without any time': (SWEEPS.replace('0.02', '0'), 'key "event_driven.period"'),
    'sweeps slower than their timer': (SWEEPS.replace('frames', 'period: 0.03, frames'), 'at most the event timer'),
    'snapshots without a timer': (SNAPSHOTS.replace('event_timer: 0.02', 'event_timer: 0'),
                                  'key "event_driven.event_timer"'),
    'an age that every TPDO reaches': (SNAPSHOTS.replace('0.05}', '0.02}'), 'more than the event timer'),
    'an age of a sweep': (SWEEPS.replace('frames', 'max_age: 0.1, frames'), 'key "event_driven.max_age"'),
    'a period of snapshots': (SNAPSHOTS.replace('frames', 'period: 0.01, frames'), 'key "event_driven.period"'),
    'several nodes': ('nodes: 2\n' + SWEEPS.replace('number: 3', 'node: 1, number: 3'), 'scan at different times'),
    'sweep slowed by inhibit': (MULTIPLEXED.replace('0.0005', '0.0016'), 'within 0.0045 s')}


@pytest.mark.parametrize(('text', 'says'), BAD.values(), ids=BAD)
def test_bad_layouts_are_refused(tmp_path, text, says):
    with pytest.raises(ConfigurationError, match=re.escape(says)):
        tiny_layout(tmp_path, text)


def test_times_of_a_layout(tmp_path):
    assert tiny_layout(tmp_path, SNAPSHOTS.replace(', max_age: 0.05', '')).event_driven.max_age == pytest.approx(0.06)
    assert not tiny_layout(tmp_path, SNAPSHOTS).needs_sync and tiny_layout(tmp_path, TINY).needs_sync
