"""A state is published on each change, at most twenty times a second, once a second, and the last one always."""

import numpy as np
import pytest

from tactile_node.threads.change_pace import EARLY, MOST, PERIOD, ChangePace

ROUND = 0.05  # s


def published(states, pause=ROUND):
    """(time, state) of what is let through of one state a round."""
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
    assert max(np.diff([at for at, _ in found])) <= PERIOD + 1e-9


@pytest.mark.parametrize('pause', [0.001, 0.01, ROUND])
def test_a_flapping_fault_gives_at_most_twenty_a_second_and_its_last_state(pause):
    rounds = round(3 / pause)
    found = published(['ok', 'error'] * (rounds // 2) + ['gone'] * round(1.5 / pause), pause)
    times = np.array([at for at, _ in found])
    assert all(((times >= begin) & (times < begin + PERIOD - 1e-6)).sum() <= MOST for begin in times)
    assert found[-1][1] == 'gone'
    assert len(found) > 3 * MOST * 0.9


def test_a_round_that_comes_a_little_early_does_not_cost_another_round():
    pace = ChangePace()
    assert pace.is_due('ok', 0.0)
    assert pace.is_due('ok', PERIOD - EARLY / 2)
