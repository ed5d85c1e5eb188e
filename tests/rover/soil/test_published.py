"""Soils compared with published measurements: formulas, fitted soils, and scaling with gravity."""

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


def test_formulas_equal_hand_calculations():
    assert slip_of_slope(0.0, 0.1) == pytest.approx(0.02825)
    assert slip_of_slope(10.0, 0.1) == pytest.approx(0.02825 + 0.1572)
    assert sinkage_of_slip_mm(0.5) == pytest.approx(16.78 + 3.11)


def test_a_wheel_climbs_at_the_slip_at_which_pull_equals_the_downhill_force():
    law = read_soil(SOILS, "ex1-silica-5").law()
    slip = slip_on_slope(EX1_WHEEL, law, EX1_LOAD, 12.0)
    slope = math.radians(12.0)
    pull = steady_wheel(EX1_WHEEL, law, EX1_LOAD * math.cos(slope), slip).pull
    assert pull == pytest.approx(EX1_LOAD * math.sin(slope), abs=1e-3)
    assert math.isnan(slip_on_slope(EX1_WHEEL, law, EX1_LOAD, 60.0))


def test_the_fitted_soil_has_the_slip_and_sinkage_of_ex1():
    slips, sinkages = ex1_misses(read_soil(SOILS, "ex1-silica-5").law())
    assert np.sqrt(np.mean(slips**2)) < 0.05
    assert np.sqrt(np.mean(sinkages**2)) < 1.0  # mm


@pytest.mark.parametrize(("curve", "soil", "within_deg"), [(TREC, "trec-grc3", 2.8), (TILT_BED, "mgru3-tilt-bed", 1.2)])
def test_fitted_soils_have_the_pull_measured_by_nasa(curve, soil, within_deg):
    misses = misses_deg(curve, read_soil(SOILS, soil).law())
    assert np.sqrt((misses**2).mean()) < within_deg


@pytest.mark.parametrize("slip", [0.05, 0.4])
def test_power_on_earth_and_moon_agrees_with_the_scaling_laws(lunar, slip):
    moon, earth = Trial(MOON).numbers(lunar, slip), Trial(EARTH).numbers(lunar, slip)
    assert earth[0] == pytest.approx(moon[0])
    assert earth[1] == pytest.approx(moon[1], rel=1e-3)
    unscaled = Trial(EARTH, scaled=False).numbers(lunar, slip)
    assert abs(unscaled[1] / moon[1] - 1) > 0.02


def test_a_soil_without_a_length_scale_also_scales_with_size(lunar):
    """Without cohesion and slip sinkage, and with K in proportion, a wheel of half the size behaves equally."""
    plain = replace(lunar, c=0.0, K_c=0.0, n_slip=0.0, R=0.0)
    whole, half = Trial(MOON), Trial(MOON, size=0.5)
    short = replace(plain, K=plain.K / 2)
    assert half.numbers(short, 0.2)[1] == pytest.approx(whole.numbers(plain, 0.2)[1], rel=0.01)
    assert half.numbers(plain, 0.2)[1] < 0.9 * whole.numbers(plain, 0.2)[1]
