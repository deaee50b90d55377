"""A tare is measured from whole frames, refused under load, and subtracted from every later frame."""

import threading

import numpy as np
import pytest

from tactile_node.conditioning.tare import ContactGuard, measure
from tactile_node.conditioning.tared_pad import TaredPad, ZeroState
from tactile_node.errors import DeviceError, HalfZeroedError, TareRefusal, TareRefusedError
from tactile_node.taxel_frame import TaxelFrame

LIMIT = 10.0
GUARD = ContactGuard.of_unit('Pa')


def frames(offset: np.ndarray, noise: float, count: int = 200, seed: int = 1) -> np.ndarray:
    return offset + noise * np.random.default_rng(seed).standard_normal((count, *offset.shape))


def frame(values, missing=0):
    values = np.asarray(values, np.float32)
    return TaxelFrame(0.0, 0, values, np.ones(values.shape, np.uint8), missing_can_frames=missing)


def test_offsets_and_noise_are_found():
    """The mean of K samples has the standard error noise / sqrt(K).

    Over 48 taxels, the noise is estimated to within a few per cent.
    """
    offset = np.linspace(-3, 3, 48).reshape(6, 8)
    found = measure(frames(offset, 0.5), LIMIT, GUARD)
    np.testing.assert_allclose(found.offset, offset, atol=5 * 0.5 / 200 ** 0.5)
    assert found.noise == pytest.approx(0.5, rel=0.03) and found.frames == 200 and found.unit == 'Pa'
    assert abs(found.largest) == pytest.approx(3, abs=0.2)


@pytest.mark.parametrize('press', ['held', 'growing', 'tapping'])
def test_refused_while_something_presses(press):
    values = frames(np.zeros((6, 8)), 0.1, 50)
    values[:, 2, 3] += {'held': np.full(50, 11.0), 'growing': np.linspace(0, 11, 50),
                        'tapping': np.arange(50) % 25 == 0}[press] * (12 if press == 'tapping' else 1)
    with pytest.raises(TareRefusedError, match='row 2, column 3') as refused:
        measure(values, LIMIT, GUARD)
    assert refused.value.refusal is TareRefusal.PRESSED


@pytest.mark.parametrize(('unit', 'limit', 'reading'), [('Pa', 10e3, 12e3), ('N', 0.03, 0.05)])
def test_every_reading_and_limit_of_a_refusal_has_the_unit_of_the_taxels(unit, limit, reading):
    values = np.full((5, 2, 2), reading)
    pressed, contact = refused_with(values, limit, unit), refused_with(20 * values, 1e9, unit)
    assert (pressed.refusal, contact.refusal) == (TareRefusal.PRESSED, TareRefusal.CONTACT)
    assert f'below {limit:g} {unit},' in pressed.expected
    assert f'mean {reading:g} {unit}, varying by 0 {unit}' in pressed.got
    assert f'{20 * reading:g} {unit} above zero' in contact.got


def refused_with(values, limit, unit):
    with pytest.raises(TareRefusedError) as refused:
        measure(values, limit, ContactGuard.of_unit(unit))
    return refused.value


def test_a_taxel_without_a_valid_value_keeps_its_zero():
    values = frames(np.ones((2, 2)), 0.0, 5)
    values[2, 0, 1] = np.nan
    assert measure(values, LIMIT, GUARD).offset.tolist() == [[1, 0], [1, 1]]
    with pytest.raises(TareRefusedError) as refused:
        measure(np.full((5, 2, 2), np.nan), LIMIT, GUARD)
    assert refused.value.refusal is TareRefusal.NO_VALID_VALUES


def tared(pad: TaredPad, given: list[TaxelFrame], count: int, timeout: float = 60.0, zero_device=None,
          boots=lambda: 0):
    """Run a tare on a thread while the frames in ``given`` arrive repeatedly, and return the outcome."""
    outcome = []

    def run():
        try:
            outcome.append(pad.tare(count, LIMIT, timeout) if zero_device is None else
                           pad.tare_after(zero_device, boots, frames=count, limit=LIMIT, timeout=timeout))
        except (TareRefusedError, DeviceError) as error:
            outcome.append(error)
    thread = threading.Thread(target=run)
    thread.start()
    while thread.is_alive():
        for one in given:
            pad.feed(one)
        thread.join(0.001)
    return outcome[0]


def test_whole_frames_alone_count_and_the_tare_is_taken_off_afterwards():
    pad = TaredPad(GUARD)
    before = frame([[1, 2], [3, np.nan]])
    assert pad.feed(before) is before
    found = tared(pad, [frame([[1, 2], [3, np.nan]]), frame([[50, 50], [50, 50]], missing=1)], 4)
    assert found.frames == 4
    after = pad.feed(frame([[1, 3], [2, 7]]))
    assert after.values.tolist() == [[0, 1], [-1, 7]] and not after.values.flags.writeable
    again = tared(pad, [frame([[2, 2], [2, 2]])], 3)
    # The new offset is relative to the values of the skin, not to the values after the first tare.
    assert again.offset.tolist() == [[2, 2], [2, 2]]


