"""Tests for estimating how long messages were held back.

The cases cover clocks that differ, drift and jump, bursts of messages, and a busy machine. Each case has a sender's
timeline and its true delays. A reader of the latest message must never see an old message as both settled and current.
Messages must be usable again after the stated time.
"""

from typing import NamedTuple

import numpy as np
import pytest

from tactile_node.ros.message_age import SETTLED_ERROR, SETTLING_TIME, WINDOW, DelayEstimator

LIMIT = 0.1  # Largest age of a message that a reader accepts as current [s].
OFFSETS = (-1.7e9, -5.0, 0.0, 1e-3, 3600.0, 1.7e9)


class Result(NamedTuple):
    """Delays and estimates of all messages, in the order of arrival."""

    arrival: np.ndarray
    true: np.ndarray  # True transmission delay [s].
    held: np.ndarray

    @property
    def settled(self) -> np.ndarray:
        return np.isfinite(self.held)

    @property
    def fresh(self) -> np.ndarray:
        return self.held <= LIMIT

    @property
    def misled(self) -> np.ndarray:
        """True for each message that a reader accepts as current although it is too old.

        A message is too old if its age exceeds the limit plus the error of a settled estimate.
        """
        return self.fresh & (self.true > LIMIT + SETTLED_ERROR)


def jitter(rng, count, typical=0.001, late=0.02, share=0.02):
    """Return exponentially distributed delays, some of them 10-50 ms longer, as on a busy machine."""
    return 0.0005 + rng.exponential(typical, count) + (rng.random(count) < share) * rng.uniform(0.5, 2.5, count) * late


def run(sent, delay, clock=lambda t: t, estimator=None, keep=None):
    """Return the results for messages that are sent at the true times ``sent`` and arrive ``delay`` later."""
    estimator = estimator or DelayEstimator()
    chosen = np.ones(len(sent), bool) if keep is None else keep
    sent, delay = sent[chosen], np.broadcast_to(delay, len(chosen))[chosen]
    order = np.argsort(sent + delay, kind='stable')
    sent, arrival = sent[order], (sent + delay)[order]
    results = [estimator.update(*pair) for pair in zip(arrival, map(clock, sent))]
    return Result(arrival, arrival - sent, np.array(results))


def queued(sent, delay):
    """Return the delays after queueing, so that no message overtakes another, as in one DDS topic."""
    return np.maximum.accumulate(sent + delay) - sent


def times(period=0.02, duration=10.0, begin=0.0):
    return begin + period * np.arange(round(duration / period))


def held_until(sent, release, begin, count):
    """Return extra delays that hold back ``count`` messages sent from ``begin`` on.

    The held messages arrive from ``release`` on, at intervals of 0.1 ms.
    """
    extra = np.zeros(len(sent))
    first = np.searchsorted(sent, begin)
    extra[first:first + count] = release + 1e-4 * np.arange(count) - sent[first:first + count]
    return extra


@pytest.mark.parametrize('offset', OFFSETS)
@pytest.mark.parametrize('period', [0.001, 0.01, 0.02, 0.05])
def test_delays_are_found_at_any_offset_of_the_clocks(offset, period):
    rng = np.random.default_rng(1)
    sent = times(period)
    result = run(sent, queued(sent, jitter(rng, len(sent))), lambda t: t + offset)
    late = result.arrival > 1.0
    assert result.settled[late].all()
    assert result.held[late] == pytest.approx(result.true[late] - 0.0005, abs=2e-3)
    assert result.fresh[late].all()


@pytest.mark.parametrize('rate', [1e-4, -1e-4])
def test_drift_neither_withdraws_freshness_nor_builds_up(rate):
    rng = np.random.default_rng(2)
    sent = times(duration=400.0)
    result = run(sent, queued(sent, jitter(rng, len(sent))), lambda t: t * (1 + rate) + 7.0)
    late = result.arrival > 1.0
    assert result.fresh[late].all()
    assert np.abs(result.held - result.true)[late].max() < 0.006


@pytest.mark.parametrize('missing', [0, 2, 7])
def test_start_in_the_middle_of_a_burst_is_not_settled(missing):
    """The first received message has already been held back, and only the later drop in the delay reveals this."""
    sent = np.concatenate([times(duration=0.2), times(duration=5.0, begin=5.0 + 0.1 * missing)])
    result = run(sent, 0.001 + held_until(sent, 5.0, 0.0, 10))
    assert not result.misled.any()
    assert not result.settled[:10 + 5].any()
    assert result.fresh[result.arrival > 6.5].all()


@pytest.mark.parametrize('jump', [0.06, 1.0, 3600.0])
def test_the_senders_clock_set_forward_costs_the_settling_time(jump):
    sent = times(duration=20.0)
    result = run(sent, 0.001, lambda t: t + jump * (t >= 10))
    after = result.arrival - 10.0
    assert not result.settled[(after > 0) & (after < SETTLING_TIME - 0.05)].any()
    assert result.fresh[(after > SETTLING_TIME + 0.05) | ((after < 0) & (result.arrival > 1))].all()


