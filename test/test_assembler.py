"""Tests that feed the frame assembler with hand-written CAN frames.

Node 1 sends 3 TPDOs (0x181, 0x281, 0x381), and each TPDO carries one row of 2 taxels.
"""

import os

import numpy as np
import pytest
from can_bench import TINY, Loss, is_balanced, only, tally, taxel_frames, telling, tiny_layout

from tactile_node.assembly.facts import LossReason
from tactile_node.assembly.free_bus import FreeBus
from tactile_node.assembly.health import TpdoOrder
from tactile_node.assembly.router import Router
from tactile_node.assembly.sync_assembler import SyncAssembler
from tactile_node.skin.pads import PadSettings
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus

VALID, STALE, DEAD, SATURATED = TaxelStatus.VALID, TaxelStatus.STALE, TaxelStatus.DEAD, TaxelStatus.SATURATED
NAN = np.nan
ROW_1, ROW_2, ROW_3 = 0x181, 0x281, 0x381
LONG = bool(os.environ.get('TACTILE_LONG'))


@pytest.fixture
def assembler(tmp_path):
    return telling(SyncAssembler(tiny_layout(tmp_path), (1,)))


def send(assembler, *frames, at=0.5):
    """Feed CAN frames, given as pairs of COB-ID and hex bytes, and return the last result."""
    results = [assembler.feed(can_id, bytes.fromhex(data), at) for can_id, data in frames]
    return only(results[-1])


def check(frame, values, sequence=0, missing=0):
    assert isinstance(frame, TaxelFrame)
    np.testing.assert_array_equal(frame.values, np.array(values, np.float32))
    assert (frame.sequence, frame.missing_can_frames) == (sequence, missing)
    assert not frame.values.flags.writeable and not frame.status.flags.writeable


def test_whole_period_is_given_with_its_last_tpdo(assembler):
    assert only(assembler.sync(7.25)) is None
    assert send(assembler, (ROW_1, '0A0B'), at=7.3) is None
    assert send(assembler, (ROW_2, '0C0D'), at=7.3) is None
    frame = send(assembler, (ROW_3, '00FE'), at=7.3)
    check(frame, [[0, 2], [4, 6], [-20, 488]])
    assert frame.stamp == 7.25 and (frame.status == VALID).all()
    assert only(assembler.sync(8.25)) is None  # The assembler returns each taxel frame only once.
    assert tally(assembler)[:5] == (1, 0, 3, 3, 3) and is_balanced(assembler)


def test_the_router_adds_the_time_of_acquisition(tmp_path):
    frames = []
    router = Router((PadSettings('pad', (1,), tiny_layout(tmp_path)),), lambda pad, frame: frames.append(frame),
                    lambda stamp: stamp - 5.0)
    router.sync(7.25)
    for can_id, data in ((ROW_1, '0A0B'), (ROW_2, '0C0D'), (ROW_3, '00FE')):
        router.feed(can_id, bytes.fromhex(data), 7.3)
    assert [(frame.stamp, frame.acquired) for frame in frames] == [(7.25, 2.25)]


def test_full_scale_is_saturated_and_still_given(assembler):
    assembler.sync(0)
    frame = send(assembler, (ROW_1, '0A0A'), (ROW_2, '0AFF'), (ROW_3, '0A0A'))
    check(frame, [[0, 0], [0, 490], [0, 0]])
    assert frame.status.tolist() == [[VALID, VALID], [VALID, SATURATED], [VALID, VALID]]


@pytest.mark.parametrize(('lost', 'values', 'at_sync'), [
    (ROW_1, [[NAN, NAN], [2, 2], [4, 4]], True), (ROW_2, [[0, 0], [NAN, NAN], [4, 4]], True),
    (ROW_3, [[0, 0], [2, 2], [NAN, NAN]], False)])