def test_a_refused_tare_leaves_the_one_before_and_too_few_frames_are_reported():
    pad = TaredPad(GUARD)
    tared(pad, [frame([[1.0]])], 3)
    assert tared(pad, [frame([[50.0]])], 3).refusal is TareRefusal.PRESSED
    assert pad.feed(frame([[1.0]])).values.tolist() == [[0.0]]
    refused = tared(pad, [frame([[1.0]], missing=1)], 5, timeout=0.05)
    assert refused.refusal is TareRefusal.TOO_FEW_FRAMES and '5 whole taxel frames' in refused.expected


def test_while_the_device_zeroes_itself_no_value_is_valid():
    pad, seen, given = TaredPad(GUARD), [], [frame([[3.0, 4.0]])]
    tared(pad, given, 3)

    def zero_device():
        seen.append(pad.feed(frame([[3.0, 4.0]])).values.tolist())
        given[0] = frame([[0.25, 0.0]])
        return 2

    channels, found = tared(pad, given, 3, zero_device=zero_device)
    assert np.isnan(seen).all() and channels == 2 and found.offset.tolist() == [[0.25, 0]]
    # The result contains no part of the previous tare.
    assert pad.feed(frame([[1.25, 5.0]])).values.tolist() == [[1, 5]]


def test_a_device_is_not_requested_to_take_a_load_for_its_zero():
    pad, requests = TaredPad(GUARD), []
    refused = tared(pad, [frame([[50.0]])], 3, zero_device=lambda: requests.append(1))
    assert refused.refusal is TareRefusal.PRESSED and not requests
    assert pad.feed(frame([[50.0]])).values.tolist() == [[50]]


def refuses(error):
    def zero_device():
        raise error('node 5', expected='that it zeroes itself', got='an abort', remedy='See its manual.')
    return zero_device


def test_a_device_that_zeroes_nothing_leaves_the_tare_before():
    pad = TaredPad(GUARD)
    tared(pad, [frame([[3.0]])], 3)
    error = tared(pad, [frame([[3.0]])], 3, zero_device=refuses(DeviceError))
    assert type(error) is DeviceError and error.got == 'an abort'
    assert pad.feed(frame([[4.0]])).values.tolist() == [[1.0]] and pad.zero_state is ZeroState.VALID


def test_a_partly_zeroed_device_has_no_valid_value_until_the_next_tare():
    pad = TaredPad(GUARD)
    tared(pad, [frame([[3.0]])], 3)
    error = tared(pad, [frame([[3.0]])], 3, zero_device=refuses(HalfZeroedError))
    assert np.isnan(pad.feed(frame([[4.0]])).values).all()
    assert pad.zero_state is ZeroState.DEVICE_PARTLY_ZEROED and pad.zero_error is error
    tared(pad, [frame([[1.0]])], 3)
    assert pad.feed(frame([[4.0]])).values.tolist() == [[3.0]] and pad.zero_state is ZeroState.VALID


@pytest.mark.parametrize('later', [[], [1.0]], ids=['', 'after a plain tare'])
def test_a_device_that_has_lost_its_zero_gives_no_valid_value_until_the_next_tare(later):
    """A plain tare after the device's zero does not make the values valid.

    The plain tare was measured relative to the device's zero, so it is wrong once that zero is lost.
    """
    pad, boots = TaredPad(GUARD), []
    tared(pad, [frame([[0.5]])], 3, zero_device=lambda: 1, boots=lambda: len(boots))
    for value in later:
        tared(pad, [frame([[value]])], 3)
    assert pad.feed(frame([[4.0]])).values.tolist() == [[3.0 if later else 3.5]]
    boots.append('power cycle')
    assert np.isnan(pad.feed(frame([[8.0]])).values).all()
    assert pad.zero_state is ZeroState.DEVICE_HAS_RESTARTED
    tared(pad, [frame([[4.5]])], 3)
    assert pad.feed(frame([[8.0]])).values.tolist() == [[3.5]] and pad.zero_state is ZeroState.VALID


def test_a_tare_that_waits_for_frames_that_no_longer_come_is_refused():
    pad, refused = TaredPad(GUARD), []

    def tare():
        with pytest.raises(TareRefusedError) as error:
            pad.tare(5, LIMIT, 20.0)
        assert error.value.refusal is TareRefusal.DRIVER_NOT_ACTIVE and error.value.got == 'one that was deactivated'
        refused.append(True)
    waiting = threading.Thread(target=tare)
    waiting.start()
    pad.give_up('one that was deactivated')
    waiting.join(60.0)
    assert refused
    pad.expect()
    assert tared(pad, [frame([[1.0]])], 3).frames == 3


SIDE, ANY_LIMIT = 16, 1e9
OBJECT = np.zeros((SIDE, SIDE), bool)
OBJECT[5:11, 4:12] = True
SMALL = np.zeros((SIDE, SIDE), bool)
SMALL[7:9, 3:5] = True


