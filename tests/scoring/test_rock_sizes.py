"""Sizes of the rocks of a small terrain through the stage, the scoring and the report."""

import numpy as np
import pytest
from shapely import box
from shapely.affinity import rotate, translate

from polarsim.formats.files import read_json
from polarsim.formats.tables import read_csv, read_parquet
from polarsim.geometry.poses import Pose
from polarsim.report.rock_sizes import report_rock_sizes
from polarsim.rocks.sizes import ERRORS, measure_rocks, relative_errors
from polarsim.scoring.rock_sizes import find_true_sizes
from polarsim.site import polar

SANDBOX_FROM_TRUTH = Pose.from_rotvec(np.array([0, 0, 0.3]), np.array([0.05, -0.05, 0.02]))
ORIGIN = {"run": "here", "source": "analog", "config": "abc"}


@pytest.fixture
def measured(world, tmp_path):
    world.write(tmp_path / "truth")
    world.write(tmp_path / "run", SANDBOX_FROM_TRUTH, grown=0.005)
    folder = tmp_path / "run"
    measure_rocks(
        site=polar(),
        terrain=world.terrain,
        meshes=folder / "meshes",
        clouds=None,
        sizes=folder / "sizes.parquet",
        area=folder / "area.json",
    )
    find_true_sizes(
        site=polar(),
        terrain=world.terrain,
        sizes=folder / "sizes.parquet",
        rocks=folder / "rocks.parquet",
        located=folder / "cameras",
        truth=tmp_path / "truth",
        true_sizes=folder / "true.parquet",
    )
    return folder


def test_sizes_of_cubes_are_those_of_the_part_above_the_ground(measured):
    sizes = read_parquet(measured / "sizes.parquet").set_index("rock")
    side = 0.21  # rock 1, with its centre at a quarter of the true side above the datum
    assert sizes.loc[1, "length_m"] == pytest.approx(np.sqrt(2) * side, rel=0.01)
    assert (sizes["a_m"] >= sizes["b_m"]).all()
    assert sizes.loc[1, ["a_m", "b_m"]].tolist() == pytest.approx([side, side], rel=0.02)
    assert sizes.loc[1, "volume_m3"] == pytest.approx(side**2 * sizes.loc[1, "height_m"], rel=0.15)  # on a slope
    assert (sizes["made_from"] == "published").all()
    assert sizes[list(ERRORS)].isna().all(axis=None)  # errors are known for scans only
    # The sand, 4 m wide and turned, without the corners behind the walls, which end 2.1 m from the centre.
    turned = translate(rotate(box(-2, -2, 2, 2), 0.3, origin=(0, 0), use_radians=True), 0.05, -0.05)
    inside = turned.intersection(box(-2.1, -2.1, 2.1, 2.1)).area
    assert read_json(measured / "area.json")["area_m2"] == pytest.approx(inside, rel=0.005)


def test_true_sizes_belong_to_the_matched_rocks(measured):
    sizes = read_parquet(measured / "sizes.parquet").set_index("rock")
    true = read_parquet(measured / "true.parquet").set_index("rock")
    assert true["true_rock"].tolist() == [1, 2]
    difference = (
        sizes.loc[1, "length_m"]
        - true.loc[1, "true_diameter_m"] * sizes.loc[1, "length_m"] / sizes.loc[1, "diameter_m"]
    )
    assert difference == pytest.approx(np.sqrt(2) * 0.01, abs=0.002)  # grown by 5 mm on all sides
    np.testing.assert_allclose(true.loc[1, ["whole_a_m", "whole_b_m", "whole_c_m"]].astype(float), 0.2, atol=1e-3)
    assert true.loc[1, "true_c_m"] < 0.17  # a quarter is buried


@pytest.mark.parametrize("truth", [True, False])
def test_the_report_has_tables_and_figure(measured, truth, tmp_path):
    report_rock_sizes(
        sizes={3: measured / "sizes.parquet"},
        areas={3: measured / "area.json"},
        true_sizes={3: measured / "true.parquet"} if truth else {},
        table=tmp_path / "rock_sizes",
        abundance=tmp_path / "rock_abundance",
        figure=tmp_path / "rock_sizes.png",
        origin=ORIGIN,
    )
    abundance = read_csv(tmp_path / "rock_abundance.csv").iloc[0]
    assert (abundance["rocks"], abundance["source"]) == (2, "analog")  # diagonals of 30 and 10 cm
    assert abundance["k_low"] < abundance["k"] < abundance["k_high"]
    shown = (tmp_path / "rock_sizes.md").read_text()
    assert ("true\\_a\\_m" in shown) == ("n = 1: a" in shown) == truth
    assert (tmp_path / "rock_sizes.png").stat().st_size > 10_000


def test_expected_errors_depend_on_the_size_class():
    small, large = relative_errors(0.05), relative_errors(0.2)
    assert small["c_error_m"] > large["c_error_m"] > 0
