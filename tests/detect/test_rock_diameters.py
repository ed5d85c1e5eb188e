"""Diameters and positions of rocks from boxes alone, on level ground."""

import numpy as np
import pandas as pd
import pytest

from polarsim.detect.rock_diameters import COLUMNS, measure_diameters
from polarsim.errors import DetectError
from polarsim.formats.files import write_json
from polarsim.formats.tables import read_csv, read_parquet, write_parquet
from polarsim.geometry.ground_diameters import ground_diameters
from polarsim.geometry.poses import camera_pose
from polarsim.report.rock_diameters import report_rock_diameters
from polarsim.run_files.rigs import LocalisedRig, write_localised
from tests.support.polar_rig import default_rig

ROCKS = [(0.5, -0.8, 0.30), (-0.4, 0.3, 0.12), (-1.2, -1.0, 0.20)]  # x, y, diameter, metres
POSE = camera_pose(np.array([3.5, -0.3, 1.5]), np.radians(178), np.radians(25))


@pytest.fixture
def rig():
    return LocalisedRig(default_rig(), POSE, "scans")


def drum(x, y, diameter, height=0.1):
    """Return points on a vertical cylinder on the ground."""
    angle = np.linspace(0, 2 * np.pi, 73)
    ring = np.stack([x + diameter / 2 * np.cos(angle), y + diameter / 2 * np.sin(angle)], axis=1)
    return np.concatenate([np.column_stack([ring, np.full(len(ring), z)]) for z in np.linspace(0, height, 9)])


@pytest.mark.parametrize("camera", ["L", "R"])
def test_cylinders_on_the_ground_have_their_place_and_diameter(rig, camera):
    view = rig.camera(camera)
    boxes = np.array([view.box_around(drum(*rock)) for rock in ROCKS])
    centres, diameters = ground_diameters(view, boxes)
    np.testing.assert_allclose(centres, [rock[:2] for rock in ROCKS], atol=0.02)
    np.testing.assert_allclose(diameters, [rock[2] for rock in ROCKS], rtol=0.06)


def test_raised_ground_is_taken_into_account(rig):
    view = rig.camera("L")
    lifted = drum(*ROCKS[0]) + np.array([0, 0, 0.2])
    _, diameter = ground_diameters(view, view.box_around(lifted)[None], level=0.2)
    assert diameter[0] == pytest.approx(ROCKS[0][2], rel=0.06)


def test_boxes_above_the_horizon_have_no_diameter():
    level = LocalisedRig(default_rig(), camera_pose(np.array([3.5, 0, 1.5]), np.pi, 0.0), "scans")
    assert np.isnan(ground_diameters(level.camera("L"), np.array([[900, 100, 950, 120.0]]))[1]).all()


@pytest.fixture
def measured(rig, tmp_path):
    write_localised(tmp_path / "cameras/PosA.json", rig)
    random, rows = np.random.default_rng(0), []
    for exposure in (64, 128, 256, 512, 1024):
        for camera in "LR":
            view, key = rig.camera(camera), f"01_A_off_30_{camera}_{exposure:04d}"
            for rock in ROCKS:
                rows.append((key, "rock", 0.8, *(view.box_around(drum(*rock)) + random.normal(0, 1, 4))))
                rows.append((key, "shadow", 0.9, *view.box_around(drum(*rock))))
    rows.append(("01_A_off_30_L_0064", "rock", 0.6, *rig.camera("L").box_around(drum(1.0, 1.0, 0.2))))  # once
    rows.append(("01_A_off_30_L_0064", "rock", 0.1, *rig.camera("L").box_around(drum(0.0, -1.2, 0.2))))  # unsure
    write_parquet(tmp_path / "predictions.parquet", pd.DataFrame(rows, columns=list(COLUMNS)))
    cameras = {1: tmp_path / "cameras"}
    measure_diameters(predictions=tmp_path / "predictions.parquet", cameras=cameras, diameters=tmp_path / "out.parquet")
    return tmp_path


def test_boxes_of_all_photos_are_merged_and_single_detections_excluded(measured):
    table = read_parquet(measured / "out.parquet").sort_values("diameter_m", ascending=False)
    expected = sorted(ROCKS, key=lambda rock: -rock[2])
    np.testing.assert_allclose(table[["x", "y"]], [rock[:2] for rock in expected], atol=0.03)
    np.testing.assert_allclose(table["diameter_m"], [rock[2] for rock in expected], rtol=0.08)
    assert table["photos"].tolist() == [10, 10, 10]


def test_the_report_states_the_abundance(measured):
    write_json(measured / "area.json", {"area_m2": 14.0})
    report_rock_diameters(
        diameters=measured / "out.parquet", areas={1: measured / "area.json"}, table=measured / "rock_diameters",
        origin={"run": "here", "source": "analog", "config": "abc"},
    )  # fmt: skip
    assert len(read_csv(measured / "rock_diameters.csv")) == 3
    assert "3 rocks of at least 8 cm, k = " in (measured / "rock_diameters.md").read_text()


def test_predictions_without_a_rock_are_refused(measured):
    write_parquet(measured / "none.parquet", pd.DataFrame(columns=list(COLUMNS)))
    with pytest.raises(DetectError, match="no rock"):
        measure_diameters(predictions=measured / "none.parquet", cameras={}, diameters=measured / "x.parquet")