@pytest.mark.parametrize('jump', [0.05, 1.0, 3600.0])
def test_the_senders_clock_set_back_or_its_restart_costs_the_settling_time(jump):
    sent = times(duration=20.0)
    result = run(sent, 0.001, lambda t: t - jump * (t >= 10))
    after = result.arrival - 10.0
    assert not result.settled[(after > 0) & (after < SETTLING_TIME - 0.05)].any()
    assert result.fresh[after > SETTLING_TIME + 0.05].all()


@pytest.mark.parametrize('step', [0.2, -0.2])
def test_a_clock_slewed_as_fast_as_chrony_does_makes_nothing_old_look_current(step):
    """chrony slews a clock by at most 83,333 ppm (maxslewrate).

    After a clock has been slewed backwards, the ages read too high until the estimator forgets the smallest difference.
    """
    sent = times(duration=60.0)
    delay = 0.001 + held_until(sent, 17.0, 12.0, 10)
    result = run(sent, delay, lambda t: t + np.clip((t - 11.0) / 12 * np.sign(step), *sorted((0.0, step))))
    assert (result.true > 1.0).sum() == 10 and not result.misled.any()
    assert result.fresh[result.arrival > 11.0 + abs(step) * 12 + WINDOW + 1.0].all()


@pytest.mark.parametrize('seed', range(20))
def test_a_busy_machine_does_not_withdraw_freshness_for_long(seed):
    """Delays of 10-50 ms occur occasionally, starting with the first message.

    Messages may count as not fresh for less than 1 % of the time. The messages that are not fresh must span less than
    0.6 s or be fewer than 30.
    """
    rng = np.random.default_rng(seed)
    sent = times(duration=60.0)
    delay = queued(sent, jitter(rng, len(sent), typical=0.002, share=0.05))
    late = (result := run(sent, delay)).arrival > 1.5
    lacking = late & ~result.fresh
    assert lacking.mean() < 0.01
    assert not lacking.any() or np.ptp(result.arrival[lacking]) < 0.6 or lacking.sum() < 30


@pytest.mark.parametrize('seed', range(30))
def test_random_holds_never_mislead(seed):
    """Messages are held for random times but stay in order, with jitter, drift, losses and any clock offset."""
    rng = np.random.default_rng(100 + seed)
    sent = times(duration=120.0)
    delay = jitter(rng, len(sent))
    for begin in rng.uniform(0, 115, 12):
        hold = rng.uniform(0.1, 8.0)
        within = (sent >= begin) & (sent < begin + hold)
        delay[within] = np.maximum(delay[within], begin + hold - sent[within])
    offset, drift = rng.uniform(-1e6, 1e6), rng.uniform(-1e-4, 1e-4)
    result = run(sent, queued(sent, delay), lambda t: offset + t * (1 + drift),
                 keep=rng.random(len(sent)) < 0.9)
    assert not result.misled.any()
    assert (result.fresh | (result.true > LIMIT / 2))[result.arrival > 15].mean() > 0.9


def test_a_burst_that_live_messages_overtake_is_not_fresh():
    sent = times(duration=12.0)
    result = run(sent, 0.001 + held_until(sent, 8.0, 3.0, 10))
    assert not result.misled.any()
    assert result.fresh[result.arrival > 8.7].all()


def test_a_backlog_that_arrives_slowly_is_not_settled():
    """After a hold of 3 s, a relay sends its backlog at 4/3 of the normal rate.

    The first message that the reader receives belongs to the backlog.
    """
    sent = times(duration=30.0)
    delay = np.maximum(0.001, 3.0 - 0.25 * sent)
    result = run(sent, delay)
    assert not result.misled.any()
    assert result.fresh[result.arrival > 13.0].all()


def test_a_clock_set_back_during_a_silence_costs_at_most_the_window():
    sent = np.concatenate([times(duration=5.0), times(duration=60.0, begin=9.0)])
    result = run(sent, 0.001, lambda t: t - 2.0 * (t >= 9))
    after = result.arrival - 9.0
    # At first, a clock that was set back looks like a slower path.
    assert not result.fresh[(after > 0) & (after < WINDOW / 2)].any()
    assert result.fresh[after > WINDOW].all()


def test_one_stamp_from_the_future_does_not_last():
    sent = times(duration=10.0)
    result = run(sent, 0.001, lambda t: t + 50.0 * (abs(t - 5.0) < 0.001))
    assert not result.settled[(result.arrival > 5.0) & (result.arrival < 5.4)].any()
    assert result.fresh[result.arrival > 5.6].all()
