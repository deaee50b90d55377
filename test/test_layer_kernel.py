"""The layer's kernel against closed forms."""

import numpy as np
import pytest
from scipy.integrate import dblquad

from tactile_node.pose.layer_kernel import DEPTHS, REACH, kernel, taps_at


@pytest.mark.parametrize('depth', [0.3, 1.0, 2.0])
def test_far_away_a_pressed_taxel_is_a_point_force(depth):
    """Boussinesq: 3 z^3 / (2 pi (r^2 + z^2)^(5/2)), where a taxel is small: averages over two are 6 % larger."""
    far, z = 6.0, depth
    assert kernel(depth)[REACH, REACH + 6] == pytest.approx(
        3 * z ** 3 / (2 * np.pi * (far ** 2 + z ** 2) ** 2.5), rel=0.07)


def test_a_taxel_under_itself_feels_the_integral_over_both_squares():
    def under(y, x):
        """Of one point of the taxel, by integrating over what is pressed."""
        return dblquad(lambda v, u: 3 * 0.5 ** 3 / (2 * np.pi * ((u - x) ** 2 + (v - y) ** 2 + 0.25) ** 2.5),
                       -0.5, 0.5, -0.5, 0.5, epsabs=1e-6)[0]
    points = (np.arange(6) + 0.5) / 6 - 0.5
    assert kernel(0.5)[REACH, REACH] == pytest.approx(np.mean([under(y, x) for x in points for y in points]), abs=1e-4)


def test_a_wide_pressure_passes_through():
    """No force is lost but what a layer spreads beyond the reach of the kernel."""
    assert kernel(0.3).sum() == pytest.approx(1, abs=0.01)
    assert kernel(1.0).sum() == pytest.approx(1, abs=0.04)


@pytest.mark.parametrize('depth', np.geomspace(DEPTHS[0] * 1.05, DEPTHS[1] * 0.95, 9))
def test_two_products_are_the_kernel(depth):
    taps = taps_at(np.log(depth))
    apart = np.abs(np.arange(-REACH, REACH + 1))
    found = sum(sign * np.outer(tap[apart], tap[apart]) for sign, tap in zip(taps.signs[:, 0], taps.taps))
    assert found == pytest.approx(kernel(depth), abs=0.004)
