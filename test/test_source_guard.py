"""The guards of a stream decide which publisher and which stamps are accepted."""

import random
from itertools import chain

import pytest

from tactile_node.ros.source_guard import CONFIRMING_STAMPS, SOURCE_HOLD, SourceGuard, StampGuard

PERIOD, EPOCH = 0.02, 1.7e9


def sent(count, *, first=0, begin=0.0, period=PERIOD, clock=0.0, name='ours'):
    """Return the messages of one source as tuples (arrival, sequence, stamp, name of the source)."""
    return [(begin + n * period, first + n, EPOCH + clock + begin + n * period, name) for n in range(count)]


def accepted(*sources):
    """Return the accepted messages in the order of their arrival."""
    guard = SourceGuard()
    messages = sorted(chain(*sources))
    return [message for message in messages if guard.accepts(*message[:3])]


@pytest.mark.parametrize('first', [0, 3, 90, 2_000, 4_000_000])
@pytest.mark.parametrize('clock', [-3600.0, -0.2, 0.0, 0.2])
def test_neither_of_two_drivers_is_used(first, clock):
    """The result does not depend on the sequence numbers or the clock of the other driver.

    The guard uses none of the other driver's messages, and soon none of ours.
    """
    both = accepted(sent(500, first=1000), sent(400, first=first, begin=1.005, clock=clock, name='theirs'))
    assert not [message for message in both if message[3] == 'theirs']
    assert max(message[0] for message in both if message[0] < 9.0) < 1.005 + 4 * PERIOD


def test_our_source_is_used_again_when_the_other_source_has_ended():
    used = accepted(sent(500, first=1000), sent(50, first=5, begin=1.005, name='theirs'))
    again = min(message[0] for message in used if message[0] > 1.5)
    assert 1.985 < again <= 1.985 + SOURCE_HOLD + PERIOD
    assert [message for message in used if message[0] >= again] == sent(500, first=1000)[round(again / PERIOD):]


def test_a_driver_that_starts_again_is_used_once_the_one_before_is_gone():
    later = sent(100, begin=10.3)
    used = accepted(sent(501), later)
    assert used == sent(501) + [message for message in later if message[0] > 10.0 + SOURCE_HOLD]


@pytest.mark.parametrize('pause', [0.25, 0.9])
def test_a_driver_delayed_while_another_starts_does_not_count_as_restarted(pause):
    ours = [(arrival if number <= 50 else max(arrival, 1.0 + pause), number, stamp, name)
            for arrival, number, stamp, name in sent(500)]
    both = accepted(ours, sent(100, first=5, begin=1.005, name='theirs'))
    assert not [message for message in both if message[3] == 'theirs']


@pytest.mark.parametrize('silence', [0.3, 0.9])
def test_the_other_source_is_not_used_while_ours_is_silent_for_a_moment(silence):
    ours = [message for message in sent(500, first=1000) if not 4 < message[0] < 4 + silence]
    both = accepted(ours, sent(400, first=5, begin=1.005, name='theirs'))
    assert not [message for message in both if message[3] == 'theirs' and message[0] < 9]


@pytest.mark.parametrize('lost', [1, 9, 30, 45, 3000])
def test_consecutive_lost_frames_do_not_count_as_another_source(lost):
    source = sent(4000)
    kept = source[:200] + source[200 + lost:]
    assert accepted(kept) == kept


def test_a_set_clock_does_not_count_as_another_source():
    source = [(arrival, number, stamp + (5.0 if number > 100 else 0) - (3600 if number > 200 else 0), name)
              for arrival, number, stamp, name in sent(300)]
    assert accepted(source) == source


def test_frames_left_out_on_purpose_do_not_count_as_another_source():
    guard = SourceGuard()
    assert all(guard.accepts(0.4 * n, 20 * n, EPOCH, left_out=19 * (n > 0)) for n in range(20))


def test_two_nodes_that_work_on_the_same_frames_are_one_source():
    """Both nodes publish the shape of each frame, one node a little later than the other."""
    twins = accepted(sent(100), [(arrival + 0.005, *rest) for arrival, *rest in sent(100, name='twin')])
    assert len(twins) == 200


def refused(stamps, arrivals=None):
    """Return the indices of the refused stamps, where messages arrive one PERIOD apart by default."""
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


@pytest.mark.parametrize('step', [5.0, 3600.0])
def test_a_clock_set_forward_is_followed_once_confirmed(step):
    assert refused(even(50) + even(50, 50 * PERIOD + step)) == list(range(50, 49 + CONFIRMING_STAMPS))


def test_messages_held_back_and_those_after_them_are_accepted():
    """This guard does not judge the delay of messages."""
    arrivals = even(50, 50) + [56.0 + 1e-4 * n for n in range(250)] + even(50, 56.02)
    assert refused(even(350), arrivals) == []


@pytest.mark.parametrize('pace', [0.1, 5.0, 100.0])
def test_a_replay_at_another_pace_is_accepted(pace):
    assert refused(even(500), even(500, 50, PERIOD / pace)) == []


def test_numbers_that_run_abreast_are_found_out():
    """Two hosts that were switched on together may send equal sequence numbers at equal times.

    The guard may accept at most two messages of the other host.
    """
    both = accepted(sent(500), sent(400, first=52, begin=1.005, name='theirs'))
    assert sum(message[3] == 'theirs' for message in both) <= 2
    assert max(message[0] for message in both if message[0] < 9.0) < 1.005 + 4 * PERIOD


def test_a_single_false_message_is_not_used_and_does_no_more():
    false = sent(1, first=700_000, begin=2.005, name='false')
    assert accepted(sent(300), false) == sent(300)


@pytest.mark.parametrize('part', [0.05, 0.5])
def test_scattered_lost_frames_do_not_count_as_another_source(part):
    chance = random.Random(4)
    kept = [message for message in sent(2000) if chance.random() > part]
    assert accepted(kept) == kept
