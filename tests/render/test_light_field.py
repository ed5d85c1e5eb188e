"""Light field of a lamp: polynomial over the sand, and its use by lamps."""

from dataclasses import replace

import numpy as np
import pytest

from polarsim.geometry.light_field import POWERS, REACH_M, relative_irradiance, terms
from polarsim.render.lamps import Lamp, field_reach_m
from polarsim.site import polar
from tests.support.other_site import other_site

POINTS = np.array([[0.0, 0.0, 0.1], [1.0, -0.5, 0.0], [-1.9, 1.2, 0.3], [0.3, 1.9, -0.1]])
COEFFICIENTS = tuple(np.linspace(-0.4, 0.5, len(POWERS)).tolist())


def test_the_logarithm_is_a_cubic_polynomial_in_x_and_y():
    x, y = POINTS[:, 0] / REACH_M, POINTS[:, 1] / REACH_M
    expected = sum(c * x**i * y**j for c, (i, j) in zip(COEFFICIENTS, POWERS, strict=True))
    np.testing.assert_allclose(np.log(relative_irradiance(COEFFICIENTS, POINTS)), expected, atol=1e-12)
    np.testing.assert_allclose(terms(POINTS) @ COEFFICIENTS, expected, atol=1e-12)
    assert max(i + j for i, j in POWERS) == 3


def test_the_field_is_one_at_the_centre_and_constant_outside_the_sand():
    edge, outside = np.array([[2.0, -2.0, 0.0]]), np.array([[7.0, -9.0, 0.0]])
    assert relative_irradiance(COEFFICIENTS, POINTS)[0] == 1
    assert relative_irradiance(COEFFICIENTS, edge) == relative_irradiance(COEFFICIENTS, outside)


def test_the_precision_of_the_points_is_kept():
    single = relative_irradiance(COEFFICIENTS, POINTS.astype(np.float32))
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, relative_irradiance(COEFFICIENTS, POINTS), rtol=1e-6)


@pytest.mark.parametrize("falloff", [False, True])
def test_a_measured_field_multiplies_the_intensity_and_replaces_the_falloff(falloff):
    lamp = Lamp(np.array([3.5, 1.4, 0.7]), 2.5, light_field=COEFFICIENTS)
    to_lamp, irradiance = lamp.light_at(POINTS, falloff=falloff)
    np.testing.assert_allclose(to_lamp, lamp.position - POINTS)
    np.testing.assert_allclose(irradiance, 2.5 * relative_irradiance(COEFFICIENTS, POINTS))
    assert not np.allclose(irradiance, replace(lamp, light_field=()).light_at(POINTS, falloff=falloff)[1])


def test_a_field_with_a_wrong_number_of_coefficients_is_an_error():
    with pytest.raises(ValueError, match="coefficients"):
        relative_irradiance((1.0, 2.0), POINTS)


def test_the_reach_is_the_unit_of_the_coordinates():
    np.testing.assert_allclose(
        relative_irradiance(COEFFICIENTS, 1.5 * POINTS, 1.5 * REACH_M), relative_irradiance(COEFFICIENTS, POINTS)
    )
    yard = other_site(sandbox={"half_width_m": [1.5, 3.0]})
    assert (field_reach_m(polar()), field_reach_m(yard)) == (2.0, 3.0)
    end = np.array([[0.0, 3.0, 0.0], [0.0, 2.0, 0.0]])
    lamp = Lamp(np.array([3.5, 1.4, 0.7]), light_field=COEFFICIENTS, field_reach_m=3.0)
    irradiance = lamp.light_at(end, falloff=True)[1]
    assert irradiance[0] != irradiance[1]