def test_missing_tpdo_gives_nan_as_soon_as_it_cannot_come(assembler, lost, values, at_sync):
    """The assembler returns a frame at the next SYNC if the sweep has ended, otherwise when the next sweep begins."""
    period = [(ROW_1, '0A0A'), (ROW_2, '0B0B'), (ROW_3, '0C0C')]
    assembler.sync(0)
    send(assembler, *(f for f in period if f[0] != lost))
    ended, began = assembler.sync(1), send(assembler, period[0], at=1.5)
    frame = only(ended) if at_sync else began
    check(frame, values, missing=1)
    assert (frame.status == np.where(np.isnan(values), STALE, VALID)).all()
    # No TPDO of the next period is missing.
    check(send(assembler, *period[1:], at=1.5), [[0, 0], [2, 2], [4, 4]], sequence=1)
    assert assembler.facts().missing == 1 and is_balanced(assembler)


def test_silent_periods_are_all_stale(assembler):
    assembler.sync(0)
    for sequence in range(3):
        check(only(assembler.sync(sequence + 1)), np.full((3, 2), NAN), sequence, missing=3)


def test_sweeps_after_silence_are_lost_until_a_free_bus_proves_that_none_is_late(assembler):
    """After a silence, each sweep may belong to the previous period."""
    sweep = [(ROW_1, '0B0B'), (ROW_2, '0B0B'), (ROW_3, '0B0B')]
    assembler.sync(0)
    given = [*assembler.sync(1)]
    for period in range(1, 51):
        assert send(assembler, *sweep, at=period + 0.5) is None
        given += assembler.sync(period + 1)
    assert given.count(Loss(LossReason.LATE, 3)) == 50 and assembler.facts().losses[LossReason.LATE] == 150
    for sequence, frame in enumerate(result for result in given if isinstance(result, TaxelFrame)):
        check(frame, np.full((3, 2), NAN), sequence, missing=3)
    assert assembler.is_in_doubt
    assembler.bus_was_free()
    assert not assembler.is_in_doubt and send(assembler, *sweep, at=51.5) is None
    check(only(assembler.sync(52)), np.full((3, 2), 2), sequence=51)
    check(send(assembler, *sweep, at=52.5), np.full((3, 2), 2), sequence=52)
    assert is_balanced(assembler)


def test_a_sweep_that_is_late_as_a_whole_is_lost_once_the_next_one_begins(assembler):
    assembler.sync(0)
    check(only(assembler.sync(1)), np.full((3, 2), NAN), missing=3)
    assert send(assembler, (ROW_1, '0B0B'), (ROW_2, '0B0B'), (ROW_3, '0B0B'), at=1.1) is None
    assert send(assembler, (ROW_1, '0C0C'), at=1.2) == Loss(LossReason.LATE, 3)
    check(send(assembler, (ROW_2, '0C0C'), (ROW_3, '0C0C'), at=1.2), np.full((3, 2), 4), sequence=1)
    assert is_balanced(assembler)


def test_a_started_node_is_not_behind(assembler):
    """After a power cycle, the supervisor starts the node in the middle of a period."""
    sweep = [(ROW_1, '0B0B'), (ROW_2, '0B0B'), (ROW_3, '0B0B')]
    for stamp in range(50):
        assembler.sync(stamp)
    assembler.node_started(1)
    assembler.sync(50)
    check(send(assembler, *sweep, at=50.5), np.full((3, 2), 2), sequence=50)
    assert assembler.facts().missing == 50 * 3 and is_balanced(assembler)


def test_a_late_tail_goes_back_to_its_period_once_the_next_sweep_begins(assembler):
    """A node sends its TPDOs in a fixed order.

    TPDOs that arrive before the node's first TPDO of the current period therefore belong to an earlier period.
    """
    assembler.sync(0)
    send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'))
    assert assembler.sync(1) == ()
    # This TPDO belongs to the previous period but arrives after the SYNC.
    assert send(assembler, (ROW_3, '0F0F'), at=1.1) is None
    first = only(assembler.feed(ROW_1, b'\x0B\x0B', 1.2))
    check(first, [[0, 0], [0, 0], [10, 10]])
    assert send(assembler, (ROW_2, '0B0B'), at=1.2) is None
    second = only(assembler.feed(ROW_3, b'\x0B\x0B', 1.3))
    check(second, [[2, 2], [2, 2], [2, 2]], sequence=1)
    assert (first.stamp, second.stamp) == (0, 1) and is_balanced(assembler)
    assert assembler.facts().losses[LossReason.LATE] == 0


