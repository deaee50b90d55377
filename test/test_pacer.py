"""When the next SYNC is due, by simulated clocks."""

import pytest

from tactile_node.threads.pacer import Schedule


def times(delays, period=1.0, lasts=0.0):
    """When calls begin that are held up by ``delays`` each, and the overruns."""
    schedule, begun = Schedule(period, 0.0), []
    now = 0.0
    for delay in delays:
        begun.append(max(schedule.due, now) + delay)
        schedule.begin(begun[-1])
        now = begun[-1] + lasts
    return begun, schedule.overruns


def test_small_delays_do_not_add_up():
    assert times([0.05] * 100) == ([pytest.approx(i + 0.05) for i in range(100)], 0)


def test_after_a_delay_no_pause_is_below_nine_tenths_of_a_period():
    begun, overruns = times([0, 0.7, *[0] * 8])
    assert begun == pytest.approx([0, 1.7, 2.6, 3.5, 4.4, 5.3, 6.2, 7.1, 8, 9]) and not overruns


def test_a_missed_period_is_left_out_and_counted():
    begun, overruns = times([0, 3.2, 0, 0, 0])
    assert begun == pytest.approx([0, 4.2, 5.1, 6, 7]) and overruns == 3


def test_calls_that_last_longer_than_a_period_are_overruns():
    begun, overruns = times([0] * 5, lasts=2.5)
    assert begun == pytest.approx([0, 2.5, 5, 7.5, 10]) and overruns == 10 - 4
