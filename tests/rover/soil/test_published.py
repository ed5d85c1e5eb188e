"""The soil beside what others published: their formulas by hand, the fitted soil near them, gravity that scales."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from polarsim.rover.soil import bulldozing, published
from polarsim.rover.soil.bulldozing_numba import settle
from polarsim.rover.soil.law import read_soil
from polarsim.rover.soil.limit import steady_wheel
from polarsim.rover.soil.nodes import make_ground
from polarsim.rover.soil.published import EARTH, EX1_LOAD, EX1_WHEEL, MOON, SINKING_SLIPS, SLOPES_DEG, Trial

SOILS = Path(__file__).parents[3] / "config" / "soils.csv"


def test_the_formulas_give_what_they_give_by_hand():
    assert published.slip_of_slope(0.0, 0.1) == pytest.approx(0.02825)
    assert published.slip_of_slope(10.0, 0.1) == pytest.approx(0.02825 + 0.1572)
    assert published.sinkage_of_slip_mm(0.5) == pytest.approx(16.78 + 3.11)


def test_a_wheel_climbs_at_the_slip_at_which_it_pulls_its_weight_downhill():
    law = read_soil(SOILS, "ex1-silica-5").law()
    slip = published.slip_on_slope(EX1_WHEEL, law, EX1_LOAD, 12.0)
    slope = math.radians(12.0)
    pull = steady_wheel(EX1_WHEEL, law, EX1_LOAD * math.cos(slope), slip).pull
    assert pull == pytest.approx(EX1_LOAD * math.sin(slope), abs=1e-3)
    assert math.isnan(published.slip_on_slope(EX1_WHEEL, law, EX1_LOAD, 60.0))


def test_the_fitted_soil_slips_and_sinks_about_as_ex1_did():
    law = read_soil(SOILS, "ex1-silica-5").law()
    slips = [published.slip_on_slope(EX1_WHEEL, law, EX1_LOAD, slope) for slope in SLOPES_DEG]
    sinkages = [1000 * steady_wheel(EX1_WHEEL, law, EX1_LOAD, slip).sinkage for slip in SINKING_SLIPS]
    wanted = [published.slip_of_slope(slope) for slope in SLOPES_DEG]
    deep = [published.sinkage_of_slip_mm(slip) for slip in SINKING_SLIPS]
    assert np.sqrt(np.mean(np.subtract(slips, wanted) ** 2)) < 0.07
    assert np.sqrt(np.mean(np.subtract(sinkages, deep) ** 2)) < 1.1  # mm


@pytest.mark.parametrize("slip", [0.05, 0.4])
def test_power_on_earth_is_what_the_moon_says_by_the_scaling_laws(lunar, slip):
    moon, earth = Trial(MOON).numbers(lunar, slip), Trial(EARTH).numbers(lunar, slip)
    assert earth[0] == pytest.approx(moon[0])
    assert earth[1] == pytest.approx(moon[1], rel=1e-3)
    left_alone = Trial(EARTH, scaled=False).numbers(lunar, slip)
    assert abs(left_alone[1] / moon[1] - 1) > 0.02


def test_a_soil_whose_law_knows_no_length_scales_with_size_too(lunar):
    """Without cohesion and slip sinkage, and with K as long in proportion, half a wheel is a wheel."""
    plain = replace(lunar, c=0.0, K_c=0.0, n_slip=0.0, R=0.0)
    whole, half = Trial(MOON), Trial(MOON, size=0.5)
    short = replace(plain, K=plain.K / 2)
    assert half.numbers(short, 0.2)[1] == pytest.approx(whole.numbers(plain, 0.2)[1], rel=0.01)
    assert half.numbers(plain, 0.2)[1] < 0.9 * whole.numbers(plain, 0.2)[1]


@pytest.mark.parametrize("angle_deg", [25.0, 36.0])
def test_poured_soil_slides_to_its_angle_of_repose_in_eight_directions_and_none_is_lost(angle_deg):
    ground = published.heap(angle_deg)
    tangent, before = math.tan(math.radians(angle_deg)), ground.volume()
    assert published.steepest_between(ground) > 1.9 * tangent
    settle(ground, angle_deg, sweeps=50_000, still_m=1e-8)
    assert published.steepest_between(ground) < tangent * 1.0001
    assert published.steepest_plane(ground) < tangent / math.cos(math.pi / 8) * 1.001
    assert ground.volume() == pytest.approx(before, rel=1e-10)


def test_both_avalanches_are_one(lunar):
    grounds = [published.heap(30.0) for _ in range(2)]
    for own, ground in zip((bulldozing.settle, settle), grounds, strict=True):
        own(ground, 30.0, sweeps=50)
    np.testing.assert_allclose(grounds[0].state, grounds[1].state, atol=1e-12)


def test_steepest_slopes_are_those_of_a_tilted_plane():
    x, y = np.meshgrid(np.arange(6) * 0.02, np.arange(5) * 0.02)
    ground = make_ground(0.3 * x + 0.4 * y, 0.02)
    assert published.steepest_plane(ground) == pytest.approx(0.5)
    assert published.steepest_between(ground) == pytest.approx(0.7 / math.sqrt(2))