@pytest.mark.parametrize('after', [[ROW_1, ROW_2], [ROW_2, ROW_1], [ROW_1, ROW_1, ROW_2, ROW_3]],
                         ids=['end lost', 'order lost', 'begun twice'])
def test_once_the_order_was_changed_a_late_tail_needs_a_whole_sweep_after_it(assembler, after):
    """If the bus or the adapter reorders TPDOs, the apparent end of a late sweep may belong to the new period."""
    assembler.sync(-1)
    for row in (ROW_1, ROW_3, ROW_2):
        assembler.feed(row, b'\x0A\x0A', -0.5)
    assert assembler.facts().losses[LossReason.OUT_OF_ORDER]
    assembler.sync(0)
    send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'))
    assembler.sync(1)
    send(assembler, (ROW_3, '0F0F'), at=1.1)
    for i, row in enumerate(after):
        assembler.feed(row, bytes([11 + i] * 2), 1.2)
    assembler.end_period()
    statistics = assembler.facts()
    assert statistics.missing >= 1 and statistics.losses[LossReason.OUT_OF_ORDER] > 2 and is_balanced(assembler)
    assert statistics.frames_complete <= 1


def test_lone_possible_tail_is_not_published_as_fresh(assembler):
    assembler.sync(0)
    send(assembler, (ROW_1, '0A0A'))
    assembler.sync(1)
    # These two TPDOs are either the end of sweep 0, or sweep 1 without its first TPDO.
    send(assembler, (ROW_2, '0F0F'), (ROW_3, '0F0F'), at=1.1)
    first, second, late = assembler.sync(2)
    check(first, [[0, 0], [NAN, NAN], [NAN, NAN]], missing=2)
    check(second, np.full((3, 2), NAN), sequence=1, missing=3)
    assert late == Loss(LossReason.LATE, 2) and is_balanced(assembler)


def test_an_order_that_was_changed_once_is_forgotten_after_a_free_bus(assembler):
    """The end of each sweep crosses the next SYNC, which can look like a changed order."""
    assembler.sync(-1)
    for row in (ROW_1, ROW_3, ROW_2):
        assembler.feed(row, b'\x0A\x0A', -0.5)
    whole = []
    for period in range(100):
        given = [*assembler.sync(period)]
        if period == 50:
            assembler.bus_was_free()
        else:
            given += assembler.feed(ROW_3, bytes([9 + period] * 2), period + 0.1)
        for row in (ROW_1, ROW_2):
            given += assembler.feed(row, bytes([10 + period] * 2), period + 0.2)
        whole += [frame.sequence - 1 for frame in taxel_frames(given) if not frame.missing_can_frames]
    assert whole == list(range(50, 99)) and is_balanced(assembler)


