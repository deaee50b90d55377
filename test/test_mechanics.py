"""Check the physical generator against closed-form solutions and exact symmetries.

The solutions are those of Boussinesq, Love, Hertz and Sneddon, and the solution for a flat punch.

All tests use the contact modulus E* = 1. The tolerances are the discretisation errors of the grids, which are a few per
cent.
"""

from dataclasses import replace

import numpy as np
import pytest

from tactile_node.simulator.world import CLASSES, random_contact
from training.ground_truth.contact_solver import press
from training.ground_truth.half_space import displacement_influence, stress_influence
from training.ground_truth.indenters import ball, cone, cylinder, flat_punch
from training.ground_truth.layer import measured, sample, stress_field
from training.ground_truth.mechanics import solve
from training.ground_truth.seeds import Purpose, generator
from training.mechanics import random_solution, solution_pool


def centred(count, cell):
    """Return x, y and r of the ``count`` × ``count`` cells around the origin."""
    line = (np.arange(count) - (count - 1) / 2) * cell
    x, y = np.meshgrid(line, line)
    return x, y, np.hypot(x, y)


def punch(shape, seed=1, rounding=0.0, compression=0.05):
    contact = random_contact(generator(Purpose.TEST, seed), shape, 1.0)
    return flat_punch(replace(contact, x=0.0, y=0.0, angle=0.0), compression, rounding)


INDENTERS = {**{shape: punch(shape) for shape in CLASSES},
             **{f'{shape}, rounded': punch(shape, rounding=0.3) for shape in CLASSES},
             'ball': ball(0.05), 'cone': cone(0.05), 'blunt cone': cone(0.05, tip=0.4),
             'cylinder': cylinder(0.05, ratio=2.5), 'cylinder, rounded': cylinder(0.05, ratio=2.0, rounding=0.3)}


# Influence coefficients for point loads, for uniform loads, and for the sum over cells.


