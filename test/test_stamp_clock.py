"""Time stamps stay correct while the clocks are set. The test itself moves the clocks."""

import numpy as np
import pytest

from tactile_node.bus.stamp_clock import StampClock


class Hands:
    """A simulated wall clock and a simulated steady clock.

    The adapter's clock counts from the time when the adapter was plugged in.
    """

    def __init__(self):
        self.wall, self.steady = 1000.0, 5.0

    def wait(self, seconds):
        self.wall += seconds
        self.steady += seconds

    def clock(self, host_stamped=True):
        return StampClock(host_stamped, lambda: self.wall, lambda: self.steady)


@pytest.fixture
def hands():
    return Hands()


def test_untouched_clocks_leave_stamps_as_they_are(hands):
    clock = hands.clock()
    hands.wait(3)
    assert clock.now() == 1003 and clock.of(1002.75) == 1002.75 and clock.jumps == 0


def test_a_thread_delayed_between_the_two_clock_readings_sees_no_jump(hands):
    clock = hands.clock()
    read, delays = clock._wall, [0.3, 0.0, 0.5]

    def wall():
        shown = read()
        hands.wait(delays.pop() if delays else 0.0)
        return shown
    clock._wall = wall
    hands.wait(1)
    assert clock.now() == pytest.approx(1001.5) and clock.now() == pytest.approx(1001.8) and clock.jumps == 0


def test_stamps_continue_evenly_after_the_clock_is_set_back(hands):
    clock = hands.clock()
    hands.wait(1)
    assert clock.now() == 1001
    hands.wall -= 3600
    hands.wait(1)  # The wall clock now reads -2598 s.
    assert clock.now() == pytest.approx(1002) and clock.jumps == 1 and clock.ahead == pytest.approx(3600)
    hands.wait(0.5)
    # By the new wall clock, the stamp lies 0.1 s in the past.
    assert clock.of(hands.wall - 0.1) == pytest.approx(1002.4)
    hands.wait(5)
    assert clock.of(hands.wall - 0.1) == pytest.approx(1007.4)
    hands.wall += 3600  # The wall clock is set to the correct time.
    assert clock.now() == pytest.approx(1007.5) and (clock.jumps, clock.ahead) == (2, 0)


@pytest.mark.parametrize('step', [-0.09, -0.03])
def test_syncs_after_a_small_step_back_have_stamps_of_their_own(hands, step):
    clock = hands.clock()
    stamps = []
    for number in range(10):
        hands.wait(0.02)
        hands.wall += step if number == 5 else 0.0
        stamps.append(clock.now())
        assert clock.acquired(stamps[-1]) == pytest.approx(hands.steady)
    assert np.diff(stamps) == pytest.approx(0.02) and clock.jumps == 1


def test_a_step_back_while_the_bus_was_closed_is_a_jump(hands):
    clock = hands.clock()
    before = clock.now()
    hands.wait(60)
    hands.wall -= 3
    assert clock.now() == pytest.approx(before + 60) and clock.jumps == 1


@pytest.mark.parametrize('rate', [-0.08, 0.08])
@pytest.mark.parametrize('pause', [0.02, 1.0])
def test_a_slewed_clock_has_not_jumped(hands, rate, pause):
    clock = hands.clock()
    for _ in range(20):
        hands.wait(pause)
        hands.wall += rate * pause
        assert clock.now() == pytest.approx(hands.wall)
    assert clock.jumps == 0


def test_message_stamped_before_the_jump_and_read_after(hands):
    clock = hands.clock()
    hands.wait(1)
    for step in (-50.0, 80.0):
        stamped = hands.wall
        hands.wait(0.2)
        clock.now()
        hands.wall += step
        age = clock.now() - clock.of(stamped)
        assert age == pytest.approx(0.2), step
        hands.wait(10)


def test_stamps_follow_a_clock_that_is_set_forward(hands):
    clock = hands.clock()
    hands.wall += 500
    assert clock.now() == 1500 and clock.jumps == 1 and clock.ahead == 0


def test_restart_takes_the_new_time(hands):
    clock = hands.clock()
    hands.wall -= 100
    assert clock.now() == pytest.approx(1000)
    clock.restart()
    assert clock.now() == 900 and clock.ahead == 0


def test_adapter_of_another_epoch_is_mapped_by_its_quickest_message(hands):
    """The adapter's clock read 0 when the wall clock read 1000.

    The three messages take 5, 2 and 9 ms through the adapter.
    """
    clock, stamps = hands.clock(host_stamped=False), []
    for second, delay in ((1, 0.005), (2, 0.002), (3, 0.009)):
        hands.wall, hands.steady = 1000 + second + delay, 5 + second + delay
        stamps.append(clock.of(float(second)))
    assert stamps == pytest.approx([1001.005, 1002.002, 1003.002], abs=2e-4)


def test_adapter_that_counts_again_is_mapped_again(hands):
    clock = hands.clock(host_stamped=False)
    clock.of(700.0)
    hands.wait(1)
    assert clock.of(0.25) == pytest.approx(1001)
    hands.wait(0.5)
    assert clock.of(0.75) == pytest.approx(1001.5, abs=1e-3)


@pytest.mark.parametrize('step', [0.025, 0.05, 0.09, 0.5])
def test_a_message_stamped_after_a_step_forward_and_read_late_has_its_true_age(hands, step):
    clock = hands.clock()
    hands.wait(1)
    clock.now()
    hands.wall += step
    clock.now()
    hands.wait(0.5)
    stamped, acquired = hands.wall, hands.steady
    hands.wait(1.2 * step)
    assert clock.acquired(clock.of(stamped)) == pytest.approx(acquired)


@pytest.mark.parametrize('step', [0.0, 0.05, -0.05, 3600.0, -3600.0, 1.0])
@pytest.mark.parametrize('before', [0.0, -60.0, 60.0])
def test_ages_are_of_the_steady_clock_however_the_wall_clock_is_set(hands, before, step):
    """If ages followed the wall clock, a consumer would mistake old taxels for current ones, or the reverse."""
    clock = hands.clock()
    clock.now()
    hands.wall += before
    clock.now()
    hands.wait(10)
    sent = clock.now()
    hands.wait(0.03)
    hands.wall += step
    hands.wait(0.01)
    received, again = clock.of(hands.wall - 0.005), clock.now()
    hands.wait(0.02)
    ages = [hands.steady - clock.acquired(stamp) for stamp in (sent, received, again)]
    assert ages == pytest.approx([0.06, 0.025, 0.02])
