"""The assembler, byte by byte. 3 TPDOs (node 1: 0x181, 0x281, 0x381) carry a row of 2 taxels each."""

import numpy as np
import pytest
from can_bench import tiny_layout

from tactile_node.canbus.assembler import FrameAssembler
from tactile_node.canbus.losses import Loss, LossReason
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus

VALID, STALE, DEAD, SATURATED = TaxelStatus.VALID, TaxelStatus.STALE, TaxelStatus.DEAD, TaxelStatus.SATURATED
NAN = np.nan
ROW_1, ROW_2, ROW_3 = 0x181, 0x281, 0x381


@pytest.fixture
def assembler(tmp_path):
    return FrameAssembler(tiny_layout(tmp_path), (1,))


def send(assembler, *frames, at=0.5):
    """Feed (COB-ID, hex bytes) pairs; the last result."""
    results = [assembler.feed(can_id, bytes.fromhex(data), at) for can_id, data in frames]
    return results[-1]


def check(frame, values, sequence=0, missing=0):
    assert isinstance(frame, TaxelFrame)
    np.testing.assert_array_equal(frame.values, np.array(values, np.float32))
    assert (frame.sequence, frame.missing_can_frames) == (sequence, missing)
    assert not frame.values.flags.writeable and not frame.status.flags.writeable


def balanced(assembler):
    s = assembler.statistics()
    return s.received == s.used + s.pending + sum(s.losses.values())


def test_whole_period_is_given_with_its_last_tpdo(assembler):
    assert assembler.sync(7.25) is None
    assert send(assembler, (ROW_1, '0A0B'), at=7.3) is None
    assert send(assembler, (ROW_2, '0C0D'), at=7.3) is None
    frame = send(assembler, (ROW_3, '00FE'), at=7.3)
    check(frame, [[0, 2], [4, 6], [-20, 488]])
    assert frame.stamp == 7.25 and (frame.status == VALID).all()
    assert assembler.sync(8.25) is None  # nothing is given twice
    assert assembler.statistics()[:5] == (1, 0, 3, 3, 3) and balanced(assembler)


def test_full_scale_is_saturated_and_still_given(assembler):
    assembler.sync(0)
    frame = send(assembler, (ROW_1, '0A0A'), (ROW_2, '0AFF'), (ROW_3, '0A0A'))
    check(frame, [[0, 0], [0, 490], [0, 0]])
    assert frame.status.tolist() == [[VALID, VALID], [VALID, SATURATED], [VALID, VALID]]


@pytest.mark.parametrize(('lost', 'values'), [
    (ROW_1, [[NAN, NAN], [2, 2], [4, 4]]), (ROW_2, [[0, 0], [NAN, NAN], [4, 4]]),
    (ROW_3, [[0, 0], [2, 2], [NAN, NAN]])])
def test_missing_tpdo_gives_nan_at_the_next_sync(assembler, lost, values):
    period = [(ROW_1, '0A0A'), (ROW_2, '0B0B'), (ROW_3, '0C0C')]
    assembler.sync(0)
    send(assembler, *(f for f in period if f[0] != lost))
    frame = assembler.sync(1)
    check(frame, values, missing=1)
    assert (frame.status == np.where(np.isnan(values), STALE, VALID)).all()
    # the next period is whole again
    check(send(assembler, *period, at=1.5), [[0, 0], [2, 2], [4, 4]], sequence=1)
    assert assembler.statistics().missing == 1 and balanced(assembler)


def test_silent_period_is_all_stale(assembler):
    assembler.sync(0)
    check(assembler.sync(1), np.full((3, 2), NAN), missing=3)


def test_first_sweep_after_silence_is_given_up(assembler):
    """Rows 1, 2 may be of the silent period 0, row 3 of period 1 with its rows 1, 2 lost: nothing tells."""
    sweep = [(ROW_1, '0B0B'), (ROW_2, '0B0B'), (ROW_3, '0B0B')]
    assembler.sync(0)
    assembler.sync(1)
    assert send(assembler, *sweep, at=1.5) is None
    check(assembler.sync(2), np.full((3, 2), NAN), sequence=1, missing=3)
    assert assembler.statistics().losses['late'] == 3
    check(send(assembler, *sweep, at=2.5), np.full((3, 2), 2), sequence=2)
    assert balanced(assembler)


