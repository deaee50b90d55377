"""Tests for the size and position of figures pressed into a simulated skin, given by name or read from a picture."""

import numpy as np
import pytest

from tactile_node.cli.simulate import read_shape
from tactile_node.errors import InputError
from tactile_node.simulator.figures import NAMED, Figure, coverage, named_silhouette
from tactile_node.simulator.touches import touch_program
from tactile_node.skin.layout_file import load_layout


@pytest.mark.parametrize('name', NAMED)
def test_a_figure_covers_its_area_about_its_centre(name):
    figure = Figure(named_silhouette(name), 50.0, x=9.3, y=10.1, angle=1.0)
    covered = coverage(figure, 20, 20)
    assert covered.sum() == pytest.approx(50, rel=0.02)
    rows, cols = np.indices(covered.shape)
    assert (covered * cols).sum() / covered.sum() == pytest.approx(9.3, abs=0.06)
    assert (covered * rows).sum() / covered.sum() == pytest.approx(10.1, abs=0.06)


def test_a_picture_is_pressed_where_it_is_dark(tmp_path):
    image = pytest.importorskip('PIL.Image')
    path = tmp_path / 'plug.png'
    grey = np.full((80, 80), 255, np.uint8)
    grey[20:60, 30:50] = 0
    image.fromarray(grey).save(path)
    found = read_shape(str(path))
    assert (found.name, found.cells) == ('plug', 800)
    program = touch_program(load_layout('sim16x16.yaml'), (found,), (40.0,), hold=1.0, pause=0.5)
    values = program(1.0)
    assert values.sum() / values.max() == pytest.approx(40, rel=0.03)


@pytest.mark.parametrize('content', [b'', b'no picture', b'\x89PNG\r\n\x1a\n' + bytes(30)])
def test_a_file_that_is_not_a_picture_is_refused(tmp_path, content):
    path = tmp_path / 'plug.png'
    path.write_bytes(content)
    with pytest.raises(InputError):
        read_shape(str(path))


def test_an_empty_picture_and_an_unknown_name_are_refused(tmp_path):
    np.save(tmp_path / 'empty.npy', np.zeros((50, 50), bool))
    with pytest.raises(InputError):
        read_shape(str(tmp_path / 'empty.npy'))
    with pytest.raises(InputError):
        read_shape('dodecahedron')
