"""What the demo writes of its touches: table, CSV and picture, from what the shape topic reported."""

import csv

import numpy as np
import pytest

from examples.demo.observation import Seen, SeenFit, verdicts_of
from examples.demo.report import write_csv
from tactile_node.simulator.touches import SimulatedTouch
from tactile_node.simulator.world import Contact

PITCH = 0.002
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
    seen = [Seen(0.5, {**names, 'rectangle': 0.9}, taxels, RECTANGLE),
            Seen(2.5, {**names, 'circle': 0.9}, taxels, CIRCLE),
            Seen(4.5, {**names, 'circle': 0.8}, taxels, None)]
    return verdicts_of('left', TOUCHES, seen)


def test_the_csv_has_pose_and_size_with_their_deviations_as_numbers(verdicts, tmp_path):
    write_csv(verdicts, tmp_path / 'x.csv')
    rectangle, circle, unfitted = csv.DictReader((tmp_path / 'x.csv').open(encoding='utf-8'))
    found = {name: float(rectangle[name]) for name in ('size1_mm', 'size2_mm', 'size_sd_mm', 'x_mm', 'y_mm',
                                                       'centre_sd_mm', 'found_angle_deg', 'angle_sd_deg')}
    assert list(found.values()) == pytest.approx([10, 5, 0.04, 15, 12.5, 0.02, 30, 0.5])
    assert circle['size1_mm'] == '4.000' and circle['size2_mm'] == circle['found_angle_deg'] == ''
    assert unfitted['x_mm'] == '' and unfitted['recognised'] == 'circle'
