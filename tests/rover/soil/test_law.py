"""Soils by name, and scaling with gravity."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.errors import FormatError, RoverError
from polarsim.rover.soil.law import read_soil, read_soils
from tests.reference.soil_limit import steady_wheel
from tests.reference.soil_rig import WHEEL_A
from tests.rover.conftest import SOILS


def table_with(tmp_path: Path, line: str) -> Path:
    path = tmp_path / "soils.csv"
    path.write_text(SOILS.read_text().splitlines()[0] + "\n" + line + "\n")
    return path


def test_every_soil_has_a_source_and_a_gravity():
    soils = read_soils(SOILS)
    assert {"lunar", "chrono-demo", "trec-grc3", "mgru3-tilt-bed"} <= set(soils)
    assert all(soil.source and soil.gravity in (1.62, 9.81) for soil in soils.values())


@pytest.mark.parametrize(
    ("line", "key"),
    [
        (",1e6,0,1,0,0,30,0.01,2e8,0,9.81,somebody", "name"),
        ("mud,1e6,0,1,0,0,30,0.01,2e8,0,9.81,", "source"),
        ("mud,1e6,0,1,0,0,30,0.01,2e8,0,9.81, ", "source"),
        ("mud,1e6,0,1,0,0,30,0.01,2e8,0,,somebody", "gravity"),
        ("mud,-1e6,0,1,0,0,30,0.01,2e8,0,9.81,somebody", "K_phi"),
        ("mud,1e6,0,1,0,0,95,0.01,2e8,0,9.81,somebody", "phi_deg"),
        ("mud,1e6,0,1,0,0,30,0,2e8,0,9.81,somebody", "K"),
        ("mud,1e6,0,1,0,0,30,0.01,inf,0,9.81,somebody", "K_e"),
    ],
)
def test_the_error_of_an_invalid_soil_has_its_key(tmp_path, line, key):
    with pytest.raises(RoverError, match=key):
        read_soils(table_with(tmp_path, line))


def test_an_unknown_soil_and_a_missing_column_are_errors(tmp_path):
    with pytest.raises(RoverError) as error:
        read_soil(SOILS, "mud")
    assert error.value.path == SOILS
    (tmp_path / "soils.csv").write_text("name,K_phi\nmud,1e6\n")
    with pytest.raises(FormatError, match="K_c"):
        read_soils(tmp_path / "soils.csv")


@settings(max_examples=20, deadline=None)
@given(gravity=st.floats(0.5, 20), slip=st.floats(0, 0.7))
def test_sinkage_at_equal_mass_is_independent_of_gravity(gravity, slip):
    soil, mass = replace(read_soil(SOILS, "lunar"), K_e=4e9), 107.5
    on_moon = steady_wheel(WHEEL_A, soil.law(), mass * 1.62, slip)
    there = steady_wheel(WHEEL_A, soil.at_gravity(gravity).law(), mass * gravity, slip)
    assert there.sinkage == pytest.approx(on_moon.sinkage, rel=1e-6)
    assert there.pull / gravity == pytest.approx(on_moon.pull / 1.62, rel=1e-5, abs=1e-4)


@pytest.mark.parametrize("name", ["lunar", "hit-simulant"])
def test_a_smooth_rim_slides_at_two_thirds_of_the_friction_angle(name):
    soil = replace(read_soil(SOILS, name), n_slip=0.0)
    load, slips = 100.0, (0.1, 0.4, 0.9)
    grousers, smooth = (
        [steady_wheel(WHEEL_A, soil.law(smooth_rim=rim), load, slip) for slip in slips] for rim in (False, True)
    )
    assert all(sliding.pull < shearing.pull for sliding, shearing in zip(smooth, grousers, strict=True))
    limit = load * math.tan(math.radians(2 / 3 * soil.phi_deg))  # of a level surface
    assert max(wheel.pull for wheel in smooth) < limit < max(wheel.torque for wheel in grousers) / WHEEL_A.radius


def test_without_scaling_a_wheel_sinks_three_times_as_deep_on_earth():
    law = read_soil(SOILS, "lunar").law(slip_sinkage=False)
    ratio = (
        steady_wheel(WHEEL_A, law, 107.5 * 9.81, 0.03).sinkage / steady_wheel(WHEEL_A, law, 107.5 * 1.62, 0.03).sinkage
    )
    assert 2.9 < ratio < 3.5
