"""Tests for the size and position of figures pressed into a simulated skin."""

import numpy as np
import pytest

from tactile_node.errors import InputError
from tactile_node.simulator.figures import NAMED, Figure, coverage, named_silhouette, silhouette_of
from tactile_node.simulator.touches import TouchProgram
from tactile_node.skin.layout_file import load_layout


@pytest.mark.parametrize('name', NAMED)
def test_a_figure_covers_its_area_about_its_centre(name):
    figure = Figure(named_silhouette(name), 50.0, x=9.3, y=10.1, angle=1.0)
    covered = coverage(figure, 20, 20)
    assert covered.sum() == pytest.approx(50, rel=0.02)
    rows, cols = np.indices(covered.shape)
    assert (covered * cols).sum() / covered.sum() == pytest.approx(9.3, abs=0.06)
    assert (covered * rows).sum() / covered.sum() == pytest.approx(10.1, abs=0.06)


def test_a_named_figure_is_pressed_with_its_area():
    program = TouchProgram(load_layout('sim16x16.yaml'), ('cross',), (40.0,), hold=1.0, pause=0.5)
    values = program(1.0)
    assert values.sum() / values.max() == pytest.approx(40, rel=0.03)


def test_an_empty_silhouette_and_an_unknown_name_are_refused():
    with pytest.raises(InputError):
        silhouette_of('nothing', np.zeros((50, 50), bool))
    with pytest.raises(InputError):
        named_silhouette('dodecahedron')
