"""Soils by name, and what gravity makes of them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.errors import FormatError, RoverError
from polarsim.rover.limit import steady_wheel
from polarsim.rover.measured import TILT_BED, TREC, rms_deg
from polarsim.rover.shapes import Wheel
from polarsim.rover.soil import read_soil, read_soils

SOILS = Path(__file__).parents[2] / "config" / "soils.csv"
WHEEL_A, WHEEL_B = Wheel(0.25, 0.20), Wheel(0.15735, 0.165)

# Prototype integrals made for this project before the code: slip, sinkage mm, pull N, torque N m.
LIMIT_A = [(0, 17.11, -12.9, 2.86), (0.05, 17.00, 3.5, 6.91), (0.2, 16.71, 42.7, 16.60), (0.8, 16.17, 91.5, 28.66)]
LIMIT_B = [(0, 9.02, -6.8, 0.51), (0.1, 8.94, 4.4, 2.25), (0.6, 8.67, 35.9, 7.17)]
TERRAIN_A = [(0, 17.21, -12.0, 3.02), (0.2, 17.21, 58.1, 20.37), (0.6, 17.21, 118.3, 35.18)]
TERRAIN_B = [(0, 9.04, -3.3, 1.03), (0.4, 9.04, 38.6, 7.57)]


def table_with(tmp_path: Path, line: str) -> Path:
    path = tmp_path / "soils.csv"
    path.write_text(SOILS.read_text().splitlines()[0] + "\n" + line + "\n")
    return path


def test_every_soil_has_a_source_and_a_gravity():
    soils = read_soils(SOILS)
    assert {"lunar", "chrono-demo", "trec-grc3", "mgru3-tilt-bed"} <= set(soils)
    assert all(soil.source and soil.gravity in (1.62, 9.81) for soil in soils.values())


def test_an_unnamed_set_is_refused():
    with pytest.raises(RoverError, match=r"soils\.csv: no soil 'mud', there are "):
        read_soil(SOILS, "mud")


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (",1e6,0,1,0,0,30,0.01,2e8,0,9.81,somebody", "without a name"),
        ("mud,1e6,0,1,0,0,30,0.01,2e8,0,9.81,", "has no source"),
        ("mud,1e6,0,1,0,0,30,0.01,2e8,0,,somebody", "gravity is nan, a number was expected"),
        ("mud,-1e6,0,1,0,0,30,0.01,2e8,0,9.81,somebody", "K_phi is -1e\\+06"),
        ("mud,1e6,0,1,0,0,95,0.01,2e8,0,9.81,somebody", "phi_deg is 95"),
        ("mud,1e6,0,1,0,0,30,0,2e8,0,9.81,somebody", "K is 0"),
    ],
)
def test_a_set_that_is_no_soil_is_refused_with_its_reason(tmp_path, line, reason):
    with pytest.raises(RoverError, match=reason):
        read_soils(table_with(tmp_path, line))


def test_a_table_without_sources_is_no_table_of_soils(tmp_path):
    path = tmp_path / "soils.csv"
    path.write_text("name,K_phi\nmud,1e6\n")
    with pytest.raises(FormatError, match="K_c"):
        read_soils(path)


@settings(max_examples=20, deadline=None)
@given(gravity=st.floats(0.5, 20), slip=st.floats(0, 0.7))
def test_a_wheel_of_equal_mass_sinks_equally_deep_at_any_gravity(gravity, slip):
    soil, mass = replace(read_soil(SOILS, "lunar"), K_e=4e9), 107.5
    on_moon = steady_wheel(WHEEL_A, soil.law(), mass * 1.62, slip)
    there = steady_wheel(WHEEL_A, soil.at_gravity(gravity).law(), mass * gravity, slip)
    assert there.sinkage == pytest.approx(on_moon.sinkage, rel=1e-6)
    assert there.pull / gravity == pytest.approx(on_moon.pull / 1.62, rel=1e-5, abs=1e-4)


def test_constants_left_alone_let_a_wheel_sink_three_times_as_deep_on_earth():
    law = read_soil(SOILS, "lunar").law(slip_sinkage=False)
    ratio = (
        steady_wheel(WHEEL_A, law, 107.5 * 9.81, 0.03).sinkage / steady_wheel(WHEEL_A, law, 107.5 * 1.62, 0.03).sinkage
    )
    assert 2.9 < ratio < 3.5


@pytest.mark.parametrize(
    ("name", "wheel", "load", "terrain", "rows"),
    [
        ("lunar", WHEEL_A, 174.15, False, LIMIT_A),
        ("hit-simulant", WHEEL_B, 80, False, LIMIT_B),
        ("lunar", WHEEL_A, 174.15, True, TERRAIN_A),
        ("hit-simulant", WHEEL_B, 80, True, TERRAIN_B),
    ],
)
def test_the_limit_is_the_one_that_was_worked_out_apart(name, wheel, load, terrain, rows):
    law = read_soil(SOILS, name).law(slip_sinkage=False)
    for slip, sinkage_mm, pull, torque in rows:
        found = steady_wheel(wheel, law, load, slip, terrain)
        # The prototype rounded to 0.01 mm, 0.1 N, 0.01 N m.
        np.testing.assert_allclose(
            [1000 * found.sinkage, found.pull, found.torque], [sinkage_mm, pull, torque], atol=0.06, rtol=1e-3
        )


def test_a_wheel_on_earth_meets_the_limit_that_was_worked_out_apart():
    law = read_soil(SOILS, "lunar").law(slip_sinkage=False)
    for slip, sinkage_mm, pull, torque in [(0.2, 53.8, 272, 132.5), (0.6, 52.3, 398, 162.5)]:
        found = steady_wheel(WHEEL_A, law, 1054.6, slip)
        np.testing.assert_allclose(
            [1000 * found.sinkage, found.pull, found.torque], [sinkage_mm, pull, torque], rtol=2e-3
        )


def test_slip_sinks_a_wheel_as_deep_as_measured():
    """Ding et al. (2010): 3 to 7 times the static sinkage at slip 0.6."""
    for name, wheel, load in (("lunar", WHEEL_A, 174.15), ("hit-simulant", WHEEL_B, 80)):
        law = read_soil(SOILS, name).law()
        factor = steady_wheel(wheel, law, load, 0.6).sinkage / steady_wheel(wheel, law, load, 0.0).sinkage
        assert 3 < factor < 7, name


def test_fitted_soils_pull_as_nasa_measured():
    assert rms_deg(TREC, read_soil(SOILS, "trec-grc3").law()) < 3.0
    assert rms_deg(TILT_BED, read_soil(SOILS, "mgru3-tilt-bed").law()) < 1.5


def test_a_soil_that_cannot_bear_a_load_says_so():
    with pytest.raises(RoverError, match="sinks to its axle"):
        steady_wheel(WHEEL_A, read_soil(SOILS, "lunar").law(), 1e5, 0.2)
