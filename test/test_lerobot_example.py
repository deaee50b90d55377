"""The part of the LeRobot example that needs no LeRobot: windows, masks and statistics."""

from types import SimpleNamespace

import lerobot_dataset as example
import numpy as np
import pytest
from lerobot_dataset import FILL, NO_STAMP, SECOND, Acquisitions, Recording, Window

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


def recording(**messages):
    """Return two pads with 11 acquisitions, and messages whose times are given in periods."""
    pads = {'left': acquired(*range(11)), 'arm/right': acquired(*range(11))}
    return Recording(pads, {topic.replace('_', '/'): [(BEGIN + PERIOD * periods, message) for periods, message in found]
                            for topic, found in messages.items()})


def events(*kinds):
    return [(periods, SimpleNamespace(kind=kind)) for periods, kind in kinds]


def test_the_columns_of_a_frame():
    found = recording(grasp=[(0, grasp(0.05)), (1, grasp(np.nan))], left_events=events((0, 1), (1, 3), (1, 3)),
                      left_shape=[(0, SimpleNamespace(shape=4))], arm_right_events=[])
    frames = list(example.frames_of(found, 25, 2))
    assert len(frames) == 6
    first, second, *_, last = frames
    assert first['observation.grasp'].tolist() == pytest.approx([0.05, 0.001, FILL, 0.01, 0.02, FILL, 2.0])
    assert second['observation.grasp_valid'].tolist() == [False, True, False, True, True, False, True]
    assert second['observation.grasp_codes'].tolist() == [4, 4, 1, 0]
    assert not last['observation.grasp_valid'].any() and not last['observation.grasp_codes'].any()  # too old
    assert first['observation.left.shape'].tolist() == [4] and last['observation.left.shape'].tolist() == [0]
    assert first['observation.left.events'].tolist() == [0, 1, 0, 0, 0, 0, 0, 0, 0]
    assert second['observation.left.events'].tolist() == [0, 0, 0, 2, 0, 0, 0, 0, 0]
    assert not second['observation.arm_right.events'].any()
    for name in ('taxels', 'stamp'):
        mask = example.valid_in(second, f'observation.left.{name}')
        assert mask.shape == second[f'observation.left.{name}'].shape and mask.all()
    assert example.valid_in(second, 'observation.grasp') is second['observation.grasp_valid']
    assert example.valid_in(second, 'observation.left.events') is None


def test_a_topic_that_was_not_recorded_has_no_column():
    found = recording(left_events=[])
    assert found.missing == ['left/shape', 'arm/right/shape', 'arm/right/events', 'grasp']
    assert {name for name in next(example.frames_of(found, 25, 2)) if name.split('.')[-1] not in Window._fields} == {
        'observation.left.events'}


def test_each_column_with_codes_names_them():
    columns = next(example.frames_of(recording(left_shape=[], left_events=[], grasp=[]), 25, 2))
    features = example.features_of(columns)
    shapes = features['observation.left.shape']['codes']['shape']
    codes = features['observation.grasp_codes']['codes']
    assert (shapes[3], shapes[8], len(shapes)) == ('circle', 'other', 9)
    assert codes['shape'] == shapes and list(codes) == features['observation.grasp_codes']['names']
    assert (codes['contact'][4], len(codes['contact'])) == ('two_sided', 5)
    kinds = features['observation.left.events']['names']
    assert (kinds[3], kinds[8], len(kinds)) == ('sliding', 'returned', 9)
    assert all('codes' not in features[f'observation.left.{name}'] for name in Window._fields)


def test_a_lost_acquisition_and_one_without_values_are_counted_apart():
    pad = acquired(0, 1, 3)
    pad.values[1] = np.nan
    frame = {f'observation.left.{name}': value for name, value in window(pad, 3.0, 4)._asdict().items()}
    assert example.missing_slots([frame, frame]) == (2, 2)


@pytest.mark.parametrize(('environment', 'expected'), [
    (None, 'expected LeRobot'), (object(), 'expected a folder that does not exist')])
def test_a_conversion_that_cannot_succeed_is_refused_at_once(environment, expected, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(example, 'find_spec', lambda name: environment)
    monkeypatch.setattr('sys.argv', ['lerobot_dataset.py', str(tmp_path / 'no bag'), str(tmp_path)])
    assert example.main() == 2
    assert expected in capsys.readouterr().err


def test_a_topic_of_the_bag_without_a_message_counts_as_recorded(tmp_path):
    pytest.importorskip('rosbags')
    from test_topic_bag import TAXELS, bag, store, taxel_array
    topics = ('/left/taxels', TAXELS), ('/left/shape', 'tactile_skin/msg/ContactShape')
    found = example.read(bag(tmp_path / 'bag', [('/left/taxels', taxel_array(store(), k)) for k in (1, 2)],
                             topics=topics))
    assert found.messages == {'left/shape': []} and found.missing == ['left/events', 'grasp']
    np.testing.assert_array_equal(found.pads['left'].values[1], np.array([[1, 2, np.nan], [4, 5, 6]], np.float32))