def test_lost_first_tpdo_for_good_leaves_the_others(assembler):
    assembler.sync(0)
    for period in range(1, 4):
        send(assembler, (ROW_2, '0B0B'), (ROW_3, '0B0B'), at=period - 0.5)
        check(assembler.sync(period), [[NAN, NAN], [2, 2], [2, 2]], sequence=period - 1, missing=1)


def test_late_tail_does_not_enter_the_next_period(assembler):
    assembler.sync(0)
    send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'))
    check(assembler.sync(1), [[0, 0], [0, 0], [NAN, NAN]], missing=1)
    assert send(assembler, (ROW_3, '0F0F'), at=1.1) is None  # of the period before, after its SYNC
    assert send(assembler, (ROW_1, '0B0B'), at=1.2) == Loss(LossReason.LATE, 1)
    frame = send(assembler, (ROW_2, '0B0B'), (ROW_3, '0B0B'), at=1.3)
    check(frame, [[2, 2], [2, 2], [2, 2]], sequence=1)
    assert assembler.statistics().losses['late'] == 1 and balanced(assembler)


def test_lone_possible_tail_is_not_published_as_fresh(assembler):
    assembler.sync(0)
    send(assembler, (ROW_1, '0A0A'))
    assembler.sync(1)
    send(assembler, (ROW_2, '0F0F'), (ROW_3, '0F0F'), at=1.1)  # the tail of 0, or 1 with its first TPDO lost
    check(assembler.sync(2), np.full((3, 2), NAN), sequence=1, missing=3)
    assert assembler.statistics().losses['late'] == 2 and balanced(assembler)


def test_every_period_crossing_the_sync_is_never_mixed(assembler):
    """A device so slow that row 3 always comes after the next SYNC: rows 1 and 2 only."""
    assembler.sync(0)
    for period in range(1, 5):
        count = f'{10 + period:02X}' * 2
        send(assembler, (ROW_1, count), (ROW_2, count), at=period - 0.5)
        value = 2.0 * period
        check(assembler.sync(period), [[value] * 2, [value] * 2, [NAN] * 2], sequence=period - 1, missing=1)
        send(assembler, (ROW_3, count), at=period + 0.1)
    assert balanced(assembler)


def test_tpdo_stamped_before_its_sync_is_late(assembler):
    """The driver lags: SYNC 1 is seen, then all of period 0, then all of period 1."""
    assembler.sync(10.0)
    check(assembler.sync(11.0), np.full((3, 2), NAN), missing=3)
    for can_id in (ROW_1, ROW_2, ROW_3):
        assert send(assembler, (can_id, '0F0F'), at=10.2) == Loss(LossReason.LATE)
    check(send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'), (ROW_3, '0A0A'), at=11.2), np.zeros((3, 2)),
          sequence=1)
    assert balanced(assembler)