def test_a_part_of_the_tail_is_moved_too_and_older_tpdos_are_late(assembler):
    assembler.sync(10.0)
    send(assembler, (ROW_1, '0F0F'), at=10.1)
    assembler.sync(11.0)
    check(send(assembler, (ROW_2, '0F0F'), (ROW_3, '0F0F'), at=10.2), np.full((3, 2), 10))
    # The frame of the earlier period has already been returned.
    assert send(assembler, (ROW_1, '0E0E'), at=10.3) == Loss(LossReason.LATE)
    check(send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'), (ROW_3, '0A0A'), at=11.2), np.zeros((3, 2)), sequence=1)
    assert is_balanced(assembler)


@pytest.mark.parametrize('older', [1, 2, 3])
def test_tpdos_from_before_the_previous_sync_belong_to_neither_period(assembler, older):
    """In this test, the driver lags by two periods.

    The driver receives SYNCs 1 and 2 first, then the rest of sweep 0, and then sweeps 1 and 2.
    """
    sweeps = [(row, bytes([11 + period] * 2), 10.5 + period) for period in range(3) for row in (ROW_1, ROW_2, ROW_3)]
    assembler.sync(10.0)
    for sent in sweeps[:3 - older]:
        assembler.feed(*sent)
    given = [*assembler.sync(11.0), *assembler.sync(12.0)]
    for sent in sweeps[3 - older:]:
        given += assembler.feed(*sent)
    frames = taxel_frames(given)
    check(frames[0], [[2, 2]] * (3 - older) + [[NAN, NAN]] * older, missing=older)
    check(frames[1], np.full((3, 2), NAN), sequence=1, missing=3)
    check(frames[2], np.full((3, 2), 6), sequence=2)
    assert len(frames) == 3 and assembler.facts().losses[LossReason.LATE] == older + 3 and is_balanced(assembler)


def played(assembler, script):
    """Play a script, and map the sequence number of each frame to the sweeps found in the frame.

    In the script, S2 is a SYNC at 2 s, and F is a free bus. A1@1.5 is row A of sweep 1 with the stamp 1.5 s. B1 is row
    B of sweep 1 with a stamp 0.5 s after the last SYNC.
    """
    given, rows, now = [], {'A': ROW_1, 'B': ROW_2, 'C': ROW_3}, 0.0
    for word in script.split():
        name, _, stamp = word.partition('@')
        if name[0] == 'S':
            now = float(name[1:])
            given += assembler.sync(now)
        elif name == 'R':
            assembler.resume(0)
        elif name == 'F':
            assembler.bus_was_free()
        else:
            given += assembler.feed(rows[name[0]], bytes([10 + int(name[1:])] * 2), float(stamp or now + 0.5))
    given += assembler.end_period()
    assert is_balanced(assembler)
    return {frame.sequence: set(frame.values[~np.isnan(frame.values)] / 2) for frame in given
            if isinstance(frame, TaxelFrame)}


@pytest.mark.parametrize(('script', 'frames'), [
    ('S0 A0 B0 C0 S1 A1 S2 S3 B1@2.05 C1@2.1 A2@3.05 B2@3.1 C2@3.2', [{0}, {1}, set(), set()]),
    ('S0 A0 B0 S1 S2 C0@1.05 C1@2.05 S3 A2@3.1 B2@3.15 C2@3.2', [{0}, set(), set(), set()]),
    ('S0 R S1 A0 B0 C0 A1 B1 C1', [set(), {1}]), ('S0 A0 R S1 B0 C0 S2', [set(), set()])],
    ids=['behind by one and lagging', 'end of one and a lagging driver', 'resumed while behind', 'resumed amid'])
def test_sweeps_that_may_be_old_are_not_given(assembler, script, frames):
    found = played(assembler, script)
    for sequence, sweeps in enumerate(frames):
        assert found.get(sequence, set()) <= sweeps, found


def test_a_sender_that_often_skips_a_period_is_not_ignored_for_ever(assembler):
    script = ' '.join((f'S{i}', f'S{i} A{i} B{i} C{i}', f'S{i} F A{i} B{i} C{i}')[i % 3] for i in range(90))
    found = played(assembler, script)
    assert sum(bool(sweeps) for sweeps in found.values()) >= 10
    assert all(sweeps <= {sequence} for sequence, sweeps in found.items())


@pytest.mark.parametrize(('taken', 'foreign', 'until', 'is_over'), [
    (1.004, [], 1.0205, True), (1.004, [], 1.0125, False), (1.014, [], 1.0205, True), (1.015, [], 1.0205, False),
    (1.004, [0.99, 1.005], 1.0165, True), (1.004, [1.012, 1.0122, 1.0124], 1.0165, False), (None, [], 1.0205, False)])
def test_a_free_bus_at_the_due_time_of_an_answer_proves_that_there_is_no_answer(taken, foreign, until, is_over):
    """The answer to the SYNC at 1.0 s is due at 1.01 s.

    If no TPDO has arrived since the SYNC at 1.0 s, the adapter may be holding back all TPDOs, so a free bus proves
    nothing.
    """
    bus = FreeBus(1_000_000)
    for stamp in (0.98, 1.0):
        bus.sync(stamp)
    if taken is not None:
        bus.saw_tpdo(taken)
    for stamp in foreign:
        bus.saw_frame(stamp)
    bus.sync(1.02)
    assert bus.nothing_pending(until) == is_over


def test_a_bus_that_seemed_free_because_of_the_adapter_causes_no_wrong_stamp(assembler):
    for stamp in (0.98, 1.0):
        assembler.sync(stamp)
        if stamp < 1.0:
            send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'), (ROW_3, '0A0A'), at=0.985)
    assembler.sync(1.02)
    assembler.bus_was_free()
    results = []
    for data in (b'\x0A\x0A', b'\x0B\x0B'):  # The late sweep and the current sweep arrive together.
        for row in (ROW_1, ROW_2, ROW_3):
            results += assembler.feed(row, data, 1.021)
    late, frame = results
    check(frame, np.full((3, 2), 2), sequence=2)
    assert late == Loss(LossReason.LATE, 3) and assembler.sync(1.04) == () and is_balanced(assembler)


def test_stamps_of_two_clocks_are_not_compared(tmp_path):
    assembler = telling(SyncAssembler(tiny_layout(tmp_path), (1,), one_clock=False))
    assembler.sync(1e9)
    check(send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'), (ROW_3, '0A0A'), at=3.0), np.zeros((3, 2)))


def test_repeated_frame_is_a_duplicate(assembler):
    assembler.sync(0)
    assert send(assembler, (ROW_1, '0A0B'), (ROW_1, '0A0B')) == Loss(LossReason.DUPLICATE)
    check(send(assembler, (ROW_2, '0A0A'), (ROW_3, '0A0A')), [[0, 2], [0, 0], [0, 0]])
    assert assembler.facts().losses[LossReason.DUPLICATE] == 1 and is_balanced(assembler)


def test_same_cob_id_with_other_bytes_shows_a_lost_sync(assembler):
    """Row 2 arrives twice without a SYNC in between, so the period of each row is unknown."""
    assembler.sync(0)
    assert send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'), (ROW_2, '0B0B')) == Loss(LossReason.LATE, 3)
    assert send(assembler, (ROW_3, '0B0B')) == Loss(LossReason.LATE)
    check(only(assembler.sync(1)), np.full((3, 2), NAN), missing=3)
    check(send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'), (ROW_3, '0A0A'), at=1.5), np.zeros((3, 2)), sequence=1)
    assert is_balanced(assembler)


def test_frames_after_a_complete_one_are_surplus(assembler):
    assembler.sync(0)
    send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'), (ROW_3, '0A0A'))
    assert send(assembler, (ROW_1, '0F0F')) == Loss(LossReason.SURPLUS)
    assert only(assembler.sync(1)) is None
    send(assembler, (ROW_2, '0F0F'), (ROW_3, '0F0F'), at=1.1)  # The surplus sweep continues after the SYNC.
    assert send(assembler, (ROW_1, '0B0B'), at=1.5) == Loss(LossReason.LATE, 2)
    check(send(assembler, (ROW_2, '0B0B'), (ROW_3, '0B0B'), at=1.5), np.full((3, 2), 2), sequence=1)
    assert is_balanced(assembler)


@pytest.mark.parametrize(('data', 'reason'), [('', LossReason.SHORT), ('0A', LossReason.SHORT),
                                              ('0A0A' + 7 * '00', LossReason.OVER_LONG)])
def test_wrong_length_makes_its_taxels_stale(assembler, data, reason):
    assembler.sync(0)
    assert send(assembler, (ROW_1, '0A0A'), (ROW_2, data)) == Loss(reason)
    frame = send(assembler, (ROW_3, '0A0A'))
    check(frame, [[0, 0], [NAN, NAN], [0, 0]], missing=1)
    assert frame.status[1].tolist() == [STALE, STALE]
    assert assembler.facts().frames_incomplete == 1 and is_balanced(assembler)


def test_the_first_bytes_of_a_padded_tpdo_are_used_and_the_padding_is_reported_once(assembler, caplog):
    """If a PDO is longer than its mapping, CiA 301 uses only its first bytes.

    Some devices pad every TPDO to 8 bytes.
    """
    for number, padding in enumerate(('00' * 6, 'FF' * 6, 'FF')):
        assembler.sync(number)
        send(assembler, (ROW_1, '0A0B' + padding), (ROW_2, '0A0A'), at=number + 0.5)
        check(send(assembler, (ROW_3, '0C0C' + padding), at=number + 0.5), [[0, 2], [0, 0], [4, 4]], sequence=number)
    counts = assembler.facts()
    assert (counts.frames_complete, counts.tpdos_used, counts.tpdos_padded, sum(counts.losses.values())) == (3, 9, 6, 0)
    assert is_balanced(assembler)
    report, = caplog.records
    assert report.fact == (1, ROW_1) and all(part in report.getMessage() for part in ('0x181', '8 bytes', 'first 2'))


def test_before_the_first_sync_nothing_is_taken(assembler):
    assert send(assembler, (ROW_1, '0A0A')) == Loss(LossReason.BEFORE_FIRST_SYNC)
    assert assembler.facts().losses[LossReason.BEFORE_FIRST_SYNC] == 1 and is_balanced(assembler)


def test_restart_counts_the_unfinished_and_begins_at_zero(assembler):
    assembler.sync(0)
    assembler.sync(1)
    send(assembler, (ROW_1, '0A0A'), at=1.5)
    assembler.restart()
    assert assembler.facts().losses[LossReason.UNFINISHED] == 1 and is_balanced(assembler)
    assert only(assembler.sync(5)) is None
    check(send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'), (ROW_3, '0A0A'), at=5.5), np.zeros((3, 2)))


@pytest.mark.slow
@pytest.mark.parametrize(('loss', 'most_delayed', 'given'), [(0.1, 2, 1000), (0.0, 2, 2850), (0.0, 8, 2400)])
def test_random_loss_and_delay_never_mixes_periods(tmp_path, loss, most_delayed, given):
    """In each period, the node sends the period's number in all taxels.

    TPDOs are lost or delayed beyond later SYNCs, but they stay in order. Without losses, the assembler uses most late
    TPDOs.
    """
    assembler = SyncAssembler(tiny_layout(tmp_path), (1,))
    rng = np.random.default_rng(5)
    backlog, results = [], []
    for period in range(3000):
        results += assembler.sync(period)
        if not backlog:
            assembler.bus_was_free()
        backlog += [(can_id, bytes([period % 250 + 5] * 2))
                    for can_id in (ROW_1, ROW_2, ROW_3) if rng.random() > loss]
        delayed = int(rng.integers(0, most_delayed + 1)) if rng.random() < 0.3 else 0
        ready = max(0, len(backlog) - delayed)
        now, backlog = backlog[:ready], backlog[ready:]
        for can_id, data in now:
            results += assembler.feed(can_id, data, period + 0.5)
    frames = [*results, *assembler.end_period()]
    assert [frame.sequence for frame in frames] == list(range(3000)) and is_balanced(assembler)
    values = np.array([frame.values for frame in frames])
    assert (np.isnan(values) | (values / 2 + 5 == (np.arange(3000) % 250)[:, np.newaxis, np.newaxis])).all()
    assert np.isfinite(values).any((1, 2)).sum() > given
    assert assembler.facts().frames_complete > (given if most_delayed == 2 else 0)


def test_reordered_tpdos_are_counted_apart_and_never_joined(assembler):
    assembler.sync(0)
    assert send(assembler, (ROW_1, '0A0A'), (ROW_3, '0A0A'), (ROW_2, '0B0B')) == Loss(LossReason.OUT_OF_ORDER, 2)
    assert assembler.end_period()[1:] == (Loss(LossReason.OUT_OF_ORDER, 1),)
    losses = assembler.facts().losses
    assert (losses[LossReason.OUT_OF_ORDER], losses[LossReason.LATE]) == (3, 0) and is_balanced(assembler)


def test_incomplete_sweeps_can_be_dropped(tmp_path):
    assembler = telling(SyncAssembler(tiny_layout(tmp_path), (1,)), drop_incomplete=True)
    assembler.sync(0)
    send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'))
    assert assembler.sync(1) == ()
    assert send(assembler, (ROW_1, '0B0B'), at=1.5) == Loss(LossReason.INCOMPLETE, 2)
    check(send(assembler, (ROW_2, '0B0B'), (ROW_3, '0B0B'), at=1.5), np.full((3, 2), 2), sequence=1)
    statistics = assembler.facts()
    assert (statistics.frames_complete, statistics.frames_incomplete, statistics.frames_withheld) == (1, 0, 1)
    assert statistics.losses[LossReason.INCOMPLETE] == 2 and statistics.tpdos_expected == 6 and is_balanced(assembler)


def fates(periods, of=(), begin=0):
    """Yield every combination of losses and delays for 3 TPDOs in each period.

    A TPDO is lost (None), arrives in its own period, or arrives in the next period. The TPDOs stay in order.
    """
    if len(of) == 3 * periods:
        yield of
        return
    own = len(of) // 3
    for fate in (None, own, own + 1):
        if fate is None or fate >= begin:
            yield from fates(periods, (*of, fate), begin if fate is None else fate)


@pytest.mark.slow
@pytest.mark.parametrize(('periods', 'ways', 'step'), [(2, 400, 1), (3, 8000, 1 if LONG else 17)])
def test_no_frame_is_wrong_after_any_loss_or_delay_of_one_period(tmp_path, periods, ways, step):
    """TPDOs of the first ``periods`` are lost or late, and all later TPDOs arrive in time.

    With two periods, the test tries every combination. With three periods, the test tries every 17th combination, or
    all of them with TACTILE_LONG. The first taxel holds the number of the period in which its TPDO was sent.
    """
    layout, fate_of_all = tiny_layout(tmp_path), list(fates(periods))
    for fate in fate_of_all[::step]:
        assembler, frames = SyncAssembler(layout, (1,)), []
        for period in range(periods + 6):
            sent = [(i % 3, i // 3) for i, comes in enumerate(fate) if comes == period]
            sent += [(row, period) for row in range(3)] if period >= periods else []
            frames += assembler.sync(period)
            if period == periods + 3:
                assembler.bus_was_free()
            for row, count in sent:
                frames += assembler.feed((ROW_1, ROW_2, ROW_3)[row], bytes([10 + count] * 2), period + 0.5)
        frames = [*frames, *assembler.end_period()]
        assert [frame.sequence for frame in frames] == list(range(periods + 6))
        assert is_balanced(assembler)
        values = np.array([frame.values[:, 0] for frame in frames]) / 2
        assert (np.isnan(values) | (values == np.arange(periods + 6)[:, np.newaxis])).all(), fate
        assert not frames[-1].missing_can_frames, fate
    assert len(fate_of_all) == ways


@pytest.mark.parametrize('a_period', [4, 5, 7, 10, 30, 1000])
@pytest.mark.parametrize('lost', [0, 1, 3])
def test_tpdos_that_an_adapter_has_held_back_get_no_present_stamp(tmp_path, lost, a_period):
    """An adapter that has held back TPDOs releases ``a_period`` of them in each period until its queue is empty.

    Sweep n is sampled at SYNC n, and each of its taxels has the value 2 * (n // 2).
    """
    assembler = telling(SyncAssembler(tiny_layout(tmp_path), (1,), one_clock=False))
    waiting, frames = [], []
    for period in range(10 + 40 + 200):
        results = assembler.sync(float(period))
        if not waiting and period > 50:
            assembler.bus_was_free()
        waiting += [(can_id, bytes([10 + period // 2] * 2)) for can_id in (ROW_1, ROW_2, ROW_3)]
        if period == 50:
            del waiting[:lost]
        taken = {True: len(waiting), False: a_period}[period < 10] if not 10 <= period < 50 else 0
        for can_id, data in waiting[:taken]:
            results += assembler.feed(can_id, data, period + 0.5)
        del waiting[:taken]
        frames += taxel_frames(results)
    for frame in frames:
        values = frame.values[np.isfinite(frame.values)]
        assert (values == 2 * (frame.sequence // 2)).all(), (frame.sequence, values)
    assert np.isfinite(frames[-1].values).all() and is_balanced(assembler)


UNSORTED = TINY.replace('number: 1,', 'number: 8,')  # In row order, the TPDOs have the numbers 8, 2 and 3.


@pytest.mark.parametrize('order', [(1, 0, 2), (0, 2, 1), (2, 1, 0), (1, 2, 0), (2, 0, 1)])
def test_the_order_in_which_a_device_sends_is_named_and_no_two_periods_are_mixed(tmp_path, order):
    """In two of the tested orders, each period also looks like the end of one late sweep and the start of another."""
    assembler = telling(SyncAssembler(tiny_layout(tmp_path, UNSORTED), (1,)))
    frames = []
    for number in range(300):
        frames += taxel_frames(assembler.sync(number))
        for place in order:
            word = bytes([10 + number % 100] * 2)
            frames += taxel_frames(assembler.feed((ROW_1, ROW_2, ROW_3)[place], word, number + 0.2))
    seen = [np.unique(frame.values[np.isfinite(frame.values)]) for frame in frames]
    assert frames and all(len(values) <= 1 for values in seen)
    names = '8', '2', '3'
    assert assembler.facts().orders == (TpdoOrder(1, tuple(names[place] for place in order), names),)
    for number in range(300, 300 + 3):  # The device now sends in the order of the layout.
        assembler.sync(number)
        send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'), (ROW_3, '0A0A'), at=number + 0.2)
    assembler.sync(number + 1)
    assert assembler.facts().orders == (None,) and is_balanced(assembler)


def test_a_device_that_is_late_by_part_of_a_sweep_has_the_order_of_the_layout(assembler):
    assembler.sync(0)
    send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'))
    for number in range(1, 10):
        assembler.sync(number)
        send(assembler, (ROW_3, '0A0A'), (ROW_1, '0A0A'), (ROW_2, '0A0A'), at=number + 0.2)
    assert assembler.facts().orders == (None,)


def test_each_of_two_nodes_has_its_own_order(tmp_path):
    text = 'nodes: 2\n' + TINY.replace('{number: 3, ', '{node: 1, number: 3, ')
    assembler = telling(SyncAssembler(tiny_layout(tmp_path, text), (1, 2)))
    for number in range(3):
        assembler.sync(number)
        for can_id in (ROW_2, 0x382, ROW_1):
            assembler.feed(can_id, b'\x0A\x0A', number + 0.2)
    assembler.end_period()
    assert assembler.facts().orders == (TpdoOrder(1, ('2', '1'), ('1', '2')), None)


def test_without_sync_the_order_of_tpdos_takes_no_memory(assembler):
    """A period lasts until the next SYNC, but that SYNC may never arrive."""
    assembler.sync(0.0)
    for number in range(1000):
        assembler.feed((ROW_1, ROW_2, ROW_3)[number % 3], bytes([number % 250] * 2), 0.1)
    assert len(assembler._nodes[1].received) <= 4
