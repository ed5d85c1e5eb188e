"""The soil beside what others published: their formulas by hand, the fitted soil near them, gravity that scales."""

import math
from dataclasses import replace

import numpy as np
import pytest

from polarsim.rover.soil.law import read_soil
from tests.reference.soil_limit import steady_wheel
from tests.reference.soil_published import (
    EARTH,
    EX1_LOAD,
    EX1_WHEEL,
    MOON,
    TILT_BED,
    TREC,
    Trial,
    ex1_misses,
    misses_deg,
    sinkage_of_slip_mm,
    slip_of_slope,
    slip_on_slope,
)
from tests.rover.conftest import SOILS


def test_the_formulas_give_what_they_give_by_hand():
    assert slip_of_slope(0.0, 0.1) == pytest.approx(0.02825)
    assert slip_of_slope(10.0, 0.1) == pytest.approx(0.02825 + 0.1572)
    assert sinkage_of_slip_mm(0.5) == pytest.approx(16.78 + 3.11)


def test_a_wheel_climbs_at_the_slip_at_which_it_pulls_its_weight_downhill():
    law = read_soil(SOILS, "ex1-silica-5").law()
    slip = slip_on_slope(EX1_WHEEL, law, EX1_LOAD, 12.0)
    slope = math.radians(12.0)
    pull = steady_wheel(EX1_WHEEL, law, EX1_LOAD * math.cos(slope), slip).pull
    assert pull == pytest.approx(EX1_LOAD * math.sin(slope), abs=1e-3)
    assert math.isnan(slip_on_slope(EX1_WHEEL, law, EX1_LOAD, 60.0))


def test_the_fitted_soil_slips_and_sinks_about_as_ex1_did():
    slips, sinkages = ex1_misses(read_soil(SOILS, "ex1-silica-5").law())
    assert np.sqrt(np.mean(slips**2)) < 0.07
    assert np.sqrt(np.mean(sinkages**2)) < 1.1  # mm


@pytest.mark.parametrize(("curve", "soil", "within_deg"), [(TREC, "trec-grc3", 3.0), (TILT_BED, "mgru3-tilt-bed", 1.5)])
def test_fitted_soils_pull_as_nasa_measured(curve, soil, within_deg):
    misses = misses_deg(curve, read_soil(SOILS, soil).law())
    assert np.sqrt((misses**2).mean()) < within_deg


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
