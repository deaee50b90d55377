"""The physical generator against closed forms: Boussinesq, Love, flat punch, Hertz, Sneddon, and exact symmetries.

Contact modulus E* = 1 throughout. Tolerances are those of the grids, a few cells per cent.
"""

from dataclasses import replace

import numpy as np
import pytest

from bench.recognition import mechanics as reported
from tactile_node.simulator.world import CLASSES, Purpose, generator, random_contact
from training.ground_truth.contact_solver import press
from training.ground_truth.half_space import displacement_influence, stress_influence
from training.ground_truth.indenters import ball, cone, cylinder, flat_punch, inscribed_radius
from training.ground_truth.layer import measured, sample, stress_field
from training.ground_truth.mechanics import solve
from training.mechanics import PRESSURE, contact_shift, draw_mechanics, random_solution, solution_pool
from training.samples import LABELS


def centred(count, cell):
    """x, y and r of ``count`` × ``count`` cells about the origin."""
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


# Influence: point loads, uniform loads, the sum over cells

def test_far_from_a_cell_the_surface_bends_as_under_a_point_load():
    bend, load = displacement_influence((1, 41), cell=0.1), np.zeros((1, 41))
    load[0, 0] = 1 / 0.1 ** 2
    distance = np.arange(41)[20:] * 0.1
    assert bend(load)[0, 20:] == pytest.approx(1 / (np.pi * distance), rel=1e-3)


