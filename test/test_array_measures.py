"""bench/measure_arrays.py: each quantity of an array is found where it was put in."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from bench import measure_arrays
from bench.recognition.array_measures import Group, alike, by_place, fixed_part, measure, measure_over_time, residual

RNG = np.random.default_rng(29)
WHOLE = np.ones((20, 20), bool)


@pytest.mark.parametrize(('gain', 'speckle'), [(0.0, 0.3), (0.2, 0.3), (0.4, 0.2)])
def test_gain_and_speckle_are_found_apart(gain, speckle):
    fixed = gain * RNG.standard_normal(WHOLE.shape)
    frames = [100 * np.exp(fixed + speckle * RNG.standard_normal(WHOLE.shape)) for _ in range(60)]
    found = fixed_part(by_place([residual(frame, WHOLE, np.inf) for frame in frames]))
    assert found == pytest.approx((gain, speckle), abs=0.05)


def test_smooth_speckle_is_alike_and_saturated_taxels_are_left_out():
    rough = [residual(np.exp(RNG.standard_normal(WHOLE.shape)), WHOLE, np.inf) for _ in range(20)]
    wide = [residual(np.exp(gaussian_filter(RNG.standard_normal(WHOLE.shape), 1.2)), WHOLE, np.inf) for _ in range(20)]
    assert alike(rough, 1) < 0 < 0.4 < alike(wide, 1)
    assert np.isnan(residual(np.full(WHOLE.shape, 255.0), WHOLE, 255)).all()


def test_rims_bars_edges_and_rings_are_counted():
    rim, bar, disc = np.zeros((3, 16, 16))
    rim[3:12, 3:12] = bar[6:9] = disc[4:10, 4:10] = 100
    rim[5:10, 5:10] = 0
    bar[5] = 20
    found = measure([Group([rim, bar, disc, disc], 255)])
    assert found['hollow: encloses 2 taxels or more'] == '25 %' and found['bars: longer than 3:1'] == '25 %'
    assert found['touch 0 / 1 / 2 or more edges'] == '75 % / 0.0 % / 25 %'
    assert found['first / second ring around'].endswith('/ 0.0 %')


def test_growth_and_remains_of_a_weight_are_found():
    seconds = np.arange(0, 30, 1 / 30)
    load = np.where((seconds > 5) & (seconds < 20), 1 + 0.02 * (seconds - 5), 0.1 * (seconds >= 20))
    stamped = {weight: weight ** 2 * load[:, None, None] * np.pad(np.ones((1, 3, 3)), ((0, 0), (5, 5), (1, 2)))
               for weight in (200.0, 400.0)}
    rest = [40 + 2 * RNG.standard_normal((300, 13, 6)) for _ in range(6)]
    found = measure_over_time(rest, stamped)
    assert found['growth under a constant weight, from 1 s to its end'].startswith('1.24 x (2 ')
    assert found['reads 1 to 2 s after the weight is gone'] == '7.9 %'
    assert found['sum of the readings'] == 'weight to the power 2.00'
    assert float(found['noise at rest [counts of 4095]'].split()[0]) == pytest.approx(2, abs=0.1)


def test_one_line_says_what_is_not_there(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr('sys.argv', ['measure_arrays.py', '--weiss', str(tmp_path)])
    monkeypatch.setattr(measure_arrays, 'DRAWN', 20)
    assert measure_arrays.main() == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if 'not measured' in line]
    assert [line.split(':')[0] for line in lines] == list(measure_arrays.PLACES)