def test_stamps_of_two_clocks_are_not_compared(tmp_path):
    assembler = FrameAssembler(tiny_layout(tmp_path), (1,), one_clock=False)
    assembler.sync(1e9)
    check(send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'), (ROW_3, '0A0A'), at=3.0), np.zeros((3, 2)))


def test_repeated_frame_is_a_duplicate(assembler):
    assembler.sync(0)
    assert send(assembler, (ROW_1, '0A0B'), (ROW_1, '0A0B')) == Loss(LossReason.DUPLICATE)
    check(send(assembler, (ROW_2, '0A0A'), (ROW_3, '0A0A')), [[0, 2], [0, 0], [0, 0]])
    assert assembler.statistics().losses['duplicate'] == 1 and balanced(assembler)


def test_same_cob_id_with_other_bytes_begins_a_new_run(assembler):
    """Two periods' row 2 without a SYNC seen between: what came before belongs to the earlier one."""
    assembler.sync(0)
    assert send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'), (ROW_2, '0B0B')) == Loss(LossReason.LATE, 2)
    send(assembler, (ROW_3, '0B0B'))
    check(assembler.sync(1), [[NAN, NAN], [2, 2], [2, 2]], missing=1)
    assert balanced(assembler)


def test_frames_after_a_complete_one_are_surplus(assembler):
    assembler.sync(0)
    send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'), (ROW_3, '0A0A'))
    assert send(assembler, (ROW_1, '0F0F')) == Loss(LossReason.SURPLUS)
    assert assembler.sync(1) is None
    send(assembler, (ROW_2, '0F0F'), (ROW_3, '0F0F'), at=1.1)  # the rest of the surplus sweep
    check(send(assembler, (ROW_1, '0B0B'), (ROW_2, '0B0B'), (ROW_3, '0B0B'), at=1.5), np.full((3, 2), 2),
          sequence=1)
    assert balanced(assembler)


@pytest.mark.parametrize(('data', 'reason'), [('', LossReason.SHORT), ('0A', LossReason.SHORT),
                                              ('0A0A00', LossReason.OVER_LONG)])
def test_wrong_length_makes_its_taxels_stale(assembler, data, reason):
    assembler.sync(0)
    assert send(assembler, (ROW_1, '0A0A'), (ROW_2, data)) == Loss(reason)
    frame = send(assembler, (ROW_3, '0A0A'))
    check(frame, [[0, 0], [NAN, NAN], [0, 0]], missing=1)
    assert frame.status[1].tolist() == [STALE, STALE]
    assert assembler.statistics().incomplete == 1 and balanced(assembler)


def test_before_the_first_sync_nothing_is_taken(assembler):
    assert send(assembler, (ROW_1, '0A0A')) == Loss(LossReason.BEFORE_FIRST_SYNC)
    assert assembler.statistics().losses['before_first_sync'] == 1 and balanced(assembler)


def test_restart_counts_the_unfinished_and_begins_at_zero(assembler):
    assembler.sync(0)
    assembler.sync(1)
    send(assembler, (ROW_1, '0A0A'), at=1.5)
    assembler.restart()
    assert assembler.statistics().losses['unfinished'] == 1 and balanced(assembler)
    assert assembler.sync(5) is None
    check(send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'), (ROW_3, '0A0A'), at=5.5), np.zeros((3, 2)))


def test_random_loss_and_delay_never_mixes_periods(assembler):
    """Each period sends its number in all taxels; frames are lost, and delayed across SYNCs in order."""
    rng = np.random.default_rng(5)
    backlog, given = [], []
    for period in range(3000):
        given.append((period - 1, assembler.sync(period)))
        backlog += [(can_id, bytes([period % 250 + 5] * 2))
                    for can_id in (ROW_1, ROW_2, ROW_3) if rng.random() > 0.1]
        keep = int(rng.integers(0, 3)) if rng.random() < 0.3 else 0  # the last ones come after the next SYNC
        now, backlog = backlog[:len(backlog) - keep], backlog[len(backlog) - keep:]
        given += [(period, assembler.feed(can_id, data, period + 0.5)) for can_id, data in now]
    frames = [(period, frame) for period, frame in given if isinstance(frame, TaxelFrame)]
    assert len({frame.sequence for _, frame in frames}) == len(frames) >= 2999 and balanced(assembler)
    assert assembler.statistics().complete > 1000 and assembler.statistics().losses['late'] > 100
    for period, frame in frames:
        valid = frame.values[~np.isnan(frame.values)]
        assert frame.sequence == period
        assert (valid == 2 * (period % 250 + 5 - 10)).all()


def test_reordered_tpdos_are_counted_apart_and_never_joined(assembler):
    assembler.sync(0)
    assert send(assembler, (ROW_1, '0A0A'), (ROW_3, '0A0A'), (ROW_2, '0B0B')) == Loss(LossReason.OUT_OF_ORDER, 2)
    check(assembler.sync(1), [[NAN, NAN], [2, 2], [NAN, NAN]], missing=2)
    losses = assembler.statistics().losses
    assert (losses['out_of_order'], losses['late']) == (2, 0) and balanced(assembler)


def test_incomplete_sweeps_can_be_dropped(tmp_path):
    assembler = FrameAssembler(tiny_layout(tmp_path), (1,), drop_incomplete=True)
    assembler.sync(0)
    send(assembler, (ROW_1, '0A0A'), (ROW_2, '0A0A'))
    assert assembler.sync(1) is None
    check(send(assembler, (ROW_1, '0B0B'), (ROW_2, '0B0B'), (ROW_3, '0B0B'), at=1.5), np.full((3, 2), 2), sequence=1)
    statistics = assembler.statistics()
    assert (statistics.complete, statistics.incomplete, statistics.dropped) == (1, 0, 1)
    assert statistics.losses['incomplete'] == 2 and statistics.expected == 6 and balanced(assembler)