@pytest.mark.parametrize('count', [1, 9, 33])
def test_the_middle_of_a_uniformly_loaded_square_sinks_as_love_says(count):
    sunk = displacement_influence((count, count), cell=2 / count)(np.ones((count, count)))
    assert sunk[count // 2, count // 2] == pytest.approx(2 * 4 / np.pi * np.log(1 + np.sqrt(2)), rel=1e-9)


@pytest.mark.parametrize('depth', [0.3, 1.0, 2.5])
def test_a_small_cell_stresses_the_depth_as_a_point_load_by_boussinesq(depth):
    cell, margin = 0.02, 60
    stress = stress_influence((1, 1), cell, depth, margin)(np.ones((1, 1)))
    _, _, r = centred(2 * margin + 1, cell)
    expected = 3 * depth ** 3 / (2 * np.pi * (r ** 2 + depth ** 2) ** 2.5) * cell ** 2
    assert stress == pytest.approx(expected, rel=5e-3, abs=1e-12)


# Contacts.

def test_a_flat_circular_punch_has_its_closed_form():
    cell = 2 / 64
    _, _, r = centred(64, cell)
    found = press(np.where(r <= 1, 0, np.inf), cell, load=0.3)
    inside = r < 0.85
    expected = 0.3 / (2 * np.pi * np.sqrt(1 - r[inside] ** 2))
    assert found.pressure[inside] == pytest.approx(expected, rel=0.015)
    assert found.approach == pytest.approx(0.3 / 2, rel=5e-3)
    assert found.pressure.sum() * cell ** 2 == pytest.approx(0.3, rel=1e-9)
    assert np.isinf(found.gap[r > 1]).all() and not found.pressure[r > 1].any()


def test_a_ball_follows_hertz():
    radius, load, cell = 10.0, 0.2, 0.05
    a = (3 * load * radius / 4) ** (1 / 3)
    _, _, r = centred(64, cell)
    found = press(r ** 2 / (2 * radius), cell, load)
    peak = 3 * load / (2 * np.pi * a ** 2)
    assert np.sqrt((found.pressure > 0).sum() * cell ** 2 / np.pi) == pytest.approx(a, rel=0.015)
    assert found.pressure.max() == pytest.approx(peak, rel=3e-3)
    assert found.approach == pytest.approx(a ** 2 / radius, rel=2e-3)
    inside = r < 0.9 * a
    assert np.abs(found.pressure - peak * np.sqrt(np.maximum(1 - (r / a) ** 2, 0)))[inside].max() < 0.01 * peak


@pytest.mark.parametrize('name', INDENTERS)
@pytest.mark.parametrize('tilt', [(0.0, 0.0), (0.5, -0.4)])
def test_there_is_no_gap_under_pressure(name, tilt):
    """The solution must satisfy the complementarity conditions p >= 0, gap >= 0 and p gap = 0.

    The test recomputes the gap from the pressure.
    """
    indenter, cell = INDENTERS[name], 1 / 32
    width, height = (int(round((high - low) / cell)) for low, high in zip(indenter.low, indenter.high))
    x = np.linspace(indenter.low[0], indenter.high[0], 2 * width + 1)[1::2]
    y = np.linspace(indenter.low[1], indenter.high[1], 2 * height + 1)[1::2, np.newaxis]
    undeformed = indenter.gap(x[np.newaxis], y) - 0.03 * (tilt[0] * x + tilt[1] * y)
    found = press(undeformed, cell, indenter.compression)
    distance = undeformed + displacement_influence(undeformed.shape, cell)(found.pressure)
    gap = distance - distance[found.pressure > 0].mean()
    least = 1e-4 * found.approach
    assert found.pressure.min() >= 0
    assert np.abs(gap[found.pressure > 0]).max() < least
    assert gap.min() > -least
    assert found.pressure.sum() * cell ** 2 == pytest.approx(indenter.compression, rel=1e-9)


# Taxel frames.

@pytest.mark.parametrize('name', INDENTERS)
@pytest.mark.parametrize('area, depth', [(12, 0.2), (25, 1.2), (100, 0.6)])
def test_the_taxels_carry_the_whole_load_and_balance_its_moment(name, area, depth):
    solution = solve(INDENTERS[name], (0.3, 0.2), cells=32)
    x, y, angle = 31.8, 29.4, 2.2
    frame = sample(stress_field(solution, area, depth), x, y, angle, rows=61, cols=63)
    assert frame.min() >= 0
    assert frame.sum() == pytest.approx(area, rel=5e-3)
    rows, cols = (origin + np.arange(count) * solution.cell
                  for origin, count in zip(solution.origin[::-1], solution.pressure.shape))
    share = solution.pressure / solution.pressure.sum()
    along, across = np.sqrt(area) * (share.sum(0) @ cols), np.sqrt(area) * (share.sum(1) @ rows)
    row, col = np.indices(frame.shape)
    assert (frame * col).sum() / frame.sum() == pytest.approx(
        x + np.cos(angle) * along - np.sin(angle) * across, abs=0.03)
    assert (frame * row).sum() / frame.sum() == pytest.approx(
        y + np.sin(angle) * along + np.cos(angle) * across, abs=0.03)


def test_a_skin_saturates_and_has_dead_taxels_without_a_value():
    stress = np.full((200, 200), 0.5)
    stress[:100] = 3.0
    values = measured(stress, 0.6, generator(Purpose.TEST, 3), noise=0.02, dead=0.05)
    assert np.isnan(values).mean() == pytest.approx(0.05, abs=0.006)
    assert (values[:100][~np.isnan(values[:100])] == 1).all()
    lower = values[100:][~np.isnan(values[100:])]
    assert (lower.mean(), lower.std()) == pytest.approx((0.3, 0.02), abs=0.001)


# Pools of solutions for training and for the reported figures.

@pytest.fixture(scope='module')
def pool(tmp_path_factory):
    folder = tmp_path_factory.mktemp('mechanics')
    return folder, solution_pool(folder, count=15, seed=4, purpose=Purpose.TEST)


@pytest.mark.slow
def test_a_pool_is_solved_once_and_read_again(pool):
    folder, solutions = pool
    written = [path.stat().st_mtime_ns for path in folder.iterdir()]
    again = solution_pool(folder, count=15, seed=4, purpose=Purpose.TEST)
    assert [path.stat().st_mtime_ns for path in folder.iterdir()] == written and len(written) == 1
    rng = generator(Purpose.TEST, 4)
    for k, (first, second) in enumerate(zip(solutions, again)):
        drawn = random_solution(rng, CLASSES[k % 5])
        assert (second.kind, second.label, second.tilt, second.origin) == (drawn.kind, drawn.label, drawn.tilt,
                                                                          drawn.origin)
        assert second.pressure == pytest.approx(drawn.pressure, rel=1e-6)
        assert (second.outline == drawn.outline).all() and (first.pressure == second.pressure).all()


def test_far_from_a_cell_the_surface_bends_as_under_a_point_load():
    bend, load = displacement_influence((1, 41), cell=0.1), np.zeros((1, 41))
    load[0, 0] = 1 / 0.1 ** 2
    distance = np.arange(41)[20:] * 0.1
    assert bend(load)[0, 20:] == pytest.approx(1 / (np.pi * distance), rel=1e-3)


def test_hertz_pressure_bends_the_surface_to_a_paraboloid():
    x, y, r = centred(101, 0.02)
    bend = displacement_influence(r.shape, 0.02)
    sunk = bend(np.sqrt(np.maximum(1 - r ** 2, 0)))
    assert sunk[r < 0.9] == pytest.approx((np.pi / 4 * (2 - r ** 2))[r < 0.9], rel=2e-3)


@pytest.mark.parametrize('depth', [0.1, 0.5, 1.0, 3.0])
def test_under_a_uniform_circle_the_axis_has_its_closed_form(depth):
    _, _, r = centred(161, 2 / 160)
    stress = stress_influence(r.shape, 2 / 160, depth)((r <= 1).astype(float))
    assert stress[80, 80] == pytest.approx(1 - depth ** 3 / (1 + depth ** 2) ** 1.5, rel=4e-3)


@pytest.mark.parametrize('tilt', [0.3, 0.8])
def test_a_tilted_circular_punch_rises_by_its_tilt_over_the_radius(tilt):
    """The pressure is p = P (1 + tilt x / a) / (2π a sqrt(a² - r²)) (Johnson, Contact Mechanics, section 3.5)."""
    indenter = punch('circle')
    solution = solve(indenter, (tilt, 0.0), cells=72)
    a = 1 / np.sqrt(np.pi)
    x, y = (origin + np.arange(count) * solution.cell for origin, count in
            zip(solution.origin, solution.pressure.shape[::-1]))
    r = np.hypot(x[np.newaxis], y[:, np.newaxis])
    expected = (1 + tilt * x / a) / (2 * np.sqrt(1 - np.minimum(r / a, 0.99) ** 2))
    inside = r < 0.8 * a
    assert np.abs(solution.pressure / expected - 1)[inside].max() < 0.035
    assert solution.filled == pytest.approx(1, abs=0.01)


def test_a_cone_follows_sneddon():
    slope, cell = 0.1, 2.4 / 96
    _, _, r = centred(96, cell)
    found = press(slope * r, cell, load=np.pi * slope / 2)
    assert np.sqrt((found.pressure > 0).sum() * cell ** 2 / np.pi) == pytest.approx(1, rel=0.01)
    assert found.approach == pytest.approx(np.pi / 2 * slope, rel=2e-3)
    ring = (r > 0.15) & (r < 0.9)
    assert found.pressure[ring] == pytest.approx(slope / 2 * np.arccosh(1 / r[ring]), rel=0.02)


@pytest.mark.parametrize('depth', [1.0, 4.0, 12.0])
def test_below_the_middle_of_a_ball_and_of_a_punch_the_stress_has_its_closed_form(depth):
    """With ζ = z / a, the stress is the mean pressure times a closed-form factor.

    For a Hertz contact, p0 is divided by 1 + ζ². For a flat punch, the factor is (1 + 3ζ²) / (1 + ζ²)² / 2.
    """
    area = 300.0
    ratio = depth ** 2 * np.pi / area
    for indenter, expected in ((ball(0.05), 1.5 / (1 + ratio)),
                               (punch('circle'), (1 + 3 * ratio) / (1 + ratio) ** 2 / 2)):
        frame = sample(stress_field(solve(indenter, cells=72), area, depth), 20, 20, 0.3, rows=41, cols=41)
        assert frame[20, 20] == pytest.approx(expected, rel=0.015)
