"""The example that converts a bag for Rerun, with a stand-in for Rerun's module and for the bag."""

import sys
from math import nan
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

GREY = [128, 128, 128]
GREEN = [60, 210, 80]


def message(kind, topic, **fields):
    """Return a message of a bag, which was acquired at 5.25 s."""
    stamp = SimpleNamespace(sec=5, nanosec=250_000_000)
    return SimpleNamespace(topic=topic, type=f'tactile_skin/msg/{kind}',
                           content=SimpleNamespace(header=SimpleNamespace(stamp=stamp), **fields))


def shape(sequence, class_name, force, *corners):
    points = [SimpleNamespace(x=x, y=y) for x, y in corners]
    return message('ContactShape', '/left/shape', sequence=sequence, class_name=class_name, force=force,
                   outline=SimpleNamespace(points=points))


GRASP = message('Grasp', '/grasp', sequences=[1, 1], width=nan, offset=0.001, grip_force=2.0, message='TWO_SIDED',
                class_name='square')
MESSAGES = [
    message('TaxelArray', '/left/taxels', sequence=1, rows=2, cols=3, pitch=0.004, unit='Pa', missing_can_frames=0,
            values=[0, 1, nan, 4, 5, 6], status=[1, 1, 2, 1, 1, 5]),
    shape(1, 'square', 2.0, (0.004, 0.0), (0.008, 0.0), (0.008, 0.004)), shape(2, 'none', 0.0), GRASP, GRASP]


@pytest.fixture
def example(monkeypatch):
    """Return the example, whose ``rr`` is a stand-in that records all calls."""
    stand_in = MagicMock()
    for name, module in (('rerun', stand_in), ('rerun.blueprint', stand_in.blueprint)):
        monkeypatch.setitem(sys.modules, name, module)
    import rerun_bag
    monkeypatch.setattr(rerun_bag, 'rr', stand_in)  # a second import returns the module of the first one
    return rerun_bag


@pytest.fixture
def rerun(example, monkeypatch):
    """Convert MESSAGES, and return the stand-in."""
    monkeypatch.setattr(example, 'TopicBagReader', lambda bag: SimpleNamespace(
        pads=('left',), damages=(), messages=lambda kinds: [each for each in MESSAGES if each.type in kinds]))
    example.convert('bag', 'skin.rrd')
    return example.rr


def given(recorded):
    return [call.args[0] for call in recorded.call_args_list]


def test_a_taxel_without_a_valid_value_is_grey_and_a_saturated_one_green(rerun):
    image, = given(rerun.Image)
    assert image.shape == (2, 3, 3) and image[0, 2].tolist() == GREY and image[1, 2].tolist() == GREEN
    assert [call.kwargs['timestamp'] for call in rerun.set_time.call_args_list] == [5.25] * len(MESSAGES)


def test_an_outline_lies_on_its_taxels_and_disappears_without_a_fit(rerun):
    """The first corner is at the centre of the taxel in column 1 of row 0, which is the pixel from 1 to 2."""
    (outline,), nothing = given(rerun.LineStrips2D)
    assert outline == pytest.approx(np.array([[1.5, 0.5], [2.5, 0.5], [2.5, 1.5], [1.5, 0.5]])) and not nothing


def test_an_unknown_number_stays_nan_and_an_unchanged_grasp_is_one_line(rerun):
    np.testing.assert_array_equal(given(rerun.Scalars), [2.0, 0.0, *2 * [nan, 0.001, 2.0]])
    assert given(rerun.TextLog) == ['TWO_SIDED: square']
    assert {'left/force', 'left/taxels', 'left/taxels/outline', 'grasp/width', 'grasp/state'} <= set(given(rerun.log))


def logged(example, *messages):
    """Log messages (stamp, sequences) as a curve of the value 2, and return the times and values in the recording."""
    curves = example.Curves('force')
    for stamp, *sequences in messages:
        example.rr.set_time('acquired', timestamp=stamp)
        curves.log(stamp, sequences, [2.0])
    found, now = [], nan
    for name, values, options in example.rr.mock_calls:
        now = options.get('timestamp', now)
        if name == 'Scalars':
            found.append((now, *values))
    return found


@pytest.mark.parametrize(('messages', 'gaps'), [
    ([(0.0, 7), (0.1, 8), (0.2, 9), (0.35, 10)], []),
    ([(0.0, 7), (0.1, 8), (0.3, 10)], [0.2]),                # acquisition 9 is missing
    ([(0.0, 7), (0.25, 8), (0.5, 9), (1.25, 10)], [0.875]),  # SYNC paused
    ([(0.0, 7), (1.0, 0)], [0.5]),                           # the driver was started again
    ([(0.0, 7, 7), (0.0, 8, 7), (0.1, 8, 8), (0.1, 9, 8)], []),
    ([(0.0, 7, 7), (0.5, 8, 9)], [0.25])])
def test_a_curve_has_a_gap_where_messages_are_missing(example, messages, gaps):
    found = logged(example, *messages)
    assert [time for time, value in found if np.isnan(value)] == pytest.approx(gaps)
    assert [time for time, value in found if value == 2.0] == [time for time, *_ in messages]


def test_an_existing_file_is_kept_and_a_missing_bag_is_one_line(example, tmp_path, monkeypatch, capsys):
    (tmp_path / 'skin.rrd').write_bytes(b'earlier')
    for output, expected in (('skin.rrd', 'expected a new file'), ('new.rrd', 'expected a bag, got no such file')):
        monkeypatch.setattr(sys, 'argv', ['rerun_bag.py', str(tmp_path / 'no.mcap'), str(tmp_path / output)])
        assert example.main() == 2
        printed = capsys.readouterr().err
        assert expected in printed and printed.count('\n') == 1
    assert [path.name for path in tmp_path.iterdir()] == ['skin.rrd']