def tared_with_any_limit(readings, unit='Pa', zero=0.0, gains=1.0, noise=0.01):
    """Tare with 20 frames of ``readings`` plus noise.

    The standard deviation of the noise is a fraction of the unit's press threshold.
    """
    guard = ContactGuard.of_unit(unit, gains)
    return measure(frames(np.asarray(readings, float), noise * guard.press, 20), ANY_LIMIT, guard, zero)


@pytest.mark.parametrize(('what', 'given'), [
    ('an object', {'readings': 50e3 * OBJECT}),
    ('a small one', {'readings': 35e3 * SMALL}),
    ('one taxel, as the processor reports it', {'readings': 35e3 * (np.arange(256) == 40).reshape(SIDE, SIDE)}),
    ('one that lightens, but is not released yet', {'readings': 26e3 * OBJECT}),
    ('all over the pad', {'readings': np.full((SIDE, SIDE), 40e3)}),
    ('an object on a skin in newton', {'readings': 0.3 * OBJECT, 'unit': 'N'}),
    ('a zero far below what the object adds', {'readings': -20e3 + 28e3 * OBJECT, 'zero': -20e3}),
    ('at start-up, hidden in a low offset', {'readings': -20e3 + 35e3 * OBJECT}),
    ('lighter than a contact, but it stands out', {'readings': 15e3 * OBJECT}),
    ('a weak taxel that its gain makes a contact', {'readings': 5e3 * OBJECT, 'gains': np.full((SIDE, SIDE), 10.0)})])
def test_a_contact_is_never_tared_away_at_any_limit(what, given):
    """If a contact were tared away, the planner would see an empty gripper."""
    with pytest.raises(TareRefusedError) as refused:
        tared_with_any_limit(**given)
    assert refused.value.refusal is TareRefusal.CONTACT, what


@pytest.mark.parametrize('how', ['comes and goes', 'partly hidden'])
def test_a_contact_that_is_seen_in_a_part_of_the_frames_is_one(how):
    values = frames(50e3 * SMALL if how == 'partly hidden' else np.zeros((SIDE, SIDE)), 100.0, 50)
    if how == 'partly hidden':
        values[::2, SMALL] = np.nan
    else:
        values[20:22, OBJECT] += 50e3
    with pytest.raises(TareRefusedError) as refused:
        measure(values, ANY_LIMIT, GUARD)
    assert refused.value.refusal is TareRefusal.CONTACT


@pytest.mark.slow
@pytest.mark.parametrize('spread', [0.0, 1e3, 3e3])
def test_offsets_are_not_a_contact(spread):
    """For each kind of offset, the test draws a hundred pads without using the code under test.

    The pads have scattered offsets, a common offset, or a tilt.
    """
    tilt = np.linspace(-2e3, 4e3, SIDE)[:, np.newaxis]
    for seed in range(100):
        apart = spread * np.random.default_rng(seed).standard_normal((SIDE, SIDE))
        for offset in (apart, apart + 8e3, apart - 50e3, apart + tilt):
            found = tared_with_any_limit(offset)
            np.testing.assert_allclose(found.offset, offset, atol=6 * 300 / 20 ** 0.5)


def test_two_taxels_with_large_offsets_are_tared_with_a_higher_limit():
    offset = np.zeros((SIDE, SIDE))
    offset[3, 3:5] = 20e3
    with pytest.raises(TareRefusedError) as refused:
        measure(frames(offset, 100.0, 20), 10e3, GUARD)
    assert refused.value.refusal is TareRefusal.PRESSED
    assert tared_with_any_limit(offset).largest == pytest.approx(20e3, rel=0.02)


def test_after_the_devices_zero_a_tare_that_fails_leaves_no_valid_value():
    """An object was inserted during the zeroing, and the device may have included a part of its load in the zero."""
    pad, given = TaredPad(GUARD), [frame([[0.5, 0.5]])]

    def zero_device():
        given[0] = frame([[20.0, 20.0]])
        return 2
    refused = tared(pad, given, 3, zero_device=zero_device)
    assert refused.refusal is TareRefusal.PRESSED
    assert np.isnan(pad.feed(frame([[20.0, 20.0]])).values).all()
    assert pad.zero_state is ZeroState.DEVICE_NOT_CHECKED
    tared(pad, [frame([[0.25, 0.25]])], 3)
    assert pad.feed(frame([[1.25, 0.25]])).values.tolist() == [[1, 0]] and pad.zero_state is ZeroState.VALID


def test_a_frame_that_meets_the_zeroing_of_the_device_has_no_value():
    """The state of the zero and the zero itself must not come from before and after a tare."""
    pad, has_asked, given = TaredPad(GUARD), threading.Event(), []

    def boots():
        has_asked.set()
        return 0
    pad._boots = boots  # called when a frame asks for the state of the zero
    with pad._changed:
        feeding = threading.Thread(target=lambda: given.append(pad.feed(frame([[7.0, 7.0]]))))
        feeding.start()
        has_asked.wait(0.2)  # a frame that asks before it may go on has the old state
        pad._zero_state, pad.offset = ZeroState.DEVICE_IS_ZEROING, None
    feeding.join()
    assert not given[0].has_value.any()
