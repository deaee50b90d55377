"""A stamp that runs ahead is refused; a clock that is set, a burst and a replay at another pace are followed."""

import pytest

from tactile_node.delay.stamp_guard import CONFIRMED, StampGuard

PERIOD, EPOCH = 0.02, 1.7e9


def refused(stamps, arrivals=None):
    """Indices of the stamps that are refused; arrivals a PERIOD apart."""
    guard = StampGuard()
    arrivals = arrivals or [50 + PERIOD * n for n in range(len(stamps))]
    return [n for n, (arrival, stamp) in enumerate(zip(arrivals, stamps)) if not guard.accepts(arrival, EPOCH + stamp)]


def even(count, begin=0.0, period=PERIOD):
    return [begin + period * n for n in range(count)]


@pytest.mark.parametrize('ahead', [1.5, 3600.0, 4e8])
def test_false_stamps_among_true_ones_are_refused(ahead):
    stamps = even(100)
    for n in (10, 20, 21, 40):
        stamps[n] += ahead
    assert refused(stamps) == [10, 20, 21, 40]


def test_a_false_first_message_does_not_let_others_through_for_long():
    stamps = even(5000)
    stamps[0] += 3600
    stamps[4900] += 1800
    assert refused(stamps) == [4900]


@pytest.mark.parametrize('step', [5.0, 3600.0])
def test_a_clock_set_forward_is_followed_once_confirmed(step):
    assert refused(even(50) + even(50, 50 * PERIOD + step)) == list(range(50, 49 + CONFIRMED))


@pytest.mark.parametrize('step', [-0.5, -3600.0])
def test_a_clock_set_back_is_followed(step):
    assert refused(even(50) + even(50, 50 * PERIOD + step)) == []


def test_messages_held_back_and_those_after_them_are_accepted():
    """How late they are is another matter."""
    arrivals = even(50, 50) + [56.0 + 1e-4 * n for n in range(250)] + even(50, 56.02)
    assert refused(even(350), arrivals) == []


@pytest.mark.parametrize('pace', [0.1, 5.0, 100.0])
def test_a_replay_at_another_pace_is_accepted(pace):
    assert refused(even(500), even(500, 50, PERIOD / pace)) == []


def test_an_outage_of_the_sender_is_accepted():
    assert refused(even(50) + even(50, 600), even(50, 50) + even(50, 650)) == []
