"""Tare: measured from whole frames, refused under load, taken off every frame after."""

import threading

import numpy as np
import pytest

from tactile_node.conditioning.tare import TaredPad, ZeroState, measure
from tactile_node.errors import DeviceError, HalfZeroedError, TareRefusal, TareRefusedError
from tactile_node.frames.taxel_frame import TaxelFrame

LIMIT = 10.0


def frames(offset: np.ndarray, noise: float, count: int = 200, seed: int = 1) -> np.ndarray:
    return offset + noise * np.random.default_rng(seed).standard_normal((count, *offset.shape))


def frame(values, missing=0):
    values = np.asarray(values, np.float32)
    return TaxelFrame(0.0, 0, values, np.zeros(values.shape, np.uint8), missing_can_frames=missing)


def test_offsets_and_noise_are_found():
    """Mean of K samples: standard error noise / sqrt(K); the noise itself to a few per cent over 48 taxels."""
    offset = np.linspace(-3, 3, 48).reshape(6, 8)
    found = measure(frames(offset, 0.5), LIMIT)
    np.testing.assert_allclose(found.offset, offset, atol=5 * 0.5 / 200 ** 0.5)
    assert found.noise == pytest.approx(0.5, rel=0.03) and found.frames == 200
    assert abs(found.largest) == pytest.approx(3, abs=0.2)


@pytest.mark.parametrize('press', ['held', 'growing', 'tapping'])
def test_refused_while_something_presses(press):
    values = frames(np.zeros((6, 8)), 0.1, 50)
    values[:, 2, 3] += {'held': np.full(50, 11.0), 'growing': np.linspace(0, 11, 50),
                        'tapping': np.arange(50) % 25 == 0}[press] * (12 if press == 'tapping' else 1)
    with pytest.raises(TareRefusedError, match='row 2, column 3') as refused:
        measure(values, LIMIT)
    assert refused.value.refusal is TareRefusal.PRESSED


def test_a_taxel_without_a_valid_value_keeps_its_zero():
    values = frames(np.ones((2, 2)), 0.0, 5)
    values[2, 0, 1] = np.nan
    assert measure(values, LIMIT).offset.tolist() == [[1, 0], [1, 1]]
    with pytest.raises(TareRefusedError) as refused:
        measure(np.full((5, 2, 2), np.nan), LIMIT)
    assert refused.value.refusal is TareRefusal.NO_VALID_VALUES


def tared(pad: TaredPad, given: list[TaxelFrame], count: int, timeout: float = 20.0, zero_device=None,
          is_kept=lambda: True):
    """Tare on a thread while ``given`` frames come again and again."""
    outcome = []

    def run():
        try:
            outcome.append(pad.tare(count, LIMIT, timeout) if zero_device is None else
                           pad.tare_after(zero_device, is_kept, frames=count, limit=LIMIT, timeout=timeout))
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
    pad = TaredPad()
    before = frame([[1, 2], [3, np.nan]])
    assert pad.feed(before) is before
    found = tared(pad, [frame([[1, 2], [3, np.nan]]), frame([[50, 50], [50, 50]], missing=1)], 4)
    assert found.frames == 4
    after = pad.feed(frame([[1, 3], [2, 7]]))
    assert after.values.tolist() == [[0, 1], [-1, 7]] and not after.values.flags.writeable
    again = tared(pad, [frame([[2, 2], [2, 2]])], 3)
    assert again.offset.tolist() == [[2, 2], [2, 2]]  # of the skin, not of what the first tare had left


def test_a_refused_tare_leaves_the_one_before_and_too_few_frames_are_reported():
    pad = TaredPad()
    tared(pad, [frame([[1.0]])], 3)
    assert tared(pad, [frame([[50.0]])], 3).refusal is TareRefusal.PRESSED
    assert pad.feed(frame([[1.0]])).values.tolist() == [[0.0]]
    refused = tared(pad, [frame([[1.0]], missing=1)], 5, timeout=0.05)
    assert refused.refusal is TareRefusal.TOO_FEW_FRAMES and '5 whole taxel frames' in refused.expected


