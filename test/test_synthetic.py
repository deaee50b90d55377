"""The simulated shapes have the properties that their names promise."""

import numpy as np
import pytest

from tactile_node.simulator.figures import Skin, pressure_frame
from tactile_node.simulator.world import CLASSES, Contact, random_contact
from training.ground_truth.seeds import Purpose, generator


def polygon_area(vertices):
    x, y = vertices.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def angles(vertices):
    """Return the sorted inner angles of a polygon [degrees]."""
    before, after = np.roll(vertices, 1, 0) - vertices, np.roll(vertices, -1, 0) - vertices
    cosine = (before * after).sum(1) / np.hypot(*before.T) / np.hypot(*after.T)
    return np.sort(np.degrees(np.arccos(cosine)))


def sides(vertices):
    return np.sort(np.hypot(*(np.roll(vertices, -1, 0) - vertices).T))


@pytest.mark.parametrize('shape', CLASSES)
def test_area_centre_and_pattern(shape):
    rng = generator(Purpose.TEST, 2)
    taxels = []
    for _ in range(200):
        contact = random_contact(rng, shape, 50)
        outline = contact.outline(400)
        assert polygon_area(outline) == pytest.approx(50, rel=1e-4)
        if shape != 'circle':
            assert contact.area == pytest.approx(50)
        if len(outline) == 3:
            np.testing.assert_allclose(outline.mean(0), (contact.x, contact.y))
        taxels.append(contact.pattern().sum())
        assert np.hypot(contact.x - 17.5, contact.y - 17.5) <= np.sqrt(0.5)
    # For centres at random positions, the mean number of taxels equals the area.
    assert np.mean(taxels) == pytest.approx(50, abs=4 * np.std(taxels) / np.sqrt(200) + 1e-9)


def test_shapes_stay_in_the_classes_of_the_benchmark():
    rng = generator(Purpose.TEST, 3)
    for _ in range(100):
        outlines = {shape: random_contact(rng, shape, 60).outline() for shape in CLASSES[1:]}
        np.testing.assert_allclose(angles(outlines['square']), 90)
        np.testing.assert_allclose(sides(outlines['square']), np.sqrt(60))
        np.testing.assert_allclose(angles(outlines['rectangle']), 90)
        assert 1.5 <= sides(outlines['rectangle'])[3] / sides(outlines['rectangle'])[0] <= 3
        assert angles(outlines['right_triangle'])[2] == pytest.approx(90)
        legs = sides(outlines['right_triangle'])[:2]
        assert 1.5 <= legs[1] / legs[0] <= 2.5
        corners = angles(outlines['isosceles_triangle'])
        apex = [a for a in corners if np.isclose(corners, a).sum() == 1 or np.allclose(corners, 60)]
        assert 40 <= apex[0] <= 75 and np.isclose(np.diff(corners), 0).any()


def test_taxel_is_active_when_its_centre_is_inside():
    mask = Contact('rectangle', (4.2, 2.2), x=5.0, y=3.0).pattern(8, 12)
    expected = np.zeros((8, 12), bool)
    expected[2:5, 3:8] = True
    np.testing.assert_array_equal(mask, expected)


def test_pressure_frame():
    contact, rng = Contact('square', (6.0,), x=7.5, y=7.5), generator(Purpose.TEST, 6)
    plain = pressure_frame(contact, rng, 16, 16, pressure=0.25, skin=Skin(full_scale=80_000))
    assert plain.max() == 20_000 and plain.sum() == pytest.approx(36 * 20_000)
    tilted = pressure_frame(contact, rng, 16, 16, tilt=(0.1, 0.0))
    assert (np.diff(tilted[7, 5:11]) > 0).all() and tilted[5, 7] == tilted[10, 7]
    blurred = pressure_frame(contact, rng, 16, 16, skin=Skin(blur=0.5))
    assert blurred.sum() == pytest.approx(36 * 50_000, rel=1e-6) and (blurred > 0).sum() > 36
    faulty = pressure_frame(None, rng, 100, 100, skin=Skin(noise=0.01, dead=0.03))
    assert np.isnan(faulty).mean() == pytest.approx(0.03, abs=0.007)
    assert np.nanstd(faulty) == pytest.approx(1000, rel=0.05)