@pytest.mark.parametrize('count', [1, 9, 33])
def test_the_middle_of_a_uniformly_loaded_square_sinks_as_love_says(count):
    sunk = displacement_influence((count, count), cell=2 / count)(np.ones((count, count)))
    assert sunk[count // 2, count // 2] == pytest.approx(2 * 4 / np.pi * np.log(1 + np.sqrt(2)), rel=1e-9)


def test_hertz_pressure_bends_the_surface_to_a_paraboloid():
    x, y, r = centred(101, 0.02)
    bend = displacement_influence(r.shape, 0.02)
    sunk = bend(np.sqrt(np.maximum(1 - r ** 2, 0)))
    assert sunk[r < 0.9] == pytest.approx((np.pi / 4 * (2 - r ** 2))[r < 0.9], rel=2e-3)


@pytest.mark.parametrize('depth', [0.3, 1.0, 2.5])
def test_a_small_cell_stresses_the_depth_as_a_point_load_by_boussinesq(depth):
    cell, margin = 0.02, 120
    stress = stress_influence((1, 1), cell, depth, margin)(np.ones((1, 1)))
    _, _, r = centred(2 * margin + 1, cell)
    expected = 3 * depth ** 3 / (2 * np.pi * (r ** 2 + depth ** 2) ** 2.5) * cell ** 2
    assert stress == pytest.approx(expected, rel=5e-3, abs=1e-12)


@pytest.mark.parametrize('depth', [0.1, 0.5, 1.0, 3.0])
def test_under_a_uniform_circle_the_axis_has_its_closed_form(depth):
    _, _, r = centred(161, 2 / 160)
    stress = stress_influence(r.shape, 2 / 160, depth)((r <= 1).astype(float))
    assert stress[80, 80] == pytest.approx(1 - depth ** 3 / (1 + depth ** 2) ** 1.5, rel=4e-3)


@pytest.mark.parametrize('margin', [0, 3])
def test_the_transform_sums_the_cells_without_wrapping_around(margin):
    """Against the sum cell by cell of point loads, spread over 40×40 points of each cell."""
    shape, cell, depth = (3, 5), 0.5, 0.4
    pressure = generator(Purpose.TEST, 2).uniform(0, 1, shape)
    part = ((np.arange(40) + 0.5) / 40 - 0.5) * cell
    expected = np.zeros((shape[0] + 2 * margin, shape[1] + 2 * margin))
    for (row, col), _ in np.ndenumerate(expected):
        for (i, j), value in np.ndenumerate(pressure):
            down, across = (row - margin - i) * cell - part[:, np.newaxis], (col - margin - j) * cell - part
            kernel = 3 * depth ** 3 / (2 * np.pi * (down ** 2 + across ** 2 + depth ** 2) ** 2.5)
            expected[row, col] += value * kernel.mean() * cell ** 2
    assert stress_influence(shape, cell, depth, margin)(pressure) == pytest.approx(expected, rel=1e-3)


def test_no_stress_is_asked_at_the_surface():
    with pytest.raises(ValueError, match='depth 0.0: expected a positive depth'):
        stress_influence((3, 3), 1.0, depth=0.0)


# Contacts

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


@pytest.mark.parametrize('tilt', [0.3, 0.8])
def test_a_tilted_circular_punch_rises_by_its_tilt_over_the_radius(tilt):
    """p = P (1 + tilt x / a) / (2π a sqrt(a² - r²)): Johnson, Contact Mechanics, section 3.5."""
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


def test_a_circular_punch_tilted_beyond_its_limit_lifts_off():
    assert solve(punch('circle'), (0.95, 0.0)).filled > 0.98
    assert solve(punch('circle'), (1.6, 0.0)).filled < 0.93


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


def test_a_long_cylinder_follows_hertz_in_its_middle():
    """Plane strain for the load that the middle carries; its ends carry more than their share."""
    radius, half_width, cell = 1.0, 0.2, 0.0125
    y, x = (np.arange(48) - 23.5) * cell, np.arange(320) * cell
    load = np.pi * half_width ** 2 / (4 * radius) * x.size * cell
    found = press(np.repeat(y[:, np.newaxis] ** 2 / (2 * radius), x.size, 1), cell, load)
    middle = found.pressure[:, x.size // 2]
    carried = middle.sum() * cell
    peak, width = np.sqrt(carried / (np.pi * radius)), 2 * np.sqrt(carried * radius / np.pi)
    assert 0.7 < carried * x.size * cell / load < 1
    assert middle.max() == pytest.approx(peak, rel=3e-3)
    inside = np.abs(y) < 0.9 * width
    assert middle[inside] == pytest.approx(peak * np.sqrt(1 - (y[inside] / width) ** 2), rel=0.02)
    assert not middle[np.abs(y) > width + cell].any()


def test_a_cone_follows_sneddon():
    slope, cell = 0.1, 2.4 / 96
    _, _, r = centred(96, cell)
    found = press(slope * r, cell, load=np.pi * slope / 2)
    assert np.sqrt((found.pressure > 0).sum() * cell ** 2 / np.pi) == pytest.approx(1, rel=0.01)
    assert found.approach == pytest.approx(np.pi / 2 * slope, rel=2e-3)
    ring = (r > 0.15) & (r < 0.9)
    assert found.pressure[ring] == pytest.approx(slope / 2 * np.arccosh(1 / r[ring]), rel=0.02)


@pytest.mark.parametrize('indenter', [ball(0.03), ball(0.2), cone(0.03)], ids=['ball', 'stiffer ball', 'cone'])
def test_the_load_of_an_indenter_makes_its_nominal_area(indenter):
    assert solve(indenter).filled == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize('name', INDENTERS)
@pytest.mark.parametrize('tilt', [(0.0, 0.0), (0.5, -0.4)])
def test_where_pressure_is_there_is_no_gap(name, tilt):
    """Complementarity, with the gap computed again from the pressure: p >= 0, gap >= 0, p gap = 0."""
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


def test_a_rounded_edge_carries_less_pressure_than_a_sharp_one_and_its_contact_lies_inside_the_silhouette():
    for shape in CLASSES:
        sharp, rounded = solve(punch(shape)), solve(punch(shape, rounding=0.3))
        assert rounded.pressure.max() < 0.75 * sharp.pressure.max()
        assert 0.6 < rounded.filled < sharp.filled


def test_a_softer_skin_wraps_more_of_a_rounded_edge():
    filled = [solve(punch('square', rounding=0.3, compression=c)).filled for c in (0.005, 0.02, 0.1, 0.3)]
    assert filled == sorted(filled) and filled[-1] - filled[0] > 0.1


def test_no_indenter_is_an_error():
    with pytest.raises(ValueError, match='no cell'):
        press(np.full((4, 4), np.inf), 1.0, load=1.0)


def test_the_inscribed_circle_touches_the_sides():
    for shape in CLASSES:
        contact = random_contact(generator(Purpose.TEST, 5), shape, 300.0)
        y, x = np.indices((120, 120)) / 2 - 12
        assert contact.depth(x, y).max() == pytest.approx(inscribed_radius(contact), abs=0.4)


def test_solutions_are_read_only():
    solution = solve(ball(0.05), cells=12)
    for array in (solution.pressure, solution.outline, stress_field(solution, 20, 0.5).stress):
        with pytest.raises(ValueError, match='read-only'):
            array[0, 0] = 1


# Taxel frames

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


@pytest.mark.parametrize('depth', [1.0, 4.0, 12.0])
def test_below_the_middle_of_a_ball_and_of_a_punch_the_stress_has_its_closed_form(depth):
    """Hertz: p0 / (1 + ζ²); flat punch: (1 + 3ζ²) / (1 + ζ²)² / 2, of the mean pressure, ζ = z / a."""
    area = 300.0
    ratio = depth ** 2 * np.pi / area
    for indenter, expected in ((ball(0.05), 1.5 / (1 + ratio)),
                               (punch('circle'), (1 + 3 * ratio) / (1 + ratio) ** 2 / 2)):
        frame = sample(stress_field(solve(indenter, cells=72), area, depth), 20, 20, 0.3, rows=41, cols=41)
        assert frame[20, 20] == pytest.approx(expected, rel=0.015)


def test_a_contact_four_times_as_large_with_taxels_taken_by_four_is_the_same():
    solution = solve(punch('right_triangle', rounding=0.2), (0.2, 0.1))
    small = sample(stress_field(solution, 20, 0.5), 8.2, 7.9, 0.7, rows=16, cols=16)
    large = sample(stress_field(solution, 80, 1.0), 16.9, 16.3, 0.7, rows=32, cols=32)
    assert large.reshape(16, 2, 16, 2).mean((1, 3)) == pytest.approx(small, abs=0.015)


@pytest.mark.parametrize('name', ['right_triangle', 'isosceles_triangle, rounded', 'cylinder'])
def test_a_quarter_turn_of_the_contact_turns_the_frame(name):
    field = stress_field(solve(INDENTERS[name], (0.4, 0.1)), 40, 0.5)
    frame = sample(field, 11.0, 11.0, 0.3, rows=23, cols=23)
    turned = sample(field, 11.0, 11.0, 0.3 + np.pi / 2, rows=23, cols=23)
    assert turned == pytest.approx(np.rot90(frame, -1), abs=1e-9)


@pytest.mark.parametrize('shape', CLASSES)
def test_a_stiff_sharp_punch_presses_inside_its_outline(shape):
    solution = solve(punch(shape))
    frame = sample(stress_field(solution, 60, 0.15), 17.3, 16.6, 1.1, rows=36, cols=36)
    contact = replace(random_contact(generator(Purpose.TEST, 1), shape, 1.0), x=17.3, y=16.6, angle=1.1)
    lengths = tuple(np.array(contact.dimensions[:2]) * np.sqrt(60))
    contact = replace(contact, dimensions=lengths + contact.dimensions[2:])
    y, x = np.indices(frame.shape, float)
    depth = contact.depth(x, y)
    assert frame[depth < -1.2].max() < 0.06
    assert frame[depth > 0.8].min() > 0.4


def test_a_taxel_is_the_mean_of_its_four_quarters():
    field = stress_field(solve(punch('square')), 49, 0.3)
    quarters = [sample(field, 10.3 + dx, 10.1 + dy, 0.4, 21, 21, aperture=0.5)
                for dx in (-0.25, 0.25) for dy in (-0.25, 0.25)]
    assert sample(field, 10.3, 10.1, 0.4, 21, 21) == pytest.approx(np.mean(quarters, axis=0), abs=0.015)


def test_a_skin_saturates_and_has_dead_taxels_without_a_value():
    stress = np.full((200, 200), 0.5)
    stress[:100] = 3.0
    values = measured(stress, 0.6, generator(Purpose.TEST, 3), noise=0.02, dead=0.05)
    assert np.isnan(values).mean() == pytest.approx(0.05, abs=0.006)
    assert (values[:100][~np.isnan(values[:100])] == 1).all()
    lower = values[100:][~np.isnan(values[100:])]
    assert (lower.mean(), lower.std()) == pytest.approx((0.3, 0.02), abs=0.001)


# The pools of training and report

@pytest.fixture(scope='module')
def pool(tmp_path_factory):
    folder = tmp_path_factory.mktemp('mechanics')
    return folder, solution_pool(folder, count=15, seed=4, purpose=Purpose.TEST)


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


def test_no_contact_of_a_pool_has_been_tilted_off(pool):
    for solution in pool[1]:
        assert contact_shift(solution) < 0.1
        assert solution.pressure[solution.contact].mean() == pytest.approx(1, rel=1e-5)


@pytest.mark.parametrize('on_off', [False, True])
def test_training_frames_show_their_contact(pool, on_off):
    drawn = draw_mechanics(generator(Purpose.TEST, 6), 202, on_off, pool[1], areas=(20, 60))
    assert len(drawn.frames) == len(drawn.labels) == len(drawn.areas) == 202
    assert set(drawn.labels) <= {LABELS.index(name) for name in CLASSES} and len(set(drawn.labels)) == 5
    if on_off:
        assert 0.6 < np.median([np.nansum(frame) / area for frame, area in zip(drawn.frames, drawn.areas)]) < 1.3
    for frame, area, pressure in zip(drawn.frames, drawn.areas, drawn.pressures):
        assert 20 <= area <= 60
        known = frame[~np.isnan(frame)]
        assert 0.85 < known.size / frame.size
        if on_off:
            assert set(known) <= {0, 1} and known.sum() < 2.5 * area
        else:
            assert known.max() <= 1 and PRESSURE[0] <= pressure <= PRESSURE[1]
            assert known.sum() < (1.02 * area + 0.1 * np.sqrt(frame.size)) * pressure + 0.1 * np.sqrt(frame.size)


def test_frames_are_drawn_again_alike(pool):
    first, second = (draw_mechanics(generator(Purpose.TEST, 7), 9, False, pool[1]) for _ in range(2))
    for one, other in zip(first.frames, second.frames):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize('row', reported.ROWS)
def test_reported_frames_hold_the_load_of_their_contact_within_their_outline(row):
    case = reported.ROWS[row](25.0, 10, 1)
    assert case.frames.shape == (10, 16, 16)
    for frame, pressed in zip(case.frames, case.pressed):
        alive = ~np.isnan(frame)
        low, high = pressed.outline.min(0), pressed.outline.max(0)
        assert (low > -1).all() and (high < 16).all()
        weights = np.where(alive, np.maximum(frame - 0.05, 0), 0)
        row_, col = np.indices(frame.shape)
        centre = np.array([(weights * col).sum(), (weights * row_).sum()]) / weights.sum()
        assert (low < centre).all() and (centre < high).all()
        assert np.nansum(frame) < 1.05 * (25 * pressed.pressure) + 3 * 16 * reported.NOISE


def test_the_reported_flat_punches_show_every_class_and_the_rows_what_they_are():
    assert sorted(reported.flat_punch_frames(12, 10, 2).labels) == sorted(2 * [LABELS.index(name) for name in CLASSES])
    for row, label in (('balls', 'circle'), ('cones', 'circle'), ('cylinders on their side', 'rectangle')):
        assert set(reported.ROWS[row](12, 2, 2).labels) == {LABELS.index(label)}