def test_while_the_device_zeroes_itself_no_value_is_valid():
    pad, seen, given = TaredPad(), [], [frame([[3.0, 4.0]])]
    tared(pad, given, 3)

    def zero_device():
        seen.append(pad.feed(frame([[3.0, 4.0]])).values.tolist())
        given[0] = frame([[0.25, 0.0]])
        return 2

    channels, found = tared(pad, given, 3, zero_device=zero_device)
    assert np.isnan(seen).all() and channels == 2 and found.offset.tolist() == [[0.25, 0]]
    assert pad.feed(frame([[1.25, 5.0]])).values.tolist() == [[1, 5]]  # nothing is left of the tare before


def test_a_device_is_not_requested_to_take_a_load_for_its_zero():
    pad, requests = TaredPad(), []
    refused = tared(pad, [frame([[50.0]])], 3, zero_device=lambda: requests.append(1))
    assert refused.refusal is TareRefusal.PRESSED and not requests
    assert pad.feed(frame([[50.0]])).values.tolist() == [[50]]


def refuses(error):
    def zero_device():
        raise error('node 5', expected='that it zeroes itself', got='an abort', remedy='See its manual.')
    return zero_device


def test_a_device_that_zeroes_nothing_leaves_the_tare_before():
    pad = TaredPad()
    tared(pad, [frame([[3.0]])], 3)
    error = tared(pad, [frame([[3.0]])], 3, zero_device=refuses(DeviceError))
    assert type(error) is DeviceError and error.got == 'an abort'
    assert pad.feed(frame([[4.0]])).values.tolist() == [[1.0]] and pad.zero_state is ZeroState.VALID


def test_of_a_device_that_zeroes_itself_in_part_no_value_is_valid_until_the_next_tare():
    pad = TaredPad()
    tared(pad, [frame([[3.0]])], 3)
    error = tared(pad, [frame([[3.0]])], 3, zero_device=refuses(HalfZeroedError))
    assert np.isnan(pad.feed(frame([[4.0]])).values).all()
    assert pad.zero_state is ZeroState.DEVICE_PARTLY_ZEROED and pad.zero_error is error
    tared(pad, [frame([[1.0]])], 3)
    assert pad.feed(frame([[4.0]])).values.tolist() == [[3.0]] and pad.zero_state is ZeroState.VALID


def test_a_device_that_has_lost_its_zero_gives_no_valid_value_until_the_next_tare():
    pad, boots = TaredPad(), []
    tared(pad, [frame([[0.5]])], 3, zero_device=lambda: 1, is_kept=lambda: not boots)
    assert pad.feed(frame([[4.0]])).values.tolist() == [[3.5]]
    boots.append('power cycle')
    assert np.isnan(pad.feed(frame([[8.0]])).values).all()
    assert pad.zero_state is ZeroState.DEVICE_HAS_RESTARTED
    tared(pad, [frame([[4.5]])], 3)
    assert pad.feed(frame([[8.0]])).values.tolist() == [[3.5]] and pad.zero_state is ZeroState.VALID


def test_a_tare_that_waits_for_frames_that_no_longer_come_is_refused():
    pad, refused = TaredPad(), []

    def tare():
        with pytest.raises(TareRefusedError) as error:
            pad.tare(5, LIMIT, 20.0)
        assert error.value.refusal is TareRefusal.DRIVER_NOT_ACTIVE and error.value.got == 'one that was deactivated'
        refused.append(True)
    waiting = threading.Thread(target=tare)
    waiting.start()
    pad.give_up('one that was deactivated')
    waiting.join(10.0)
    assert refused
    pad.expect()
    assert tared(pad, [frame([[1.0]])], 3).frames == 3
