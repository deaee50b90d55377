"""The offset of another host's clock by two-way exchanges: within its bound, whatever ways, clocks and jumps."""

import math

import numpy as np
import pytest

from tactile_node.delay.clock_offset import ClockOffset, Exchange, OffsetEstimator, OffsetSettings
from tactile_node.errors import ConfigurationError, InputError

nan, inf = math.nan, math.inf


def exchange(true, out, back, clock, work=0.0):
    """Of a question that leaves at the ``true`` time [s]; the other host shows ``clock(true time)``."""
    received, answered = true + out, true + out + work
    return Exchange(true, clock(received), clock(answered), answered + back)


def asked(exchanges, drift=1e-3):
    estimator = OffsetEstimator(OffsetSettings(drift=drift))
    for each in exchanges:
        estimator.update(each)
    return estimator


def test_an_exchange_is_that_of_rfc_5905():
    """By hand: ((100.3 - 10) + (100.5 - 10.6)) / 2 = 90.1, and (0.6 - 0.2) / 2 = 0.2."""
    one = Exchange(sent=10.0, received=100.3, answered=100.5, arrived=10.6)
    assert one.offset == pytest.approx(90.1) and one.bound == pytest.approx(0.2)
    offset, bound, drift, age = asked([one], drift=1e-9).at(10.6)
    assert (offset, bound, age) == pytest.approx((90.1, 0.2, 0.6)) and math.isnan(drift)


def test_what_two_exchanges_have_in_common_counts():
    """5.0 +- 0.5 and, at the same time, 5.6 +- 0.3: the truth is in 5.3 to 5.5."""
    offset, bound, *_ = asked([Exchange(0.0, 5.5, 5.5, 1.0), Exchange(0.4, 6.3, 6.3, 1.0)], 1e-9).at(1.0)
    assert (offset, bound) == pytest.approx((5.4, 0.1))


def test_the_bound_grows_until_the_next_exchange_and_then_nothing_is_known():
    estimator = asked([Exchange(0.0, 7.0, 7.0, 0.0)])
    assert estimator.at(4.0) == pytest.approx((7.0, 0.004, nan, 4.0), nan_ok=True)
    assert estimator.at(11.0) == pytest.approx((nan, inf, nan, inf), nan_ok=True)
    assert OffsetEstimator().at(0.0) == pytest.approx((nan, inf, nan, inf), nan_ok=True)


@pytest.mark.parametrize('offset', [0.0, 0.2, -0.2, 1.7e9])
@pytest.mark.parametrize('rate', [0.0, 5e-4, -5e-4])
@pytest.mark.parametrize('seed', range(5))
def test_the_truth_is_within_the_bound_on_any_way(offset, rate, seed):
    """Ways of unequal delay, at times far longer, and half of the answers lost."""
    rng = np.random.default_rng(seed)
    estimator, bounds = OffsetEstimator(), []
    for true in np.arange(0.0, 300.0, 2.0):
        if rng.random() < 0.5:
            continue
        out, back = 3e-4 + rng.exponential(2e-3, 2) + (rng.random(2) < 0.1) * rng.uniform(0, 1, 2)
        estimator.update(exchange(true, out, back, lambda t: offset + t * (1 + rate), rng.uniform(0, 1e-3)))
        for now in (true + out + back + 1e-3, true + 1.9):
            found = estimator.at(now)
            assert abs(found.offset - offset - rate * now) <= found.bound + 1e-6
            bounds.append(found.bound)
    assert estimator.jumps == 0 and np.median(bounds) < 0.006
    assert found.drift == pytest.approx(rate, abs=2e-5)


def test_one_way_that_is_always_longer_stays_within_the_bound():
    """The least differences of one direction would be wrong by all of it."""
    found = asked(exchange(2.0 * i, 0.08, 0.0, lambda t: t + 0.2) for i in range(30)).at(58.08)
    assert found.offset == pytest.approx(0.24) and found.bound == pytest.approx(0.04, abs=1e-4)


@pytest.mark.parametrize('jump', [0.2, -0.2, 1.0, -1.0, 3600.0])
def test_a_clock_that_is_set_is_followed_at_the_next_exchange(jump):
    estimator = OffsetEstimator()
    for i in range(20):
        estimator.update(exchange(2.0 * i, 0.001, 0.001, lambda t: t + 5.0 + jump * (t >= 19)))
    found = estimator.at(38.002)
    assert estimator.jumps == 1 and abs(found.offset - 5.0 - jump) <= found.bound < 0.004
    assert not abs(found.drift) > 20e-6  # the jump is no drift


def test_a_set_clock_is_seen_at_the_first_exchange_after_it():
    estimator = asked(exchange(2.0 * i, 0.001, 0.001, lambda t: t) for i in range(5))
    estimator.update(exchange(10.0, 0.001, 0.001, lambda t: t - 0.2))
    assert estimator.at(10.002).offset == pytest.approx(-0.2)
    assert math.isnan(estimator.at(10.002).drift)


@pytest.mark.parametrize('way', [0.09, -0.09])
def test_a_fast_slew_that_hides_in_wide_bounds_is_over_after_eight_exchanges(way):
    """Before: -0.05 to 0.05; after a slew by 0.09: -0.01 to 0.09. What is in common does not hold the truth."""
    estimator, ways = OffsetEstimator(), (0.0, 0.1) if way > 0 else (0.1, 0.0)
    for i in range(30):
        true = 2.0 * i
        out, back = ways if true > 20 else (0.05, 0.05)
        estimator.update(exchange(true, out, back, lambda t: t + min(max(t - 20.2, 0.0), 1.0) * way))
        found = estimator.at(true + 0.1)
        if not 21 <= true < 22 + 2 * 7:
            assert abs(found.offset - (way if true > 21 else 0.0)) <= found.bound + 1e-9


def test_a_drift_that_is_not_well_known_is_not_given():
    assert math.isnan(asked(exchange(2.0 * i, 0.005, 0.005, lambda t: 1.0001 * t) for i in range(10)).at(18.1).drift)


def test_against_another_clock_of_our_host():
    assert ClockOffset(5.0, 0.1, 1e-5, 2.0).against(4.75) == (0.25, 0.1, 1e-5, 2.0)


@pytest.mark.parametrize('wrong', [(0.0, nan, 1.0, 1.0), (0.0, 5.0, 4.0, 1.0), (0.0, 5.0, 6.5, 1.0),
                                   (0.0, 5.0, inf, 1.0)])
def test_times_that_cannot_be_are_refused_and_change_nothing(wrong):
    estimator = asked([Exchange(0.0, 7.0, 7.0, 0.0)])
    with pytest.raises(InputError):
        estimator.update(Exchange(*wrong))
    assert estimator.at(1.0).offset == 7.0


def test_wrong_settings_are_refused():
    for wrong in ({'drift': 0.0}, {'window': nan}, {'longest_gap': inf}, {'drift_error': -1.0}):
        with pytest.raises(ConfigurationError):
            OffsetSettings(**wrong)
