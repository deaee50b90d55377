"""The part of the LeRobot example that needs no LeRobot: windows, masks and statistics."""

from types import SimpleNamespace

import lerobot_dataset as example
import numpy as np
import pytest
from lerobot_dataset import FILL, NO_STAMP, SECOND, Acquisitions, Recording

BEGIN = 1_795_861_620_123_456_789  # A stamp whose nanoseconds do not fit into a float64 [ns].
PERIOD = SECOND // 50


def acquired(*sequences, jitter=0):
    """Return acquisitions of 1 x 2 taxels. Both values equal the sequence number."""
    stamps = BEGIN + PERIOD * np.array(sequences) + jitter * (-1)**np.array(sequences)
    values = np.repeat(np.array(sequences, np.float32), 2).reshape(-1, 1, 2)
    return Acquisitions(np.array(sequences), stamps, values)


def window(pad, periods, length=3):
    return example.window(pad, BEGIN + round(PERIOD * periods), length)


@pytest.mark.parametrize(('periods', 'expected'), [
    (-0.1, [FILL, FILL, FILL]), (0.0, [FILL, FILL, 0]), (3.0, [1, 2, 3]), (3.9, [1, 2, 3]),
    (4.4, [1, 2, 3]),        # The next acquisition is late, but not lost yet.
    (4.6, [2, 3, FILL]),     # Acquisition 4 is lost.
    (5.6, [3, FILL, FILL]), (6.0, [FILL, FILL, 6]), (9.6, [FILL, FILL, FILL])])
def test_a_lost_acquisition_is_a_gap_and_no_zero(periods, expected):
    found = window(acquired(0, 1, 2, 3, 6), periods)
    assert found.taxels[:, 0, 0].tolist() == expected
    present = [value != FILL for value in expected]
    assert found.valid.all(axis=(1, 2)).tolist() == found.valid.any(axis=(1, 2)).tolist() == present
    stamps = [BEGIN + PERIOD * value if value != FILL else NO_STAMP for value in expected]
    assert found.stamp.dtype == np.int64 and found.stamp.tolist() == stamps


def test_jitter_of_the_stamps_loses_nothing():
    pad = acquired(*range(20), jitter=PERIOD // 5)
    for periods in np.arange(3.0, 19.0, 0.1):
        assert window(pad, periods).valid.all()


def test_a_taxel_without_a_value_is_filled_and_masked():
    pad = acquired(0, 1, 2)
    pad.values[1, 0, 1] = np.nan
    found = window(pad, 2.0)
    assert found.taxels[:, 0].tolist() == [[0, 0], [1, FILL], [2, 2]]
    assert found.valid[:, 0].tolist() == [[True, True], [True, False], [True, True]]


def test_the_statistics_use_valid_values_only():
    values = np.array([[1.0, FILL, FILL], [3.0, 5.0, FILL]], np.float32)
    found = example.statistics(values, values != FILL)
    assert found['min'].tolist() == [1.0, 5.0, FILL] and found['max'].tolist() == [3.0, 5.0, FILL]
    assert found['mean'].tolist() == [2.0, 5.0, FILL] and found['std'].tolist() == [1.0, 0.0, 1.0]
    assert found['q50'].tolist() == [2.0, 5.0, FILL] and found['count'].tolist() == [2]


def grasp(width):
    return SimpleNamespace(width=width, offset=0.001, misalignment=np.nan, centre=(0.01, 0.02), yaw=np.nan,
                           grip_force=2.0, contact=4, shape=4, fresh=True, stable=False)


def test_the_columns_of_a_frame():
    pads = {'left': acquired(*range(11)), 'arm/right': acquired(*range(11))}
    recording = Recording(pads, [(BEGIN, grasp(0.05)), (BEGIN + PERIOD, grasp(np.nan))],
                          [(BEGIN, 'left', 1), (BEGIN + PERIOD, 'left', 3), (BEGIN + PERIOD, 'left', 3)])
    frames = list(example.frames_of(recording, 25, 2))
    assert len(frames) == 6
    first, second, *_, last = frames
    assert first['observation.grasp'].tolist() == pytest.approx([0.05, 0.001, FILL, 0.01, 0.02, FILL, 2.0])
    assert second['observation.grasp_valid'].tolist() == [False, True, False, True, True, False, True]
    assert second['observation.grasp_codes'].tolist() == [4, 4, 1, 0]
    assert not last['observation.grasp_valid'].any() and not last['observation.grasp_codes'].any()  # too old
    assert first['observation.left.events'].tolist() == [0, 1, 0, 0, 0, 0, 0, 0, 0]
    assert second['observation.left.events'].tolist() == [0, 0, 0, 2, 0, 0, 0, 0, 0]
    assert not second['observation.arm_right.events'].any()
    for name in ('taxels', 'stamp'):
        mask = example.valid_in(second, f'observation.left.{name}')
        assert mask.shape == second[f'observation.left.{name}'].shape and mask.all()
    assert example.valid_in(second, 'observation.grasp') is second['observation.grasp_valid']
    assert example.valid_in(second, 'observation.left.events') is None
