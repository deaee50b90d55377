"""Tests for the demo's report of its touches as a table, a CSV file and a picture.

The demo makes the report from the messages of the shape topic.
"""

import csv
from types import SimpleNamespace

import numpy as np
import pytest

from examples.demo.observation import Performance, SeenFit, SeenFrame, verdicts_of
from examples.demo.report import score, speed, table, write_csv
from examples.demo.skin import Script
from examples.demo.touches import TouchedPad, scripted_touches
from tactile_node.simulator.touches import SimulatedTouch
from tactile_node.simulator.world import Contact

PITCH = 0.002
LIGHT = 20e3  # Pressure above the noise and below a press [Pa].
CORNERS = np.array([[0.01, 0.01], [0.02, 0.01], [0.02, 0.015], [0.01, 0.015]])
RECTANGLE = SeenFit({'long': 0.010, 'short': 0.005}, (0.015, 0.0125), np.radians(30),
                    ('x', 'y', 'angle', 'long', 'short'),
                    np.diag([1e-5, 2e-5, np.radians(0.5), 3e-5, 4e-5]) ** 2, CORNERS)
CIRCLE = SeenFit({'radius': 0.004}, (0.01, 0.02), None, ('x', 'y', 'radius'),
                 np.diag([1e-5, 2e-5, 3e-5]) ** 2, CORNERS)
TOUCHES = (SimulatedTouch(Contact('rectangle', (5, 2.5), 7.5, 6.25, 0.5), 0.0, 1.0),
           SimulatedTouch(Contact('circle', (2,), 5, 9), 2.0, 3.0),
           SimulatedTouch(Contact('square', (4,), 5, 9), 4.0, 5.0))


@pytest.fixture
def verdicts():
    taxels = np.zeros((16, 16))
    names = {'rectangle': 0.1, 'circle': 0.1, 'square': 0.0}
    seen = [SeenFrame(0.5, {**names, 'rectangle': 0.9}, taxels, RECTANGLE),
            SeenFrame(2.5, {**names, 'circle': 0.9}, taxels, CIRCLE),
            SeenFrame(4.5, {**names, 'circle': 0.8}, taxels, None)]
    return verdicts_of('left', TOUCHES, seen, PITCH)


def test_the_csv_has_pose_and_size_with_their_deviations_as_numbers(verdicts, tmp_path):
    write_csv(verdicts, tmp_path / 'x.csv')
    rectangle, circle, unfitted = csv.DictReader((tmp_path / 'x.csv').open(encoding='utf-8'))
    found = {name: float(rectangle[name]) for name in ('size1_mm', 'size2_mm', 'size_sd_mm', 'x_mm', 'y_mm',
                                                       'centre_sd_mm', 'found_angle_deg', 'angle_sd_deg')}
    assert list(found.values()) == pytest.approx([10, 5, 0.04, 15, 12.5, 0.02, 30, 0.5])
    assert circle['size1_mm'] == '4.000' and circle['size2_mm'] == circle['found_angle_deg'] == ''
    assert unfitted['x_mm'] == '' and unfitted['recognised'] == 'circle'


def circle(radius, sd=0.03):
    """Return the verdict on a touch by a circle of 4 mm radius whose measured radius is ``radius`` [mm]."""
    fit = CIRCLE._replace(dimensions={'radius': 1e-3 * radius}, covariance=np.diag([1e-5, 2e-5, 1e-3 * sd]) ** 2)
    verdict, = verdicts_of('left', TOUCHES[1:2], [SeenFrame(2.5, {'circle': 1.0}, np.zeros((16, 16)), fit)], PITCH)
    return verdict


def test_a_right_shape_with_a_wrong_size_is_not_a_right_touch():
    """A wrong size counts as wrong, even if its standard deviation is large and the shape is certain."""
    near, wide = circle(4.2), circle(5.5, sd=0.76)
    assert near.is_right_shape and near.is_right_size and near.size_error == pytest.approx(0.0002)
    assert wide.is_right_shape and not wide.is_right_size and wide.size_error == pytest.approx(0.0015)
    assert '1 of them with the right size' in score([near, wide])
    assert [line.endswith('wrong size') for line in table([near, wide]).splitlines()] == [False, False, True]


def test_a_touch_without_a_fit_or_of_another_shape_has_no_right_size(verdicts):
    rectangle, circle, square = verdicts
    assert rectangle.is_right_size and circle.is_right_size
    assert not square.is_right_size and np.isnan(square.size_error)
    assert '2 of 3 touches recognised, 2 of them' in score(verdicts)


@pytest.mark.parametrize('latency, frames, skin_late, waited, is_slow', [
    (100 * [0.02], 100, 0.002, 0.1, False),
    (100 * [0.5], 100, 0.002, 0.1, False),  # The package is slow here, but the machine is not.
    (60 * [0.02], 100, 0.002, 0.1, False),  # The package has lost frames here, although the machine is fast enough.
    (60 * [0.02], 100, 0.002, 0.9, True),  # The nodes did not get a processor in time.
    (100 * [0.02], 100, 0.2, 0.1, True)])  # The simulated skin did not get a processor in time.
def test_a_machine_that_is_too_slow_is_named(latency, frames, skin_late, waited, is_slow):
    text = speed(Performance(latency, frames, skin_late, waited))
    assert ('too slow or too busy' in text) is is_slow
    assert f'median {1e3 * latency[0]:.0f} ms' in text and f'{len(latency)}% of the taxel frames' in text


def test_a_script_continues_when_a_device_is_restarted(monkeypatch):
    """A restarted device counts its seconds from 0 again, but the script of touches continues."""
    monkeypatch.setattr('examples.demo.skin.time', SimpleNamespace(time=lambda: 1000.0))
    script, touch = Script(), scripted_touches(1, [25.0], 16, 16)[0]
    pad, middle = TouchedPad((touch,), 16, 16, 1), (touch.begin + touch.end) / 2
    assert script.felt(pad, middle).max() < LIGHT, 'the script has not begun'
    script.begin = 1000.0 - middle
    assert script.felt(pad, 0.0).max() > LIGHT
    script.begin = 1000.0 - touch.end - 1
    assert script.felt(pad, middle).max() < LIGHT
