"""Tests that the zero follows slow drift but never a grasp.

The simulated drift does not use the code under test. `make misled` simulates ten minutes at 50 Hz. `make test`
simulates the first 90 seconds, in which the drift is fastest, at 10 Hz.
"""

import os

import numpy as np
import pytest

from tactile_node.conditioning.drift import DriftFollower
from tactile_node.conditioning.tare import ContactGuard
from tactile_node.conditioning.tared_pad import TaredPad
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus

LIMIT = 10e3   # Pa
RATE = 50      # Hz
#: Rate in the long parts of the tests, because the follower measures time and does not count frames [Hz].
LOW_RATE = 50 if os.environ.get('TACTILE_LONG') else 10
#: Number of frames of which the tests take the mean.
MEAN_FRAMES = 50
SIDE = 16      # taxels
NOISE = 300.0  # Pa
GRASP = 40e3
DURATION = 600 if os.environ.get('TACTILE_LONG') else 90  # s
GUARD = ContactGuard.of_unit('Pa')
GRIP = np.zeros((SIDE, SIDE))
GRIP[5:11, 5:11] = GRASP


def given(pad: TaredPad, seconds: float, load, drift, begin: float = 0.0, rate: int = LOW_RATE) -> np.ndarray:
    """Feed ``load`` [Pa] with ``drift(t)`` [Pa] and noise added, and return the mean output of the last frames."""
    rng, last = np.random.default_rng(1), []
    for t in begin + np.arange(int(seconds * rate)) / rate:
        values = (load + drift(t) + NOISE * rng.standard_normal((SIDE, SIDE))).astype(np.float32)
        found = pad.feed(TaxelFrame(t, 0, values, np.ones((SIDE, SIDE), np.uint8), missing_can_frames=0)).values
        last = [*last[-MEAN_FRAMES + 1:], found]
    return np.mean(last, axis=0)


def drifting(t: float) -> float:
    """Return a drift [Pa] that rises to 4 kPa within ten minutes, like the first quarter of a sine wave."""
    return 4e3 * np.sin(t / 600 * np.pi / 2)


@pytest.mark.slow
def test_slow_drift_is_followed():
    """The drift rises by at most 10.5 Pa/s, so a zero that lags behind by TIME_CONSTANT is off by 210 Pa."""
    left = given(TaredPad(GUARD, DriftFollower(LIMIT)), DURATION, 0.0, drifting)
    assert np.abs(left).max() < 210 + 5 * NOISE / MEAN_FRAMES ** 0.5


@pytest.mark.slow
@pytest.mark.parametrize('before', [0.0, 30.0])
def test_a_grasp_of_minutes_keeps_its_pressure_and_leaves_no_jump(before):
    """The grasp exists from the first frame, or begins after 30 s.

    The simulated skin does not drift here, so any loss of pressure is an error in the code.
    """
    pad = TaredPad(GUARD, DriftFollower(LIMIT))
    if before:
        given(pad, before, 0.0, lambda t: 0.0)
    held = given(pad, DURATION, GRIP, lambda t: 0.0, begin=before)
    assert held[5:11, 5:11].mean() == pytest.approx(GRASP, rel=0.01)
    assert np.abs(held[5:11, 5:11] / GRASP - 1).max() < 0.01
    released = given(pad, 1, 0.0, lambda t: 0.0, begin=before + DURATION, rate=RATE)
    assert np.abs(released).max() < 0.03 * LIMIT


def test_invalid_taxels_keep_their_zero_and_a_gap_restarts_the_quiet_time():
    follower, zero = DriftFollower(LIMIT), np.zeros((1, 2))
    for t in np.arange(0, 10, 0.02):
        zero = follower.update(t, np.array([[1e3, np.nan]]), zero)
    assert zero[0, 0] > 100 and zero[0, 1] == 0
    assert follower.update(100.0, np.array([[1e3, 0]]), zero) is zero


def test_the_zero_stands_still_while_a_part_of_the_pad_is_lost():
    """An object may press exactly on the taxels that send no values."""
    follower, zero = DriftFollower(LIMIT), np.zeros((1, 2))
    for t in np.arange(0, 10, 0.02):
        zero = follower.update(t, np.array([[1e3, 1e3]]), zero)
    assert (zero > 100).all()
    for t in np.arange(10, 60, 0.02):
        assert follower.update(t, np.array([[1e3, np.nan]]), zero) is zero
    for t in np.arange(60, 70, 0.02):
        zero, before = follower.update(t, np.array([[1e3, 1e3]]), zero), zero
    assert (zero > before).all()


def test_a_grasp_that_a_low_offset_hides_from_the_start_is_not_followed():
    """Before a tare, only the lower readings around the grasp reveal that its 2 kPa are a load."""
    pad, last = TaredPad(GUARD, DriftFollower(LIMIT)), None
    load = np.where(GRIP > 0, 2e3, -33e3).astype(np.float32)
    for t in np.arange(0, 120, 0.1):
        last = pad.feed(TaxelFrame(t, 0, load, np.ones((SIDE, SIDE), np.uint8), missing_can_frames=0)).values
    np.testing.assert_array_equal(last, load)


def test_a_taxel_taken_out_as_faulty_does_not_keep_the_others_from_being_followed():
    pad, last = TaredPad(GUARD, DriftFollower(LIMIT)), None
    for t in np.arange(0, 120, 0.1):
        values, status = np.full((1, 2), min(t, 60) * 20.0, np.float32), np.ones((1, 2), np.uint8)
        if t > 10:
            values[0, 1], status[0, 1] = np.nan, TaxelStatus.FAULTY
        last = pad.feed(TaxelFrame(t, 0, values, status, missing_can_frames=0)).values
    assert abs(last[0, 0]) < 100 and np.isnan(last[0, 1])


@pytest.mark.slow
def test_a_light_lasting_touch_slowly_counts_as_drift():
    """A touch of 3 kPa is below half the limit, so the zero may absorb at most limit / 300 of the touch per second."""
    pad = TaredPad(GUARD, DriftFollower(LIMIT))
    given(pad, 10, 0.0, lambda t: 0.0)
    touch = given(pad, 30, np.full((SIDE, SIDE), 3e3), lambda t: 0.0, begin=10)
    assert touch.mean() > 3e3 - 30 * LIMIT / 300 - 100
