"""An action runs at a fixed pace, or after changes."""

import numpy as np
import pytest

from tactile_node.bus.change_pace import EARLY_ROUND, MOST_STATES, STATE_PERIOD, ChangePace
from tactile_node.bus.pacer import Schedule


def times(delays, period=1.0, lasts=0.0):
    """Return the start times of delayed calls, and the number of overruns."""
    schedule, begun = Schedule(period, 0.0), []
    now = 0.0
    for delay in delays:
        begun.append(max(schedule.due, now) + delay)
        schedule.begin(begun[-1])
        now = begun[-1] + lasts
    return begun, schedule.overruns


def test_small_delays_do_not_add_up():
    assert times([0.05] * 100) == ([pytest.approx(i + 0.05) for i in range(100)], 0)


def test_after_a_delay_no_pause_is_below_95_percent_of_a_period():
    begun, overruns = times([0, 0.2, *[0] * 6])
    assert begun == pytest.approx([0, 1.2, 2.15, 3.1, 4.05, 5, 6, 7]) and not overruns


def test_a_missed_period_is_left_out_and_counted():
    begun, overruns = times([0, 3.2, 0, 0, 0])
    assert begun == pytest.approx([0, 4.2, 5.15, 6.1, 7.05]) and overruns == 3


def test_calls_that_last_longer_than_a_period_are_overruns():
    begun, overruns = times([0] * 5, lasts=2.5)
    assert begun == pytest.approx([0, 2.5, 5, 7.5, 10]) and overruns == 10 - 4


ROUND = 0.05  # Time between two rounds [s].


def published(states, pause=ROUND):
    """Return (time, state) of each published state, given one state per round."""
    pace, found = ChangePace(), []
    for number, state in enumerate(states):
        now = 100 + number * pause
        if pace.is_due(state, now):
            found.append((now, state))
    return found


def test_a_change_is_published_at_once_and_the_same_again_once_a_second():
    found = published(['ok'] * 50 + ['error'] * 50)
    assert [state for _, state in found] == ['ok'] * 3 + ['error'] * 3
    assert found[3][0] == pytest.approx(100 + 50 * ROUND)
    assert max(np.diff([at for at, _ in found])) <= STATE_PERIOD + 1e-9


@pytest.mark.parametrize('pause', [0.001, 0.01, ROUND])
def test_a_flapping_fault_gives_at_most_twenty_a_second_and_its_last_state(pause):
    rounds = round(3 / pause)
    found = published(['ok', 'error'] * (rounds // 2) + ['gone'] * round(1.5 / pause), pause)
    times = np.array([at for at, _ in found])
    assert all(((times >= begin) & (times < begin + STATE_PERIOD - 1e-6)).sum() <= MOST_STATES for begin in times)
    assert found[-1][1] == 'gone'
    assert len(found) > 3 * MOST_STATES * 0.9


def test_a_round_that_comes_a_little_early_does_not_cost_another_round():
    pace = ChangePace()
    assert pace.is_due('ok', 0.0)
    assert pace.is_due('ok', STATE_PERIOD - EARLY_ROUND / 2)
