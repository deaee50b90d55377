"""Tests for the smallest rectangle around a contact, lower bounds of truncated contacts, and hollow contacts."""

import numpy as np
import pytest

import tactile_node as tn
from tactile_node.errors import ConfigurationError, InputError
from tactile_node.simulator.figures import Skin, pressure_frame
from tactile_node.simulator.world import Contact
from training.ground_truth.seeds import Purpose, generator

SKIN = Skin(blur=0.4, noise=0.005)
PITCH = 0.004


def contact_of(touching, rows=16, cols=16, seed=0, skin=SKIN):
    return tn.find_contact(pressure_frame(touching, generator(Purpose.VALIDATION, seed), rows, cols, skin=skin))


def bar(length, width, tip, angle=0.0):
    """Return a bar that reaches from beyond the left edge of the pad to x = ``tip``."""
    along = np.array((np.cos(angle), np.sin(angle)))
    x, y = np.array((tip, 7.4)) - along * length / 2
    return Contact('rectangle', (length, width), x=float(x), y=float(y), angle=angle)


@pytest.mark.parametrize('angle', (0.0, 0.3, -0.5))
@pytest.mark.parametrize('width', (2.5, 4.0))
def test_a_bar_that_leaves_the_pad_has_a_bound_for_its_length_and_its_width(angle, width):
    contact = contact_of(bar(30, width, 11.0, angle))
    seen = 11.5 / np.cos(angle) + width * abs(np.tan(angle))
    fit, box = tn.fit_shape(contact, tn.Shape.RECTANGLE), tn.contact_box(contact)
    assert fit.is_bound == (True, False) and box.length_is_bound == (True, False)
    assert 0.85 * 11.5 < fit.dimensions[0] < 1.03 * seen and fit.dimensions[1] == pytest.approx(width, rel=0.05)
    assert np.ptp(fit.outline @ (np.cos(angle), np.sin(angle))) == pytest.approx(fit.dimensions[0], rel=0.01)
    # The fit reports the centre of the visible part.
    assert fit.centre[0] == pytest.approx(5.5 * np.cos(angle), abs=1.0)
    assert abs(box.lengths[1] - width) < 2 * box.lengths_sd[1]


@pytest.mark.parametrize(('shape', 'dimensions'), [('circle', (5.0,)), ('square', (8.0,))])
@pytest.mark.parametrize('x', np.arange(-1.5, 3.1, 0.5))
def test_a_bound_of_a_shape_that_the_edge_cuts_is_never_above_its_true_size(shape, dimensions, x):
    fit = tn.fit_shape(contact_of(Contact(shape, dimensions, x=float(x), y=7.3, angle=0.2)), tn.Shape(shape))
    assert fit.is_bound == (True,) and 0.5 * dimensions[0] < fit.dimensions[0] < 1.03 * dimensions[0]


def test_hidden_taxels_cut_a_bar_as_the_edge_does_and_a_dead_one_does_not():
    frame = pressure_frame(Contact('rectangle', (10, 3), x=7.5, y=7.6), generator(Purpose.VALIDATION, 0), 16, 16)
    frame[9, 7] = np.nan
    assert tn.contact_box(tn.find_contact(frame)).length_is_bound == (False, False)
    frame[4:12, 11:] = np.nan
    assert tn.contact_box(tn.find_contact(frame)).length_is_bound == (True, False)
    assert tn.fit_shape(tn.find_contact(frame), tn.Shape.RECTANGLE).is_bound == (True, False)


@pytest.mark.parametrize('angle', np.radians((-80, -30, 0, 20, 90)))
def test_a_box_has_the_bars_angle_and_a_round_contact_any(angle):
    box = tn.contact_box(contact_of(Contact('rectangle', (10, 3), x=7.4, y=7.6, angle=float(angle))), PITCH)
    away = (box.angle - angle + np.pi / 2) % np.pi - np.pi / 2
    assert abs(away) < 2 * box.angle_sd < 0.2 and -np.pi / 2 < box.angle <= np.pi / 2
    assert box.centre == pytest.approx((7.4 * PITCH, 7.6 * PITCH), abs=2 * box.centre_sd)
    assert tn.contact_box(contact_of(Contact('circle', (4.0,), x=7.4, y=7.6))).angle_sd > 0.35


def test_no_contact_has_no_box_and_wrong_arguments_are_refused():
    box = tn.contact_box(tn.find_contact(np.zeros((8, 8))))
    assert np.isnan((*box.centre, box.angle, *box.lengths, *box.lengths_sd)).all() and not box.hollow
    with pytest.raises(InputError):
        tn.contact_box(np.zeros((8, 8)))
    with pytest.raises(ConfigurationError):
        tn.contact_box(tn.find_contact(np.zeros((8, 8))), pitch=0.0)


def rim_of(solid, wall):
    class Rim:
        x, y, reach = solid.x, solid.y, solid.reach

        def depth(self, x, y):
            depth = solid.depth(x, y)
            return np.minimum(depth, wall - depth)
    return Rim()


@pytest.mark.parametrize('solid', (Contact('circle', (5.0,), x=9.3, y=9.1), Contact('square', (9.0,), 9.3, 9.1, 0.3),
                                   Contact('rectangle', (13.0, 8.0), 9.3, 9.1, 0.6)), ids=lambda solid: solid.shape)
def test_a_ring_and_a_frame_are_hollow(solid):
    frame = pressure_frame(rim_of(solid, 1.7), generator(Purpose.VALIDATION, 1), 20, 20, skin=SKIN)
    assert tn.contact_box(tn.find_contact(frame)).hollow
    assert tn.contact_box(tn.find_contact(frame > 30e3)).hollow
    assert not tn.contact_box(contact_of(solid, 20, 20)).hollow


def test_a_solid_contact_of_weak_and_dead_taxels_is_not_hollow():
    rng = generator(Purpose.VALIDATION, 2)
    for seed in range(40):
        frame = pressure_frame(Contact('circle', (5.0,), x=9.3, y=9.1), rng, 20, 20, skin=SKIN)
        frame *= rng.uniform(1 / 3, 1, frame.shape)
        frame[9, 7 + seed % 5] = 0  # One dead taxel.
        assert not tn.contact_box(tn.find_contact(frame)).hollow
    frame = np.pad(np.full((7, 7), 50e3), 3)
    frame[4:9, 4:9] = np.nan  # A taxel without a value may be pressed.
    assert not tn.contact_box(tn.find_contact(frame)).hollow
